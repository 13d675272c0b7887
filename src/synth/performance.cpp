#include "doppel/synth/performance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "doppel/core/error.h"
#include "doppel/core/random.h"
#include "doppel/synth/body_field.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

constexpr double kTwoPi = 6.283185307179586;

/// A sum of three sinusoids of random frequency and phase, within [-1, 1].
class Wave {
 public:
  Wave(Random& random, double slowest, double fastest) {
    for (Term& term : terms_) term = {random.uniform(slowest, fastest), random.uniform(0, kTwoPi)};
  }
  double operator()(double t) const {
    double sum = 0;
    for (std::size_t k = 0; k < terms_.size(); ++k)
      sum += kShare[k] * std::sin(kTwoPi * terms_[k].hertz * t + terms_[k].phase);
    return sum;
  }

 private:
  struct Term {
    double hertz = 0, phase = 0;
  };
  static constexpr std::array<double, 3> kShare{0.5, 0.3, 0.2};
  std::array<Term, 3> terms_;
};

/// A pose under construction, by DoF name.
class Pose {
 public:
  explicit Pose(const Skeleton& skeleton) : skeleton_(skeleton), dofs(skeleton.num_dofs(), 0.0) {}

  double& operator[](const std::string& name) {
    const auto index = skeleton_.find_dof(name);
    if (!index) fail("making a motion: the skeleton has no DoF '{}'", name);
    return dofs[*index];
  }
  void keep_limits() {
    for (int d = 0; d < skeleton_.num_dofs(); ++d)
      if (const auto& limits = skeleton_.dofs[d].limits) dofs[d] = std::clamp(dofs[d], (*limits)[0], (*limits)[1]);
  }

 private:
  const Skeleton& skeleton_;

 public:
  std::vector<double> dofs;
};

/// A movement of the legs over some time, faded in and out.
struct Step {
  enum Kind { walk, squat, jump, sway, kinds } kind;
  double begin, end, strength, phase;

  double presence(double t) const {
    const double fade = 0.3;
    return smooth_step(begin - fade, begin + fade, t) * (1 - smooth_step(end - fade, end + fade, t));
  }
};

const std::array<const char*, 2> kSides{"Left", "Right"};

void bend_legs(Pose& pose, double amount) {
  for (const std::string side : kSides) {
    pose[side + "UpLeg_rx"] += 1.05 * amount;
    pose[side + "UpLeg_rz"] += 0.14 * amount;
    pose[side + "Leg_rx"] += 1.4 * amount;
    pose[side + "Foot_rx"] += 0.63 * amount;  // 0.28 - 1.05 + 1.4 - 0.63 = 0: the soles stay level
  }
  pose["Root_rx"] += 0.28 * amount;
  pose["Root_tz"] -= 0.06 * amount;
}

void walk(Pose& pose, double phase, double amount) {
  for (int s = 0; s < 2; ++s) {
    const std::string side = kSides[s];
    const double swing = std::sin(phase + (s == 0 ? 0 : kTwoPi / 2));
    const double lift = std::pow(std::max(0.0, std::sin(phase + (s == 0 ? 0.5 : 0.5 + kTwoPi / 2))), 2.0);
    pose[side + "UpLeg_rx"] += amount * (0.34 * swing + 0.25 * lift);
    pose[side + "Leg_rx"] += amount * (0.12 + 0.95 * lift);
    pose[side + "Foot_rx"] += amount * (0.12 - 0.34 * swing * (1 - lift) - 0.25 * lift);
    pose[side + "Arm_rx"] -= 0.4 * amount * swing;
    pose[side + "ForeArm_rx"] += 0.25 * amount * (1 - swing);
  }
  pose["Root_rz"] += 0.04 * amount * std::cos(phase);
  pose["Root_ry"] += 0.10 * amount * std::sin(phase);
}

/// A generated motion as a function of time.
class Performance {
 public:
  Performance(const Skeleton& skeleton, double seconds, std::uint64_t seed, double turn)
      : skeleton_(skeleton),
        random_(seed),
        turn_(turn),
        heading_(random_, 0.12, 0.5),
        lean_(random_, 0.2, 0.5),
        side_(random_, 0.15, 0.4),
        forth_(random_, 0.15, 0.4),
        look_(random_, 0.2, 0.6),
        nod_(random_, 0.3, 0.7),
        facing_(random_.uniform(-0.8, 0.8)) {
    for (int arm = 0; arm < 2; ++arm)
      for (int k = 0; k < 5; ++k) arms_[arm].emplace_back(random_, 0.2, k < 2 ? 0.7 : 0.9);
    int previous = -1;
    for (double t = -0.5; t < seconds + 0.5;) {
      const double length = random_.uniform(1.1, 2.0);
      int kind = random_.index(Step::kinds);
      if (kind == previous) kind = (kind + 1) % Step::kinds;
      steps_.push_back(
          {static_cast<Step::Kind>(kind), t, t + length, random_.uniform(0.7, 1.0), random_.uniform(0, kTwoPi)});
      previous = kind;
      t += length;
    }
  }

