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

PosePhases PosePhases::read(const ConfigReader& root) {
  PosePhases phases;
  const std::vector<ConfigReader> sections = root.sections("phases");
  if (sections.empty()) return phases;
  phases.phases_.clear();
  for (const ConfigReader& section : sections) {
    PosePhase phase;
    phase.iterations = section.get<long>("iterations", phase.iterations, at_least(1L));
    phase.learning_rate = section.get("learning_rate", phase.learning_rate, between(0.0, 10.0));
    phase.keypoints = section.get("keypoints", phase.keypoints, at_least(0.0));
    phase.limits = section.get("limits", phase.limits, at_least(0.0));
    phase.limits_reduced_at = section.get("limits_reduced_at", phase.limits_reduced_at, between(0.0, 1.0));
    phase.limits_off_at = section.get("limits_off_at", phase.limits_off_at, between(0.0, 1.0));
    phases.phases_.push_back(phase);
  }
  return phases;
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

PosePhases::Place PosePhases::at(std::int64_t step) const& {
  for (const PosePhase& phase : phases_) {
    if (step < phase.iterations) return {&phase, static_cast<double>(step) / static_cast<double>(phase.iterations)};
    step -= phase.iterations;
  }
  const auto last = static_cast<double>(phases_.back().iterations);
  return {&phases_.back(), (last - 1.0) / last};
}

}  // namespace doppel
