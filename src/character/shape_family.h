#pragma once

#include <span>
#include <string>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// A number that changes the shape of a body: a measure in metres, or the scale of a bone.
struct ShapeParameter {
  std::string name;
  double mean = 0.0;       ///< the usual value
  double deviation = 1.0;  ///< standard deviation of people from it
  double low = 0.0, high = 0.0;
};

/// Characters of different shapes: one topology, one skeleton, one skin and one graph. The parameters change the rest
/// vertices, the offsets of the joints and the positions of the markers.
class ShapeFamily {
 public:
  virtual ~ShapeFamily() = default;
  virtual const std::vector<ShapeParameter>& parameters() const = 0;  ///< [P]
  /// @param values [P]; differentiable in them. @throws UsageError for another number of values
  virtual Character character(std::span<const double> values) const = 0;

  int num_parameters() const { return static_cast<int>(parameters().size()); }
  std::vector<double> mean() const {
    std::vector<double> values;
    for (const ShapeParameter& parameter : parameters()) values.push_back(parameter.mean);
    return values;
  }
};

}  // namespace doppel
