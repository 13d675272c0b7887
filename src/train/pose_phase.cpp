#include "doppel/train/pose_phase.h"

namespace doppel {

double PosePhase::limits_weight(double progress) const {
  if (progress >= limits_off_at) return 0.0;
  return progress >= limits_reduced_at ? 0.1 * limits : limits;
}

PosePhases::PosePhases() {
  PosePhase first;
  first.limits = 1.0;
  PosePhase second;
  second.learning_rate = 1e-6;
  second.keypoints = 1e-4;
  PosePhase third = second;
  third.keypoints = 1e-5;
  phases_ = {first, second, third};
}

void describe_keys(const Keys& keys, PosePhase& phase) {
  keys("iterations", phase.iterations, at_least<std::int64_t>(1), "steps");
  keys("learning_rate", phase.learning_rate, between(0.0, 10.0), "of all steps");
  keys("keypoints", phase.keypoints, at_least(0.0),
       "weight of the keypoint loss, squared pixels of an image 1024 wide");
  keys("limits", phase.limits, at_least(0.0), "weight of the limits loss, squared radians");
  keys("limits_reduced_at", phase.limits_reduced_at, between(0.0, 1.0),
       "share of the phase after which the limits loss counts a tenth");
  keys("limits_off_at", phase.limits_off_at, between(0.0, 1.0), "share after which it counts nothing");
}

void describe_keys(const Keys& keys, PosePhases& phases) {
  keys.items("phases", phases.phases_, "one after the other; without it, the three of A.1.1");
  keys.require("phases", !phases.phases_.empty(),
               "the list is empty, so nothing would be trained; name a phase, or leave phases out");
}

std::int64_t PosePhases::iterations() const {
  std::int64_t sum = 0;
  for (const PosePhase& phase : phases_) sum += phase.iterations;
  return sum;
}

Schedule PosePhases::schedule() const {
  Schedule schedule;
  schedule.kind = Schedule::Kind::pieces;
  schedule.iterations = iterations();
  std::int64_t end = 0;
  for (const PosePhase& phase : phases_) {
    end += phase.iterations;
    schedule.pieces.push_back({end, phase.learning_rate});
  }
  return schedule;
}

PosePhases::Position PosePhases::at(std::int64_t step) const& {
  for (const PosePhase& phase : phases_) {
    if (step < phase.iterations) return {&phase, static_cast<double>(step) / static_cast<double>(phase.iterations)};
    step -= phase.iterations;
  }
  const auto last = static_cast<double>(phases_.back().iterations);
  return {&phases_.back(), (last - 1.0) / last};
}

}  // namespace doppel
