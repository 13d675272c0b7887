#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace doppel {

/// One measure of a body: a name, its mean and deviation in adult women and men, and the range that a body may have.
/// All are metres.
struct BodyMeasure {
  std::string name;                       ///< lower_snake, as in files and messages
  double mean_woman, mean_man;            ///< of adults
  double deviation_woman, deviation_man;  ///< standard deviations
  double low, high;                       ///< range of a body, children and heavy people included
  std::string source;                     ///< where the numbers come from, or how they are derived
};

/// The measures of a body [P], in the order of all vectors of measures. Lengths are distances between joints; girths
/// are perimeters of the body without loose clothes, in planes across the limb or the trunk.
const std::vector<BodyMeasure>& body_measures();

/// The position of a measure in the vectors.
/// @throws UsageError for a name that is none of the measures; the message lists them
int measure_index(const std::string& name);

/// child: a child of about eight years
enum class BodyBuild { woman, man, child };

/// The measures of the average body of a build [P], metres.
std::vector<double> mean_measures(BodyBuild build);
/// The mean of the average woman and the average man [P], metres.
std::vector<double> mean_measures();
/// Standard deviations among adults, women and men together in equal numbers [P], metres.
std::vector<double> measure_deviations();

/// The build of the body that `random_measures` draws for this seed: of 20 bodies, about 8 women, 8 men, 4 children.
BodyBuild random_build(std::uint64_t seed);
/// The measures of a random body [P], metres, within `low` .. `high`. Lengths go with stature, girths with mass; what
/// remains is independent for each measure. One seed gives the same body with every standard library.
std::vector<double> random_measures(std::uint64_t seed);

}  // namespace doppel
