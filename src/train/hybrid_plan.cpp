#include "doppel/train/hybrid_plan.h"

namespace doppel {

HybridPlan::HybridPlan() : rounds_{{110000, 400, 0.01}, {500000, 400, 0.1}} {}

HybridPlan HybridPlan::read(const ConfigReader& root) {
  HybridPlan plan;
  const std::vector<ConfigReader> sections = root.sections("rounds");
  if (!sections.empty()) plan.rounds_.clear();
  for (const ConfigReader& section : sections) {
    HybridRound round;
    round.field = section.get<long>("field", round.field, at_least(0L));
    round.refine = section.get<long>("refine", round.refine, at_least(0L));
    round.variance = section.get("variance", round.variance, at_least(0.0));
    plan.rounds_.push_back(round);
  }
  plan.joint_ = root.get<long>("joint", plan.joint_, at_least(0L));
  const ConfigReader rates = root.section("rates");
  plan.field_rate_ = rates.get("field", plan.field_rate_, between(0.0, 10.0));
  plan.refine_rate_ = rates.get("refine", plan.refine_rate_, between(0.0, 10.0));
  plan.joint_rate_ = rates.get("joint", plan.joint_rate_, between(0.0, 10.0));
  plan.final_ratio_ = rates.get("final_ratio", plan.final_ratio_, between(0.0, 1.0));
  if (plan.iterations() == 0) root.fail_at_key("rounds", "no round has any steps, so nothing would be trained");
  return plan;
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

HybridPlan::Place HybridPlan::at(std::int64_t step) const {
  Place place;
  for (const Part& part : parts()) {
    if (part.steps == 0) continue;
    place = {part.phase, step == 0, part.variance};
    if (step < part.steps) return place;
    step -= part.steps;
  }
  return place;
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
