#pragma once

#include <Eigen/Core>
#include <vector>

#include "doppel/data/doctor/sightings.h"
#include "doppel/geometry/triangulation.h"

namespace doppel {

/// The person's points in space over time.
class BodyTrack {
 public:
  BodyTrack() = default;
  BodyTrack(int instants, int points);

  int num_points() const { return points_; }
  /// The point at an instant, world metres; NaN where it is not known.
  Eigen::Vector3d& at(int instant, int point) { return positions_[index(instant, point)]; }
  const Eigen::Vector3d& at(int instant, int point) const { return positions_[index(instant, point)]; }
  bool known(int instant, int point) const { return at(instant, point).allFinite(); }
  /// The point `delay` rows later, between rows in a line; NaN beyond the ends of the segment.
  Eigen::Vector3d later(const Sightings& seen, int instant, double delay, int point) const;

 private:
  std::size_t index(int instant, int point) const;
  int points_ = 0;
  std::vector<Eigen::Vector3d> positions_;  ///< [N, K]
};

/// What is supposed of one camera: an explanation of why it disagrees with the others.
struct SupposedView {
  Camera camera;
  /// The image as it should be to the image as it is: [u v] = turn * projected pixel + shift.
  Eigen::Matrix2d turn = Eigen::Matrix2d::Identity();
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  bool sides_swapped = false;  ///< the detector's left is the body's right
  double delay = 0.0;          ///< rows by which the body is later than the camera's frame says
  double drift = 0.0;          ///< rows that are added to it with each row of a sequence
  std::vector<double> steps;   ///< [windows] rows that are added to it; empty: none

  /// The delay at an instant, with drift and step.
  double delay_at(const Sightings& seen, int instant, int window) const;
  /// Where the camera shows a point; nothing behind the camera.
  std::optional<Eigen::Vector2d> pixel(const Eigen::Vector3d& point) const;
};

/// The instants that are looked at, with the window of each.
struct ChosenInstants {
  std::vector<int> instants;
  std::vector<int> window;  ///< of each instant
};
/// All instants of some windows, or about `most` of them. @param most 0: all
ChosenInstants instants_of(const Sightings& seen, const std::vector<int>& windows, int most = 0);
ChosenInstants all_instants(const Sightings& seen, int most = 0);

/// Distances of a camera's points from the projected body, as shares of the person's size in this camera (the
/// detection nearest to the body, where there are several). Shares are at most kMaxShare.
struct ViewResiduals {
  std::vector<double> shares;           ///< of all points
  std::vector<int> window;              ///< of each
  std::vector<int> instant, point;      ///< of each
  std::vector<Eigen::Vector2d> offset;  ///< of each: seen minus projected, pixels

  /// The median in each window, and their mean; -1 and kMaxShare without any point.
  std::vector<double> by_window(std::size_t windows) const;
  double mean_of_windows(std::size_t windows) const;
};
inline constexpr double kMaxShare = 1.5;

/// @param camera whose detections are taken @param view how they are explained
ViewResiduals residuals_of(const Sightings& seen, int camera, const SupposedView& view, const BodyTrack& body,
                           const ChosenInstants& chosen);

/// Which detection of each camera is the person.
using PersonOfCamera = std::vector<std::vector<int>>;  ///< [C][N] index; -1: none

/// The lines of sight of all chosen people, with residuals as shares of the person's size.
class SightTable {
 public:
  /// @param views [C] @param chosen the instants that may be triangulated
  SightTable(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person,
             const ChosenInstants& chosen);
  /// The body by some of the cameras. @param chosen the instants that are computed
  BodyTrack triangulate(const std::vector<int>& cameras, const ChosenInstants& chosen) const;

  /// How uncertain the body by some cameras is where another one looks: the variance of its projection over that of a
  /// keypoint, median over the points. With noise s in all cameras, that camera's residual is s sqrt(1 + uncertainty);
  /// if it is one of them, s sqrt(1 - uncertainty). Nothing when no point is seen by all that is needed.
  std::optional<double> uncertainty(const std::vector<int>& cameras, int camera, const BodyTrack& body) const;

 private:
  const std::optional<Sight>& sight(int camera, int instant, int point) const;
  const Sightings& seen_;
  std::vector<std::vector<std::optional<Sight>>> sights_;  ///< [C] of [N, K]
};

}  // namespace doppel
