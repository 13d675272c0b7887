#pragma once

/// The motion window of 6.4: the last F+1 poses, normalised by the root of the last pose. Translation is relative to
/// the last frame's root, and the whole window is rotated about y so that the last frame faces along +z.

#include <torch/types.h>

#include <array>

#include "doppel/character/skeleton.h"

namespace doppel {

/// Wraps angles to (-pi, pi].
torch::Tensor wrap_angle(const torch::Tensor& angle);

/// Normalises motion windows. It uses matrices, so the root's rotations may have any order. With y outermost (Captury),
/// the heading is this DoF times its weight; otherwise it is the azimuth of the root's z axis.
/// Plain tensor operations in the dtype of the input: traceable.
class MotionWindow {
 public:
  /// @throws Error when the skeleton's root is not three translations followed by three rotations
  explicit MotionWindow(const Skeleton& skeleton);

  int64_t num_dofs() const { return num_dofs_; }

  /// @param dofs [B,D] @return heading phi [B], radians in (-pi, pi]
  torch::Tensor heading(const torch::Tensor& dofs) const;
  /// @param dofs [B,D] @return root translation z [B,3], metres, without the root joint's own offset
  torch::Tensor translation(const torch::Tensor& dofs) const;

  /// N = Trans(o) Ry(-phi) Trans(-z) Trans(-o), o the offset of the root joint. N maps a world transform of any frame
  /// of the window to one relative to the frame `dofs`.
  /// @param dofs [B,D] of the last frame @return [B,3,4]
  torch::Tensor normaliser(const torch::Tensor& dofs) const;
  /// N = Trans(-z): the same, but the heading is kept, as in the motion window of the texture (6.4).
  /// @param dofs [B,D] of the last frame @return [B,3,4]
  torch::Tensor translation_normaliser(const torch::Tensor& dofs) const;

  /// The same normalisation applied to the DoFs, where this is exact.
  /// @param window [B,F+1,D] oldest first @return [B,F+1,D]
  /// @throws Error when the heading is not the outermost root rotation
  torch::Tensor normalise_dofs(const torch::Tensor& window) const;
  /// The motion window of the texture (6.4): translation relative to the last frame's; the heading is kept, because
  /// lighting is fixed in the world. Any order of rotations.
  /// @param window [B,F+1,D] oldest first @return [B,F+1,D]
  torch::Tensor remove_translation(const torch::Tensor& window) const;
  bool heading_is_outermost() const { return root_.axes[0] == 1; }

 private:
  Skeleton::Root root_;
  std::array<double, 3> offset_{};  // o
  int64_t num_dofs_ = 0;
};

/// The last F+1 rows of a window. @param dof_window [B,G+1,D], G >= F
torch::Tensor last_rows(const torch::Tensor& dof_window, int past_frames);

}  // namespace doppel
