#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/capture/mask.h"

namespace doppel {

/// Parts of the body that may each explain an outline of their own (4.6.2).
enum class BodyPart : char { none, torso, left_arm, right_arm, left_leg, right_leg };

/// The part that each vertex belongs to, [N], never none: that of its largest bone, told by words in the bone's name
/// (`LeftForeArm`, `r_knee`). A hip belongs to the leg only where the second bone is another one of the leg. Bones
/// whose names say nothing are torso, so that with strange names there is one part and nothing is disabled.
std::vector<char> body_parts(const SkinningWeights& skin);

/// Which part of the posed body is near each pixel, grown so that gaps between parts are closed.
class PartMask {
 public:
  /// Allows everything.
  PartMask() = default;
  /// @param parts 8-bit, BodyPart of what is seen in each pixel of a window of the image
  /// @param growth pixels of the window that each part is grown by. What is seen stays; in between the torso wins.
  PartMask(const cv::Mat& parts, const CropBox& box, int growth);

  /// Whether a vertex of `part` may be explained by an outline at `pixel` of the image: no part, or its own, is
  /// there.
  bool allows(char part, const Eigen::Vector2d& pixel) const;

 private:
  CropBox box_;
  cv::Mat parts_;
};

}  // namespace doppel