  std::vector<double> at(double t) const {
    Pose pose(skeleton_);
    double height = 0;
    pose["Root_ry"] = facing_ + turn_ * t + 0.95 * heading_(t);
    pose["Root_rz"] = 0.05 * lean_(t);
    pose["Root_rx"] = 0.05 * lean_(1.3 * t + 2);
    pose["Root_tx"] = 0.16 * side_(t);
    pose["Root_tz"] = 0.16 * forth_(t);
    pose["Head_ry"] = 0.4 * look_(t);
    pose["Head_rz"] = 0.12 * look_(0.7 * t + 1);
    pose["Head_rx"] = 0.05 + 0.2 * nod_(t);
    swing_arms(pose, t);
    for (const Step& step : steps_) take(step, t, pose, height);
    pose.keep_limits();
    put_on_floor(skeleton_, pose.dofs, height);
    return pose.dofs;
  }

 private:
  void swing_arms(Pose& pose, double t) const {
    for (int s = 0; s < 2; ++s) {
      const std::string side = kSides[s];
      const auto& wave = arms_[s];
      const double raise = wave[0](t);
      pose[side + "Arm_rz"] = 0.1 + 0.75 * raise;
      pose[side + "Arm_rx"] = 0.12 + 0.4 * wave[1](t);
      pose[side + "Shoulder_rz"] = 0.08 + 0.14 * raise;
      pose[side + "Shoulder_ry"] = 0.1 * wave[1](t + 0.2);
      pose[side + "ForeArm_rx"] = 0.55 + 0.5 * wave[2](t);
      pose[side + "ForeArm_roll"] = 0.5 * wave[3](t);
      pose[side + "UpLeg_rz"] = 0.04 + 0.03 * wave[4](t);
      pose[side + "UpLeg_ry"] = 0.08 + 0.08 * wave[4](t + 1);
    }
  }

  static void take(const Step& step, double t, Pose& pose, double& height) {
    const double amount = step.strength * step.presence(t);
    if (amount < 1e-6) return;
    const double s = t - step.begin;
    switch (step.kind) {
      case Step::walk:
        walk(pose, kTwoPi * 0.95 * s + step.phase, amount);
        break;
      case Step::squat:
        bend_legs(pose, amount * (0.5 - 0.5 * std::cos(kTwoPi * 0.75 * s)));
        break;
      case Step::jump: {
        // Down, off the floor, down again: one cycle of 0.9 s, in the air for 0.36 s of it.
        const double cycle = s / 0.9 - std::floor(s / 0.9);
        const double flight = std::max(0.0, std::sin(kTwoPi * std::clamp((cycle - 0.3) / 0.8, 0.0, 0.5)));
        bend_legs(pose, amount * 0.42 * (0.5 + 0.5 * std::cos(kTwoPi * cycle)));
        height += 0.13 * amount * flight * flight;
        break;
      }
      case Step::sway: {
        const double turn = std::sin(kTwoPi * 0.85 * s + step.phase);
        pose["Root_ry"] += 0.55 * amount * turn;
        pose["Root_rz"] += 0.10 * amount * std::cos(kTwoPi * 0.85 * s + step.phase);
        // The feet stay behind while the hips twist.
        for (const std::string side : kSides)
          pose[side + "UpLeg_ry"] += (side == "Left" ? -0.35 : 0.35) * amount * turn;
        bend_legs(pose, 0.12 * amount);
        break;
      }
      case Step::kinds:
        break;
    }
  }

  const Skeleton& skeleton_;
  Random random_;
  double turn_;
  Wave heading_, lean_, side_, forth_, look_, nod_;
  double facing_;
  std::array<std::vector<Wave>, 2> arms_;
  std::vector<Step> steps_;
};

}  // namespace

void put_on_floor(const Skeleton& skeleton, std::vector<double>& dofs, double height) {
  static const std::array<Vector3d, 4> kSole{Vector3d(0.105, 0, -0.09), Vector3d(0.12, 0, 0.19),
                                             Vector3d(0.07, 0, 0.09), Vector3d(0.165, 0, 0.09)};
  // The feet of another body are as much larger as its bone from ankle to toe.
  const Vector3d toe = skeleton.joints[*skeleton.find_joint("LeftFootEE")].offset;
  const Vector3d own = toe.cwiseQuotient(BodyPlan::toe() - BodyPlan::ankle());
  const int lift = *skeleton.find_dof("Root_ty");
  dofs[lift] = 0;
  const auto world_from_joint = skeleton.pose(dofs);
  // A soft minimum, so that the root does not jump when the weight shifts from one foot to the other.
  constexpr double kSoftness = 0.008;
  double sum = 0;
  for (int s = 0; s < 2; ++s)
    for (const Vector3d& point : kSole) {
      const Vector3d from_ankle =
          (s == 0 ? point : mirrored(point)) - (s == 0 ? BodyPlan::ankle() : mirrored(BodyPlan::ankle()));
      const double y =
          (world_from_joint[*skeleton.find_joint(std::string(kSides[s]) + "Foot_rz")] * from_ankle.cwiseProduct(own))
              .y();
      sum += std::exp(-y / kSoftness);
    }
  dofs[lift] = height + kSoftness * std::log(sum / 4);
}

Motion make_motion(const Skeleton& skeleton, int frames, double fps, std::uint64_t seed, double turn) {
  const Performance performance(skeleton, frames / fps, seed, turn);
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    motion.frames.push_back(performance.at(f / fps));
    motion.ids.push_back(f);
  }
  return motion;
}

}  // namespace doppel::synth
