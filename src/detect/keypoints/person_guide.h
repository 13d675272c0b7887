#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>

namespace doppel {

/// Where a person is known to be in one image.
struct PersonAnchor {
  Eigen::Vector2d hips = Eigen::Vector2d::Zero();  ///< their middle, pixels
  double radius = 0.0;  ///< pixels; hips that are farther away are those of another person. 0: `hips` are not known
  bool visible = true;  ///< false: the person is not in the image, or behind another one. Nobody should be followed

  bool has_hips() const { return radius > 0.0; }
  bool holds(const Eigen::Vector2d& pixel) const { return (pixel - hips).norm() <= radius; }
};

/// Where one camera should follow a person: the frames in which it is known, and what follows for those near them.
class PersonGuide {
 public:
  /// Nothing is known. @param start pixel near the middle of the hips in the first frame; without: not known either
  explicit PersonGuide(std::optional<Eigen::Vector2d> start = std::nullopt) : start_(std::move(start)) {}
  /// @param anchors by frame @param step frames from one moment that was looked at to the next
  PersonGuide(std::map<long, PersonAnchor> anchors, double step);

  /// Near which pixel to begin: as given, or the first anchor in which the person is visible.
  const std::optional<Eigen::Vector2d>& start() const { return start_; }
  /// The anchor of a frame. Between two anchors the hips move in a line; the radius grows with the distance from the
  /// nearest one. The person may be visible there if so in one of the two. Where the hips are known in one of them
  /// only, they are near that one.
  /// @return nothing when no anchor is within `step` frames
  std::optional<PersonAnchor> at(long frame) const;

 private:
  std::optional<Eigen::Vector2d> start_;
  std::map<long, PersonAnchor> anchors_;
  double step_ = 1.0;
};

}  // namespace doppel
