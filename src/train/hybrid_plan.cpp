#include "doppel/train/hybrid_plan.h"

namespace doppel {

HybridPlan::HybridPlan() : rounds_{{110000, 400, 0.01}, {500000, 400, 0.1}} {}

void describe_keys(const Keys& keys, HybridRound& round) {
  keys("field", round.field, at_least<std::int64_t>(0), "steps of the radiance field");
  keys("refine", round.refine, at_least<std::int64_t>(0), "steps of DeltaNet");
  keys("variance", round.variance, at_least(0.0), "weight of the variance of depths (6.28)");
}

void describe_keys(const Keys& keys, HybridPlan& plan) {
  keys.items("rounds", plan.rounds_, "one after the other; without it, the two of A.3");
  keys("joint", plan.joint_, at_least<std::int64_t>(0), "end-to-end steps after the last round");
  keys("rates.field", plan.field_rate_, between(0.0, 10.0), "learning rate at the start of a phase of the field");
  keys("rates.refine", plan.refine_rate_, between(0.0, 10.0), "the same of DeltaNet");
  keys("rates.joint", plan.joint_rate_, between(0.0, 10.0), "the same of end-to-end steps");
  keys("rates.final_ratio", plan.final_ratio_, between(0.0, 1.0), "last rate / first rate of a phase");
  keys.require("rounds", plan.iterations() > 0, "no round has any steps, so nothing would be trained");
  keys.require("rates.joint", plan.joint_ > 0 || plan.joint_rate_ == HybridPlan().joint_rate_,
               "without `joint` there are no end-to-end steps that it could be the rate of; set joint to a number of "
               "steps, or leave rates.joint out");
}

std::vector<HybridPlan::Part> HybridPlan::parts() const {
  std::vector<Part> parts;
  for (const HybridRound& round : rounds_) {
    parts.push_back({HybridPhase::field, round.field, round.variance});
    parts.push_back({HybridPhase::refine, round.refine, round.variance});
  }
  parts.push_back({HybridPhase::joint, joint_, rounds_.empty() ? 0.0 : rounds_.back().variance});
  return parts;
}

std::int64_t HybridPlan::iterations() const {
  std::int64_t sum = 0;
  for (const Part& part : parts()) sum += part.steps;
  return sum;
}

Schedule HybridPlan::schedule() const {
  Schedule schedule;
  schedule.kind = Schedule::Kind::pieces;
  schedule.iterations = iterations();
  std::int64_t end = 0;
  for (const Part& part : parts()) {
    if (part.steps == 0) continue;
    end += part.steps;
    const double rate = part.phase == HybridPhase::field    ? field_rate_
                        : part.phase == HybridPhase::refine ? refine_rate_
                                                            : joint_rate_;
    schedule.pieces.push_back({end, rate, final_ratio_});
  }
  return schedule;
}

HybridPlan::Position HybridPlan::at(std::int64_t step) const {
  Position position;
  for (const Part& part : parts()) {
    if (part.steps == 0) continue;
    position = {part.phase, step == 0, part.variance};
    if (step < part.steps) return position;
    step -= part.steps;
  }
  return position;
}

bool HybridPlan::comes(HybridPhase phase, std::int64_t step) const {
  std::int64_t end = 0;
  for (const Part& part : parts()) {
    end += part.steps;
    if (part.steps > 0 && end > step && (part.phase == phase || part.phase == HybridPhase::joint)) return true;
  }
  return false;
}

}  // namespace doppel
