#pragma once

#include "doppel/character/shape_family.h"

namespace doppel {

/// A character whose landmarks lie elsewhere on the body. Each detector puts a joint at a position of its own: the hips
/// of two networks are centimetres apart. Three parameters a landmark: its shift along the axes of its joint, metres.
class LandmarkPositions : public ShapeFamily {
 public:
  /// @param character whose markers have the names of the landmarks @param landmarks names of markers
  /// @throws Error for a name that no marker has
  LandmarkPositions(const Character& character, const std::vector<std::string>& landmarks);

  const std::vector<ShapeParameter>& parameters() const override { return parameters_; }
  Character character(std::span<const double> values) const override;

 private:
  Character character_;
  std::vector<std::size_t> markers_;  ///< [M] of the landmarks
  std::vector<ShapeParameter> parameters_;
};

}  // namespace doppel
