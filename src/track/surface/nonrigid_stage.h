#pragma once

/// The second stage of the one-camera tracker (4.6): the surface itself, vertex by vertex, on top of a pose.
///
/// A frame starts from the skinned surface with the displacements of the last frame, rotated with the pose (4.6.5).
/// Three Gauss-Newton steps follow, one on each level of the image's pyramid. A few iterations of preconditioned
/// conjugate gradients solve each step (4.7.2). Snapping then closes the remaining gap between the outlines (4.6.6).

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"
#include "doppel/solver/least_squares.h"
#include "doppel/track/energy/evidence.h"
#include "doppel/track/fit/thesis_units.h"
#include "doppel/track/surface/posed_surface.h"
#include "doppel/track/surface/snapping.h"

namespace doppel {

/// Options of the second stage. Defaults are the numbers of the thesis (4.8), converted (`thesis_units.h`): pixels are
/// reference pixels (image 1024 wide), colours are 0..1. A weight of 0 switches a term off.
struct NonrigidOptions {
  double photometric_weight = 10000.0;     ///< per squared colour difference
  double colour_threshold = 0.25;          ///< sigma_c: a vertex with a larger colour difference is ignored
  std::vector<int> blur_kernels{3, 3, 3};  ///< pixels of the image, odd; one Gauss-Newton step each
  bool halve_levels = true;    ///< halve the image with each coarser level, before the blur; false: blur alone
  bool match_exposure = true;  ///< scale the template's colours to the image's brightness first
  double silhouette_weight = per_squared_thesis_pixel(600.0);  ///< per squared pixel, each outline vertex
  double silhouette_scale = thesis_pixels(15.0);               ///< of the Geman-McClure kernel, pixels; 0: no kernel
  /// Subtract from the silhouette residual of a vertex its own distance to the outline of the drawn surface, and snap
  /// it to this distance. false: the residual is I_DT(pi(V_i)) alone (4.10), and vertices are snapped onto the outline.
  bool own_distance = true;
  bool part_mask = true;                     ///< outlines attract only vertices of their own part of the body
  double part_growth = thesis_pixels(10.0);  ///< pixels by which the parts are grown
  double smoothness_weight = per_squared_millimetre(10.0);  ///< per squared metre
  double length_weight = per_squared_millimetre(30.0);      ///< per squared metre
  bool materials = true;  ///< rigidity by the character's labels (Table 4.1); false: `rigidity`
  double rigidity = 2.0;  ///< of all vertices, without `materials`
  double velocity_weight = per_squared_millimetre(0.25);     ///< per squared metre
  double acceleration_weight = per_squared_millimetre(0.1);  ///< per squared metre
  /// Velocity and acceleration are those relative to the skinned template: the last surfaces move with the pose. false:
  /// those in the world, as in the thesis, which hold back a person who walks towards the camera.
  bool carry = true;
  double skinned_weight = per_squared_millimetre(0.03);  ///< per squared metre, of vertices to the skinned template
  bool warp_displacements = true;                        ///< start from the displacements of the last frame
  bool snap = true;  ///< move outline vertices onto the mask's outline at the end (4.6.6)
  SnapOptions snapping;
  double max_isolated_motion = 5.0;  ///< largest ratio of a vertex's motion to its neighbours' mean motion; 0: no limit
  int conjugate_gradients = 4;       ///< iterations of each step
  int window_pixels = 256;  ///< side of the window in which the surface is drawn to find outline and visibility
};

/// The surface of one frame.
struct NonrigidSurface {
  Eigen::Matrix3Xd vertices;    ///< [3,N] world metres
  std::vector<TermCost> terms;  ///< at the end, on the finest level
  int outline_vertices = 0;
  int coloured_vertices = 0;  ///< vertices with a photometric residual on the finest level
};

class NonrigidStage {
 public:
  /// @param camera, character must outlive the stage
  /// @throws Error for options out of range
  NonrigidStage(const Character& character, const PinholeCamera& camera, const NonrigidOptions& options = {});
  ~NonrigidStage();
  NonrigidStage(const NonrigidStage&) = delete;
  NonrigidStage& operator=(const NonrigidStage&) = delete;

  /// Fits the next frame. @param posed the skinned template @param outline of the mask, not empty
  /// @param image 8-bit BGR without distortion; empty: colours are not compared
  NonrigidSurface fit(const PosedSurface& posed, const OutlineField& outline, const cv::Mat& image);
  /// The next frame begins a new segment.
  void cut();

  /// The template in the rest pose with the displacements of the last frame, [N] world metres. The pose of the next
  /// frame is fitted with it (4.6.5).
  std::vector<Eigen::Vector3d> rest_vertices() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
