#include "doppel/character/landmark_positions.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr double kDeviation = 0.02, kMaxShift = 0.1;  // metres

}  // namespace

LandmarkPositions::LandmarkPositions(const Character& character, const std::vector<std::string>& landmarks)
    : character_(character) {
  const std::vector<Marker>& markers = character.skeleton.markers;
  for (const std::string& name : landmarks) {
    const auto found = std::find_if(markers.begin(), markers.end(), [&](const Marker& m) { return m.name == name; });
    if (found == markers.end()) fail("{} has no marker {} whose position could be found", character.name, name);
    markers_.push_back(as_size(found - markers.begin()));
    for (const char* axis : {".x", ".y", ".z"})
      parameters_.push_back({name + axis, 0.0, kDeviation, -kMaxShift, kMaxShift});
  }
}

Character LandmarkPositions::character(std::span<const double> values) const {
  if (values.size() != parameters_.size())
    fail<UsageError>("{} landmarks have {} shifts, not {}", markers_.size(), parameters_.size(), values.size());
  Character moved = character_;
  for (std::size_t m = 0; m < markers_.size(); ++m)
    moved.skeleton.markers[markers_[m]].position += Eigen::Vector3d::Map(&values[3 * m]);
  return moved;
}

}  // namespace doppel
