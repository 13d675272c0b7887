#include "doppel/synth/performance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "doppel/core/random.h"
#include "doppel/synth/body_field.h"
#include "doppel/synth/movements.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

constexpr double kTwoPi = 6.283185307179586;

/// A movement of the legs over some time, faded in and out.
struct Step {
  enum Kind { walk, squat, jump, sway, kinds } kind;
  double begin, end, strength, phase;

  double presence(double t) const {
    const double fade = 0.3;
    return smooth_step(begin - fade, begin + fade, t) * (1 - smooth_step(end - fade, end + fade, t));
  }
};

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
      case Step::jump:
        height += jump(pose, s, amount);
        break;
      case Step::sway:
        sway(pose, s, step.phase, amount);
        break;
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

double sole_height(const Skeleton& skeleton, const std::vector<double>& dofs) {
  static const std::array<Vector3d, 4> kSole{Vector3d(0.105, 0, -0.09), Vector3d(0.12, 0, 0.19),
                                             Vector3d(0.07, 0, 0.09), Vector3d(0.165, 0, 0.09)};
  // The feet of another body are as much larger as its bone from ankle to toe. Computed as in make_skeleton, so that
  // the factors of the actor's own body are exactly 1.
  const Vector3d own_toe = (BodyPlan::toe() - BodyPlan::root()) - (BodyPlan::ankle() - BodyPlan::root());
  const Vector3d larger = skeleton.joints[*skeleton.find_joint("LeftFootEE")].offset.cwiseQuotient(own_toe);
  const auto world_from_joint = skeleton.pose(dofs);
  // A soft minimum, so that the root does not jump when the weight shifts from one foot to the other.
  constexpr double kSoftness = 0.008;
  double sum = 0;
  for (int s = 0; s < 2; ++s)
    for (const Vector3d& point : kSole) {
      const Vector3d from_ankle =
          (s == 0 ? point : mirrored(point)) - (s == 0 ? BodyPlan::ankle() : mirrored(BodyPlan::ankle()));
      const double y =
          (world_from_joint[*skeleton.find_joint(std::string(kSides[s]) + "Foot_rz")] * from_ankle.cwiseProduct(larger))
              .y();
      sum += std::exp(-y / kSoftness);
    }
  return -kSoftness * std::log(sum / 4);
}

void put_on_floor(const Skeleton& skeleton, std::vector<double>& dofs, double height) {
  const int lift = *skeleton.find_dof("Root_ty");
  dofs[lift] = 0;
  dofs[lift] = height - sole_height(skeleton, dofs);
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
