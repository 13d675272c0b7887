#include "doppel/synth/movements.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"

namespace doppel::synth {

const std::array<const char*, 2> kSides{"Left", "Right"};

namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr std::array<double, 3> kShare{0.5, 0.3, 0.2};

}  // namespace

Wave::Wave(Random& random, double slowest, double fastest) {
  for (Term& term : terms_) term = {random.uniform(slowest, fastest), random.uniform(0, kTwoPi)};
}

double Wave::operator()(double t) const {
  double sum = 0;
  for (std::size_t k = 0; k < terms_.size(); ++k)
    sum += kShare[k] * std::sin(kTwoPi * terms_[k].hertz * t + terms_[k].phase);
  return sum;
}

double& Pose::operator[](const std::string& name) {
  const auto index = skeleton_.find_dof(name);
  if (!index) fail("making a motion: the skeleton has no DoF '{}'", name);
  return dofs[*index];
}

void Pose::keep_limits() {
  for (int d = 0; d < skeleton_.num_dofs(); ++d)
    if (const auto& limits = skeleton_.dofs[d].limits) dofs[d] = std::clamp(dofs[d], (*limits)[0], (*limits)[1]);
}

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

double jump(Pose& pose, double t, double amount) {
  // Down, off the floor, down again: one cycle of 0.9 s, in the air for 0.36 s of it.
  const double cycle = t / 0.9 - std::floor(t / 0.9);
  const double flight = std::max(0.0, std::sin(kTwoPi * std::clamp((cycle - 0.3) / 0.8, 0.0, 0.5)));
  bend_legs(pose, amount * 0.42 * (0.5 + 0.5 * std::cos(kTwoPi * cycle)));
  return 0.13 * amount * flight * flight;
}

void sway(Pose& pose, double t, double phase, double amount) {
  const double turn = std::sin(kTwoPi * 0.85 * t + phase);
  pose["Root_ry"] += 0.55 * amount * turn;
  pose["Root_rz"] += 0.10 * amount * std::cos(kTwoPi * 0.85 * t + phase);
  // The feet stay behind while the hips twist.
  for (const std::string side : kSides) pose[side + "UpLeg_ry"] += (side == "Left" ? -0.35 : 0.35) * amount * turn;
  bend_legs(pose, 0.12 * amount);
}

}  // namespace doppel::synth
