#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Where one view sees a point: a ray in the world, and the scale of the view's residuals.
struct Sight {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();       ///< rotation, camera from world
  Eigen::Vector3d t = Eigen::Vector3d::Zero();           ///< translation, camera from world, metres
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();      ///< of the camera, world
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of the ray, world, unit length
  Eigen::Vector2d plane = Eigen::Vector2d::Zero();       ///< the seen point at depth 1, without distortion
  /// Residuals are unit_from_plane * (projected point at depth 1 - plane). For pixels: d pixel / d plane at `plane`.
  Eigen::Matrix2d unit_from_plane = Eigen::Matrix2d::Identity();
  double weight = 1.0;  ///< of the squared residual
};

/// The sight of a pixel, with residuals in pixels of the image as it was filmed.
/// @param pixel as filmed, with distortion
/// @return nothing for a pixel that is not finite, or where the lens has no inverse
std::optional<Sight> sight_of(const Camera& camera, const Eigen::Vector2d& pixel, double weight = 1.0);
/// The residual of a world point, in the unit of the sight. Nothing for a point less than 5 cm in front of the camera.
std::optional<Eigen::Vector2d> residual_of(const Sight& sight, const Eigen::Vector3d& point);

/// The middle of the shortest line between the rays of two sights; nothing when the angle between them is smaller than
/// `smallest_angle`, radians.
std::optional<Eigen::Vector3d> meeting_point(const Sight& a, const Sight& b, double smallest_angle);

struct TriangulationOptions {
  double inlier_threshold = 25.0;  ///< largest residual of an inlier view, in the unit of the sights
  double smallest_angle = 0.03;    ///< radians between two rays that may propose a point
  int most_pairs = 0;              ///< pairs of rays that propose a point, evenly chosen; 0: all
  int refinement_steps = 4;        ///< Gauss-Newton steps on the weighted residuals of the inlier views; 0: the point
                                   ///< nearest to the inlier rays is kept
  double kernel = 0.0;             ///< residual beyond which a view counts less (Geman-McClure), in the unit of the
                                   ///< sights; 0: the inlier views count by their squared residuals
};

/// A triangulated point, world metres.
struct TriangulatedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  int views = 0;                  ///< number of inlier views
  double error = 0.0;             ///< root mean square residual of the inlier views, in the unit of the sights
  std::vector<double> residuals;  ///< [sights] length of the residual; infinite behind a camera

  bool is_inlier(std::size_t sight, const TriangulationOptions& options) const {
    return residuals[sight] <= options.inlier_threshold;
  }
};

/// Triangulates a point robustly. Every pair of rays proposes a point. The point with the most inlier views wins; among
/// equals, the one with the smaller error. Its inlier views then give the point by least squares. Gross outliers in a
/// minority of views do no harm. With a kernel, the proposed point with the smallest cost of all views wins instead,
/// and the kernel weighs its inlier views. The threshold may then be wide: a view of a camera that was pushed counts
/// little, and does not come and go from frame to frame.
/// @return nothing when no point has two inlier views
std::optional<TriangulatedPoint> triangulate(std::span<const Sight> sights, const TriangulationOptions& options = {});

}  // namespace doppel
