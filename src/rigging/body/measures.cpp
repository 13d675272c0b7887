#include "doppel/rigging/body/measures.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/random.h"

namespace doppel {
namespace {

/// What random bodies need beside the means: how a measure goes with stature and with mass (correlations), and the
/// child's share of the adult mean. Shares of children of eight years: after Snyder et al. 1977, rounded.
struct Variation {
  double with_stature, with_mass, child;
};

struct Row {
  BodyMeasure measure;
  Variation variation;
};

const std::vector<Row>& rows() {
  // ANSUR II: Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel, NATICK/TR-15/007, 2014.
  static const std::vector<Row> kRows{
      {{"upper_arm_length", .271, .295, .0165, .0175, .15, .38, "ANSUR II acromion-radiale length, less 40 mm"},
       {.80, .05, .71}},
      {{"forearm_length", .2419, .2676, .0145, .0155, .13, .34, "ANSUR II radiale-stylion length"}, {.75, .05, .70}},
      {{"hand_length", .1814, .1931, .0097, .0099, .11, .24, "ANSUR II hand length"}, {.65, .10, .76}},
      {{"hand_breadth", .0783, .0882, .0038, .0042, .05, .115, "ANSUR II hand breadth"}, {.35, .40, .77}},
      {{"shoulder_breadth", .305, .356, .0183, .0192, .18, .45, "ANSUR II biacromial breadth, less 60 mm"},
       {.45, .30, .73}},
      {{"hip_breadth", .168, .171, .012, .012, .10, .23, "0.62 of the ANSUR II bicristal breadth"}, {.35, .40, .72}},
      {{"thigh_length", .398, .415, .026, .028, .20, .53,
        "ANSUR II trochanterion height, plus 10 mm, less lateral femoral epicondyle height"},
       {.80, .05, .72}},
      {{"shin_length", .3905, .425, .0225, .0245, .20, .53,
        "ANSUR II lateral femoral epicondyle height less lateral malleolus height"},
       {.85, .05, .72}},
      {{"ankle_height", .0645, .072, .0055, .0056, .035, .10, "ANSUR II lateral malleolus height"}, {.40, .10, .80}},
      {{"foot_length", .2462, .2712, .0123, .0131, .15, .34, "ANSUR II foot length"}, {.70, .15, .77}},
      {{"foot_breadth", .0928, .1018, .0050, .0054, .055, .135, "ANSUR II foot breadth, horizontal"}, {.35, .35, .78}},
      {{"trunk_length", .534, .586, .026, .028, .30, .72,
        "ANSUR II cervicale height, less 20 mm, less trochanterion height, less 10 mm"},
       {.75, .10, .72}},
      {{"neck_length", .099, .112, .010, .011, .05, .16,
        "ANSUR II stature less tragion-top of head, 15 mm, and cervicale height less 20 mm"},
       {.35, -.25, .72}},
      {{"head_height", .1425, .146, .0065, .0068, .11, .175, "ANSUR II tragion-top of head, plus 15 mm"},
       {.25, .05, .94}},
      {{"head_breadth", .1472, .1546, .0055, .0056, .12, .185, "ANSUR II head breadth"}, {.15, .25, .95}},
      {{"head_depth", .190, .1994, .0069, .0071, .15, .235, "ANSUR II head length"}, {.20, .20, .94}},
      {{"neck_girth", .3299, .3976, .0190, .0256, .20, .60, "ANSUR II neck circumference"}, {.15, .75, .76}},
      {{"chest_girth", .9468, 1.0587, .0833, .0874, .50, 1.60, "ANSUR II chest circumference"}, {.10, .92, .64}},
      {{"chest_depth", .246, .2545, .0271, .0259, .13, .46, "ANSUR II chest depth"}, {.05, .85, .64}},
      {{"waist_girth", .8604, .9408, .0997, .1116, .42, 1.70, "ANSUR II waist circumference at the omphalion"},
       {.10, .93, .62}},
      {{"belly_depth", .2146, .237, .0292, .0315, .11, .52, "ANSUR II waist depth"}, {.05, .92, .64}},
      {{"hip_girth", 1.0204, 1.0199, .0761, .0766, .50, 1.70, "ANSUR II buttock circumference"}, {.20, .92, .66}},
      {{"upper_arm_girth", .3055, .3581, .0311, .0346, .14, .56, "ANSUR II biceps circumference, flexed"},
       {.05, .85, .62}},
      {{"forearm_girth", .2641, .310, .0184, .0223, .13, .42, "ANSUR II forearm circumference, flexed"},
       {.15, .80, .68}},
      {{"wrist_girth", .1552, .1757, .0078, .0090, .09, .24, "ANSUR II wrist circumference"}, {.35, .55, .77}},
      {{"thigh_girth", .6166, .6249, .0583, .0573, .28, 1.02, "ANSUR II thigh circumference"}, {.10, .92, .62}},
      {{"knee_girth", .399, .410, .032, .0327, .20, .62, "ANSUR II lower thigh circumference"}, {.15, .88, .70}},
      {{"calf_girth", .3733, .3922, .0282, .0296, .18, .60, "ANSUR II calf circumference"}, {.15, .80, .69}},
      {{"ankle_girth", .2158, .2293, .0149, .0146, .12, .33, "ANSUR II ankle circumference"}, {.25, .60, .78}},
      {{"hair_volume", .032, .018, .013, .007, 0, .08, "chosen: how far the hair stands off the skull"}, {0, 0, 1}},
      {{"top_looseness", .012, .014, .005, .005, 0, .05, "chosen: how far the top stands off trunk and arms"},
       {0, 0, .9}},
      {{"trousers_looseness", .010, .012, .004, .005, 0, .04, "chosen: how far the trousers stand off the legs"},
       {0, 0, .9}}};
  return kRows;
}

double mean_of(const BodyMeasure& m) { return 0.5 * (m.mean_woman + m.mean_man); }

/// Standard normal, by the method of Box and Muller.
double normal(Random& random) {
  const double u = 1.0 - random.uniform(), angle = 2 * M_PI * random.uniform();
  return std::sqrt(-2 * std::log(u)) * std::cos(angle);
}

double mean_of(const Row& row, BodyBuild build) {
  if (build == BodyBuild::child) return row.variation.child * mean_of(row.measure);
  return build == BodyBuild::man ? row.measure.mean_man : row.measure.mean_woman;
}

double deviation_of(const Row& row, BodyBuild build) {
  const BodyMeasure& m = row.measure;
  if (build == BodyBuild::child) return row.variation.child * 0.5 * (m.deviation_woman + m.deviation_man);
  return build == BodyBuild::man ? m.deviation_man : m.deviation_woman;
}

}  // namespace

const std::vector<BodyMeasure>& body_measures() {
  static const std::vector<BodyMeasure> kMeasures = [] {
    std::vector<BodyMeasure> measures;
    for (const Row& row : rows()) measures.push_back(row.measure);
    return measures;
  }();
  return kMeasures;
}

int measure_index(const std::string& name) {
  const std::vector<BodyMeasure>& measures = body_measures();
  std::string known;
  for (std::size_t i = 0; i < measures.size(); ++i) {
    if (measures[i].name == name) return static_cast<int>(i);
    known += (i == 0 ? "" : ", ") + measures[i].name;
  }
  fail<UsageError>("a body has no measure '{}'; its measures are {}", name, known);
}

std::vector<double> mean_measures(BodyBuild build) {
  std::vector<double> means;
  for (const Row& row : rows()) means.push_back(mean_of(row, build));
  return means;
}

std::vector<double> mean_measures() {
  std::vector<double> means;
  for (const BodyMeasure& m : body_measures()) means.push_back(mean_of(m));
  return means;
}

std::vector<double> measure_deviations() {
  std::vector<double> deviations;
  for (const BodyMeasure& m : body_measures()) {
    const double apart = 0.5 * (m.mean_man - m.mean_woman);
    deviations.push_back(
        std::sqrt(0.5 * (m.deviation_woman * m.deviation_woman + m.deviation_man * m.deviation_man) + apart * apart));
  }
  return deviations;
}

BodyBuild random_build(std::uint64_t seed) {
  const double draw = Random(hash_bits(seed)).uniform();
  return draw < 0.4 ? BodyBuild::woman : draw < 0.8 ? BodyBuild::man : BodyBuild::child;
}

std::vector<double> random_measures(std::uint64_t seed) {
  const BodyBuild build = random_build(seed);
  Random random(hash_bits(seed) + 1);
  // A child's age changes its stature more than stature varies among adults.
  const double stature = (build == BodyBuild::child ? 2.0 : 1.0) * normal(random), mass = normal(random);
  std::vector<double> measures;
  for (const Row& row : rows()) {
    const auto& [s, m, child] = row.variation;
    const double own = std::sqrt(1 - s * s - m * m);
    const double z = s * stature + m * mass + own * normal(random);
    measures.push_back(
        std::clamp(mean_of(row, build) + z * deviation_of(row, build), row.measure.low, row.measure.high));
  }
  return measures;
}

}  // namespace doppel
