#pragma once

#include <Eigen/Core>

namespace doppel {

/// A square, turned region of an image that holds one person or one hand: what a landmark network sees.
struct BodyRoi {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< pixels, first pixel centre at (0.5, 0.5)
  double side = 0.0;                                 ///< pixels
  double rotation = 0.0;                             ///< radians, -pi to pi; positive turns x towards y (down)
  bool mirrored = false;                             ///< the region is seen in a mirror: its x axis points to the left

  /// Whether all values are finite, and the side is 1e-3 to 1e6 pixels.
  bool valid() const;
  /// The axes of the region in the image, as columns: a rotation, of a mirrored region a reflection.
  Eigen::Matrix2d axes() const;
  /// The pixel of a point of the region; (0, 0) to (1, 1) are its corners: centre + axes * (point - 0.5) * side.
  Eigen::Vector2d image_from_roi(const Eigen::Vector2d& point) const;
  Eigen::Vector2d roi_from_image(const Eigen::Vector2d& pixel) const;
};

/// The rotation of a region whose upper side faces the direction `up` of the image: pi/2 - atan2(-up.y, up.x).
double upright_rotation(const Eigen::Vector2d& up);

/// The region around a person whose middle of the hips is `centre`. The circle through `rim` around `centre` holds the
/// whole person, and `rim` is above the head: the side is 2.5 times the distance, and the region's upper side faces
/// `rim`.
BodyRoi body_roi(const Eigen::Vector2d& centre, const Eigen::Vector2d& rim);

}  // namespace doppel
