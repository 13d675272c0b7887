#include "doppel/synth/repertoire.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "doppel/core/random.h"
#include "doppel/geometry/distance_field.h"
#include "doppel/synth/movements.h"
#include "doppel/synth/performance.h"

namespace doppel::synth {

namespace {

using Eigen::Vector2d;

constexpr double kFullTurn = 6.283185307179586;
constexpr double kFade = 0.35;         ///< seconds, half of the time in which an act begins or ends
constexpr double kMaxTurnRate = 2.2;   ///< radians per second, of a person who walks
constexpr double kTurnInertia = 0.25;  ///< seconds, in which the speed of turning changes

/// What the person does for some seconds.
struct Act {
  enum Kind { walking, turning, reaching, squatting, jumping, dancing, lunging, kicking, swaying, standing, kinds };
  Kind kind;
  double begin, end, strength;
  int side;                      ///< 0 left, 1 right: the limb that leads
  std::array<double, 4> chance;  ///< in [0, 1), as the act needs

  double presence(double t) const {
    return smooth_step(begin - kFade, begin + kFade, t) * (1 - smooth_step(end - kFade, end + kFade, t));
  }
  /// 0 at the begin and the end, 1 between.
  double hold(double t) const {
    const double x = (t - begin) / (end - begin);
    return smooth_step(0, 0.4, x) * (1 - smooth_step(0.6, 1, x));
  }
};

/// How often an act is chosen, relative to the others, and how long it lasts.
struct ActRule {
  double share, shortest, longest;  ///< seconds
};
constexpr std::array<ActRule, Act::kinds> kRules{{{3, 2.0, 4.5},
                                                  {2, 1.2, 2.5},
                                                  {4, 1.2, 3.0},
                                                  {1, 1.5, 3.0},
                                                  {1, 1.8, 2.8},
                                                  {4, 2.5, 5.0},
                                                  {1, 1.6, 2.6},
                                                  {1, 1.0, 1.6},
                                                  {1, 1.5, 3.0},
                                                  {1, 1.0, 2.5}}};

Act::Kind choose_kind(Random& random) {
  double sum = 0;
  for (const ActRule& rule : kRules) sum += rule.share;
  double rest = random.uniform(0, sum);
  for (int kind = 0; kind < Act::kinds - 1; ++kind) {
    rest -= kRules[kind].share;
    if (rest < 0) return static_cast<Act::Kind>(kind);
  }
  return Act::standing;
}

std::string side_name(int side) { return kSides[side]; }

/// Leans forward over standing legs. @param angle radians
void lean(Pose& pose, double angle) {
  pose["Root_rx"] += angle;
  for (const std::string side : kSides) pose[side + "UpLeg_rx"] += angle;
}

/// Lifts a leg with a bent knee.
void lift_leg(Pose& pose, int side, double thigh, double knee) {
  const std::string name = side_name(side);
  pose[name + "UpLeg_rx"] += thigh;
  pose[name + "Leg_rx"] += knee;
  pose[name + "Foot_rx"] += 0.4 * (knee - thigh);
}

void reach(Pose& pose, const Act& act, double t, double amount) {
  const double held = amount * act.hold(t), height = 2 * act.chance[0] - 1, forward = act.chance[1];
  const bool both = act.chance[2] < 0.35;
  for (int side = 0; side < 2; ++side) {
    if (!both && side != act.side) continue;
    const std::string name = side_name(side);
    pose[name + "Arm_rz"] += held * (0.2 + 1.3 * std::max(0.0, height) * (1 - 0.4 * forward));
    pose[name + "Arm_rx"] += held * (1.3 * forward + 0.3);
    pose[name + "ForeArm_rx"] -= 0.45 * held;
    pose[name + "Shoulder_rz"] += 0.25 * held * std::max(0.0, height);
  }
  const double low = std::max(0.0, -height);
  lean(pose, 0.65 * low * held);
  bend_legs(pose, 0.5 * low * held);
  const double twist = held * (act.chance[3] - 0.5);
  pose["Root_ry"] += 0.8 * twist;
  for (int side = 0; side < 2; ++side) pose[side_name(side) + "UpLeg_ry"] += (side == 0 ? -0.5 : 0.5) * twist;
}

/// @return the speed of turning that belongs to it, radians per second
double dance(Pose& pose, const Act& act, double t, double amount) {
  const double s = t - act.begin, beat = kFullTurn * (0.75 + 0.4 * act.chance[0]) * s;
  pose["Root_ry"] += 0.3 * amount * std::sin(beat);
  pose["Root_rz"] += 0.08 * amount * std::sin(beat + 0.8);
  bend_legs(pose, amount * 0.18 * (0.5 - 0.5 * std::cos(2 * beat)));
  for (int side = 0; side < 2; ++side) {
    const std::string name = side_name(side);
    const double half = side * kFullTurn / 2, arm = beat + (act.chance[1] < 0.5 ? half : 0);
    const double lift = std::pow(std::max(0.0, std::sin(beat + half)), 2.0);
    lift_leg(pose, side, 0.5 * amount * lift, 0.85 * amount * lift);
    pose[name + "UpLeg_rz"] += 0.25 * amount * act.chance[2] * lift;
    pose[name + "Arm_rz"] += amount * (0.35 + 0.65 * std::sin(arm));
    pose[name + "Arm_rx"] += 0.5 * amount * std::sin(0.5 * beat + half);
    pose[name + "ForeArm_rx"] += 0.55 * amount * (0.6 + std::sin(arm + 1.2));
  }
  return amount * 3.0 * (act.chance[3] - 0.5);
}

void lunge(Pose& pose, const Act& act, double t, double amount) {
  const double held = amount * act.hold(t);
  const std::string front = side_name(act.side), back = side_name(1 - act.side);
  pose[front + "UpLeg_rx"] += 0.8 * held;
  pose[front + "Leg_rx"] += 0.9 * held;
  pose[front + "Foot_rx"] += 0.1 * held;
  pose[back + "UpLeg_rx"] -= 0.4 * held;
  pose[back + "Leg_rx"] += 0.5 * held;
  pose[back + "Foot_rx"] += 0.55 * held;
  for (const std::string side : kSides) pose[side + "Arm_rz"] += 0.5 * act.chance[0] * held;
}

/// The motion as it goes on from frame to frame.
class Improvisation {
 public:
  Improvisation(const Skeleton& skeleton, double fps, std::uint64_t seed, double room)
      : skeleton_(skeleton),
        random_(seed),
        dt_(1 / fps),
        room_(room),
        heading_(random_.uniform(-0.5, 0.5) * kFullTurn),
        lean_(random_, 0.15, 0.4),
        look_(random_, 0.2, 0.6),
        nod_(random_, 0.3, 0.7) {
    for (auto& arm : arms_)
      for (int k = 0; k < 5; ++k) arm.emplace_back(random_, 0.15, k < 2 ? 0.6 : 0.8);
    choose_goal();
    while (acts_.empty() || acts_.back().end < 2 * kFade) add_act();
  }

