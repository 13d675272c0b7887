#pragma once

#include "doppel/character/shape_family.h"
#include "doppel/rigging/body/body_model.h"

namespace doppel {

/// The bodies of a `BodyModel` as a family of shapes: the parameters are the measures in metres, with the mean of women
/// and men and their deviations.
class BodyShapes : public ShapeFamily {
 public:
  /// @param name of the characters @param model must outlive the family
  BodyShapes(std::string name, const BodyModel& model);

  const std::vector<ShapeParameter>& parameters() const override { return parameters_; }
  Character character(std::span<const double> values) const override { return model_.character(name_, values); }

 private:
  std::string name_;
  const BodyModel& model_;
  std::vector<ShapeParameter> parameters_;
};

}  // namespace doppel
