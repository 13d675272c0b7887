#pragma once

/// The second stage of the one-camera tracker (4.6): the surface itself, vertex by vertex, on top of a pose.
///
/// A frame starts from the skinned surface with the last frame's displacements on it, carried along by the pose
/// (4.6.5). Three Gauss-Newton steps follow, one on each level of the image's pyramid, each solved by a few
/// iterations of preconditioned conjugate gradients (4.7.2). What is left between the outlines is closed in one go
/// (4.6.6).

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"
#include "doppel/energy/evidence.h"
#include "doppel/solver/least_squares.h"
#include "doppel/fit/surface/posed_surface.h"

namespace doppel {

/// The weights are those of the thesis (4.8), in its units: millimetres, pixels of an image 540 wide, colours 0..1. A
/// term of weight 0 is switched off.
struct NonrigidOptions {
  double photometric_weight = 10000.0;
  double colour_threshold = 0.25;           ///< sigma_c: a vertex whose colour is farther off says nothing
  std::vector<int> blur_kernels{15, 9, 3};  ///< pixels, odd; a Gauss-Newton step each
  bool match_exposure = true;               ///< brings the template's colours to the image's brightness first
  double silhouette_weight = 600.0;
  double silhouette_scale = 15.0;  ///< pixels: an outline farther from the mask's counts less (Geman-McClure)
  bool part_mask = true;           ///< a part of the body does not explain another one's outline
  double part_growth = 10.0;       ///< pixels that parts are grown by
  double smoothness_weight = 10.0;
  double length_weight = 30.0;
  bool materials = true;  ///< Table 4.1 by the character's labels; false: `rigidity` everywhere
  double rigidity = 2.0;
  double velocity_weight = 0.25;
  double acceleration_weight = 0.1;
  bool warp_displacements = true;  ///< start from the last frame's displacements
  bool snap = true;                ///< put outline vertices onto the mask's outline at the end (4.6.6)
  double max_isolated_motion = 5.0;   ///< a vertex that moves so many times as far as its neighbours is held back; 0: never
  int conjugate_gradients = 4;  ///< iterations of each step
  int window_pixels = 256;      ///< side of the window that the surface is drawn in to see outline and visibility
};

/// The surface of one frame.
struct NonrigidSurface {
  Eigen::Matrix3Xd vertices;    ///< [3,N] world metres
  std::vector<TermCost> terms;  ///< at the end, on the finest level
  int outline_vertices = 0;
  int snapped_vertices = 0;   ///< of these
  int coloured_vertices = 0;  ///< that were compared with the image on the finest level
};

class NonrigidStage {
 public:
  /// @param camera without distortion; both must outlive the stage
  /// @throws Error for options out of range
  NonrigidStage(const Character& character, const Camera& camera, const NonrigidOptions& options = {});
  ~NonrigidStage();
  NonrigidStage(NonrigidStage&&) noexcept;
  NonrigidStage& operator=(NonrigidStage&&) noexcept;

  /// The next frame. @param posed the skinned template; @param outline of the mask, not empty; @param image 8-bit BGR
  /// without distortion, or empty: then colours are not compared
  NonrigidSurface fit(const PosedSurface& posed, const OutlineField& outline, const cv::Mat& image);
  /// The next frame does not follow from those before.
  void cut();

  /// The template with the last frame's displacements on it, in the rest pose: what the pose of the next frame is best
  /// found with (4.6.5). [N] world metres
  std::vector<Eigen::Vector3d> rest_vertices() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