  std::vector<double> next() {
    while (acts_.back().end < time_ + 2 * kFade) add_act();
    std::erase_if(acts_, [&](const Act& act) { return act.end + kFade < time_; });
    Pose pose(skeleton_);
    move_slowly(pose);
    double height = 0, turn = 0;
    for (const Act& act : acts_) perform(act, pose, height, turn);
    rate_ += (turn - rate_) * std::min(1.0, dt_ / kTurnInertia);
    heading_ += rate_ * dt_;
    pose["Root_ry"] += heading_;
    pose.keep_limits();
    put_on_floor(skeleton_, pose.dofs, height);
    travel(pose);
    time_ += dt_;
    return pose.dofs;
  }

 private:
  void add_act() {
    const Act::Kind kind = choose_kind(random_);
    const double begin = acts_.empty() ? -kFade : acts_.back().end;
    Act act{kind,
            begin,
            begin + random_.uniform(kRules[kind].shortest, kRules[kind].longest),
            random_.uniform(0.6, 1.0),
            random_.index(2),
            {}};
    for (double& chance : act.chance) chance = random_.uniform();
    acts_.push_back(act);
  }

  void choose_goal() {
    const double angle = random_.uniform(0, kFullTurn), away = room_ * std::sqrt(random_.uniform());
    goal_ = away * Vector2d(std::sin(angle), std::cos(angle));
  }

  /// What goes on beside all acts: the head looks around, the arms swing a little.
  void move_slowly(Pose& pose) {
    const double t = time_;
    pose["Root_rz"] = 0.04 * lean_(t);
    pose["Root_rx"] = 0.04 * lean_(1.3 * t + 2);
    pose["Head_ry"] = 0.5 * look_(t);
    pose["Head_rz"] = 0.12 * look_(0.7 * t + 1);
    pose["Head_rx"] = 0.05 + 0.25 * nod_(t);
    for (int s = 0; s < 2; ++s) {
      const std::string side = side_name(s);
      const auto& wave = arms_[s];
      pose[side + "Arm_rz"] = 0.05 + 0.3 * wave[0](t);
      pose[side + "Arm_rx"] = 0.1 + 0.25 * wave[1](t);
      pose[side + "Shoulder_rz"] = 0.05 + 0.08 * wave[0](t);
      pose[side + "ForeArm_rx"] = 0.45 + 0.35 * wave[2](t);
      pose[side + "ForeArm_roll"] = 0.5 * wave[3](t);
      pose[side + "UpLeg_rz"] = 0.03 + 0.03 * wave[4](t);
      pose[side + "UpLeg_ry"] = 0.08 + 0.06 * wave[4](t + 1);
    }
  }

