#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "doppel/calibration/estimation/outline_tracks.h"
#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/geometry/camera.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

/// Two points of the person whose distance is constant.
using Limb = std::array<int, 2>;

/// What the cameras saw in one recording.
struct RigTake {
  PointTracks tracks;                  ///< synchronised: see synchronise.h
  std::vector<OutlineTrack> outlines;  ///< [C] with the frames of the tracks; empty: points alone
};

struct RefineOptions {
  bool focal = false;            ///< also refine the focal lengths (one factor per camera)
  bool principal_point = false;  ///< also refine the principal points
  double kernel = 2.5;           ///< pixels of an image 1024 wide beyond which a residual counts less (Geman-McClure);
                                 ///< at least three times the median residual
  std::vector<Limb> limbs;       ///< pairs of points at constant distance; empty: not used
  double limb_sigma = 0.02;      ///< metres by which the distance of a limb's points varies
  std::size_t most_times = 250;  ///< times of all takes whose points are used; more are thinned out
  std::vector<int> fixed;        ///< cameras that are not changed, not all; then the result is not aligned to the old
                                 ///< centres
  double largest_start_error = 120.0;  ///< pixels of an image 1024 wide by which views may disagree at the start
};

/// What became of one camera.
struct CameraRefinement {
  std::string name;
  long observations = 0;  ///< points that took part
  long tangents = 0;      ///< frontier points that took part
  double inliers = 0.0;   ///< share of the observations with a residual within the kernel at the end
  double median_before = 0.0, mean_before = 0.0;  ///< distance of points triangulated from all cameras, pixels
  double median_after = 0.0, mean_after = 0.0;
  double rotation_change = 0.0;  ///< radians
  double centre_change = 0.0;    ///< metres
  double focal_change = 0.0;     ///< relative, 0.03: 3 % longer
  double rotation_sigma = 0.0;   ///< radians; standard deviations by the curvature of the cost
                                 ///< and the spread of its gradients
  double centre_sigma = 0.0;     ///< metres
  double focal_sigma = 0.0;      ///< relative
  bool refined = true;           ///< false: too few points, the camera keeps its calibration
  std::string reason;            ///< why it was not refined
};

struct RigRefinement {
  std::vector<Camera> cameras;                     ///< [C] refined
  std::vector<CameraRefinement> reports;           ///< [C]
  double median_before = 0.0, median_after = 0.0;  ///< of all cameras, pixels
  long points = 0;                                 ///< points in space that took part
  SolverSummary summary;
};

/// Bundle adjustment of a rig over the points of a person: the poses of the cameras, and their focal lengths and
/// principal points on request, such that the points of each time project to where the cameras saw them. Residuals are
/// robust; the points in space are eliminated (Schur complement). The person's points fix neither where the world is
/// nor its scale. The result is therefore moved, turned and scaled such that its camera centres lie closest to the old
/// ones, and the cameras' turns are shared out. Lenses keep their distortion.
///
/// The points bring the cameras near to their positions. Outlines then take part by their frontier points, which are
/// found anew in each round and join the bundle as points that two cameras see.
/// @param takes with the same points, recorded while no camera moved
/// @throws Error as check_tracks for fewer than two cameras; when the points are too few, or all in one position;
/// UsageError for impossible options, and when no camera is left that is not fixed and saw enough points
RigRefinement refine_rig(const std::vector<Camera>& cameras, const std::vector<RigTake>& takes,
                         const RefineOptions& options = {});
/// The same by the points of one take.
RigRefinement refine_rig(const std::vector<Camera>& cameras, const PointTracks& tracks,
                         const RefineOptions& options = {});

/// [takes] the times in seconds whose points and outlines `refine_rig` uses, `most` of all takes; 0: all.
std::vector<std::vector<double>> times_of_takes(const std::vector<RigTake>& takes, std::size_t most);

}  // namespace doppel
