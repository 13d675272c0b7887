#include "doppel/rigging/body/proportions.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/rigging/body/measures.h"

namespace doppel {

BodyFactors proportional_factors(std::span<const double> measures, std::span<const double> reference) {
  const auto ratio = [&](const char* name) {
    const int i = measure_index(name);
    return measures[i] / reference[i];
  };
  const auto breadth = [](double girth, double depth) { return girth * std::sqrt(girth / depth); };
  BodyFactors f;
  f[kTrunkLength] = ratio("trunk_length");
  f[kNeckLength] = ratio("neck_length");
  f[kHeadHeight] = ratio("head_height");
  f[kUpperArmLength] = ratio("upper_arm_length");
  f[kForearmLength] = ratio("forearm_length");
  f[kHandLength] = ratio("hand_length");
  f[kThighLength] = ratio("thigh_length");
  f[kShinLength] = ratio("shin_length");
  f[kFootLength] = ratio("foot_length");
  f[kAnkleHeight] = ratio("ankle_height");
  f[kShoulderJoints] = ratio("shoulder_breadth");
  f[kHipJoints] = ratio("hip_breadth");
  f[kHandBreadth] = ratio("hand_breadth");
  f[kFootBreadth] = ratio("foot_breadth");
  f[kHeadBreadth] = ratio("head_breadth");
  f[kHeadDepth] = ratio("head_depth");
  f[kNeckGirth] = ratio("neck_girth");
  f[kChestDepth] = ratio("chest_depth");
  f[kChestBreadth] = breadth(ratio("chest_girth"), f[kChestDepth]);
  f[kWaistDepth] = ratio("belly_depth");
  f[kWaistBreadth] = breadth(ratio("waist_girth"), f[kWaistDepth]);
  f[kHipGirth] = ratio("hip_girth");
  f[kUpperArmGirth] = ratio("upper_arm_girth");
  f[kForearmGirth] = ratio("forearm_girth");
  f[kWristGirth] = ratio("wrist_girth");
  f[kThighGirth] = ratio("thigh_girth");
  f[kKneeGirth] = ratio("knee_girth");
  f[kCalfGirth] = ratio("calf_girth");
  f[kAnkleGirth] = ratio("ankle_girth");
  return f;
}

void check_measures(std::span<const double> measures) {
  const std::vector<BodyMeasure>& known = body_measures();
  if (measures.size() != known.size())
    fail("the measures of a body: found {} values; a body has {} measures", measures.size(), known.size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    const bool may_be_zero = known[i].low == 0;
    if (!std::isfinite(measures[i]) || measures[i] < 0 || (measures[i] == 0 && !may_be_zero))
      fail("the measures of a body: {} is {} m; it must be a number {} 0, and is usually {} to {}", known[i].name,
           measures[i], may_be_zero ? "of at least" : "above", known[i].low, known[i].high);
  }
}

}  // namespace doppel