  /// @param turn speed of turning, to which the act adds
  void perform(const Act& act, Pose& pose, double& height, double& turn) {
    const double amount = act.strength * act.presence(time_);
    if (amount < 1e-6) return;
    const double s = time_ - act.begin, phase = kFullTurn * act.chance[0];
    switch (act.kind) {
      case Act::walking:
        walk(pose, kFullTurn * (0.75 + 0.3 * act.chance[1]) * s + phase, amount);
        turn += amount * steering();
        break;
      case Act::turning:
        walk(pose, kFullTurn * 1.1 * s + phase, 0.4 * amount);
        turn += (act.side == 0 ? 1 : -1) * (1.2 + 2.0 * act.chance[1]) * amount;
        break;
      case Act::reaching:
        reach(pose, act, time_, amount);
        break;
      case Act::squatting:
        bend_legs(pose, amount * (0.5 - 0.5 * std::cos(kFullTurn * (0.4 + 0.35 * act.chance[1]) * s)));
        break;
      case Act::jumping:
        height += jump(pose, s, amount);
        break;
      case Act::dancing:
        turn += dance(pose, act, time_, amount);
        break;
      case Act::lunging:
        lunge(pose, act, time_, amount);
        break;
      case Act::kicking:
        lift_leg(pose, act.side, 1.1 * amount * act.hold(time_), 0.6 * amount * act.hold(time_));
        break;
      case Act::swaying:
        sway(pose, s, phase, amount);
        break;
      case Act::standing:
      case Act::kinds:
        break;
    }
  }

  /// The speed at which a walking person turns towards the goal, radians per second.
  double steering() {
    constexpr double kNear = 0.15;  // metres
    if ((goal_ - position_).norm() < kNear) choose_goal();
    const Vector2d way = goal_ - position_;
    const double off = std::remainder(std::atan2(way.x(), way.y()) - heading_, kFullTurn);
    return std::clamp(2.5 * off, -kMaxTurnRate, kMaxTurnRate);
  }

  /// Moves the root so that the foot on the floor stays where it is.
  void travel(Pose& pose) {
    constexpr double kSoftness = 0.02;      // metres; a foot that is higher by this has a third of the weight
    pose["Root_tx"] = pose["Root_tz"] = 0;  // acts shift the root over the feet; here the feet alone move it
    std::array<Vector2d, 2> feet;
    std::array<double, 2> weight;
    const auto world_from_joint = skeleton_.pose(pose.dofs);
    for (int side = 0; side < 2; ++side) {
      const Eigen::Vector3d foot =
          0.5 * (world_from_joint[*skeleton_.find_joint(side_name(side) + "Foot_rz")].translation() +
                 world_from_joint[*skeleton_.find_joint(side_name(side) + "FootEE")].translation());
      feet[side] = {foot.x(), foot.z()};
      weight[side] = std::exp(-foot.y() / kSoftness);
    }
    if (time_ > 0)
      for (int side = 0; side < 2; ++side)
        position_ -= (feet[side] - feet_[side]) * weight[side] / (weight[0] + weight[1]);
    feet_ = feet;
    position_ *= 1 - 2 * dt_ * smooth_step(room_, 1.5 * room_, position_.norm());
    pose["Root_tx"] = position_.x();
    pose["Root_tz"] = position_.y();
  }

  const Skeleton& skeleton_;
  Random random_;
  double dt_, room_, time_ = 0;
  double heading_, rate_ = 0;
  Vector2d position_ = Vector2d::Zero(), goal_ = Vector2d::Zero();  ///< (x, z) metres
  std::array<Vector2d, 2> feet_;                                    ///< of the last frame, relative to the root
  Wave lean_, look_, nod_;
  std::array<std::vector<Wave>, 2> arms_;
  std::vector<Act> acts_;
};

}  // namespace

Motion make_varied_motion(const Skeleton& skeleton, int frames, double fps, std::uint64_t seed, double room) {
  Improvisation improvisation(skeleton, fps, seed, room);
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    motion.frames.push_back(improvisation.next());
    motion.ids.push_back(f);
  }
  return motion;
}

}  // namespace doppel::synth
