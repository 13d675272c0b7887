#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/skinning_weights.h"
#include "doppel/detect/masks/mask.h"

namespace doppel {

/// Parts of the body (4.6.2). An outline of the mask attracts only vertices of its own part.
enum class BodyPart : char { none, torso, left_arm, right_arm, left_leg, right_leg };

/// The part of each vertex, [N], never none. It is the part of the bone with the largest weight, recognised by words in
/// the bone's name (`LeftForeArm`, `r_knee`). A vertex of a hip belongs to the leg only where its second bone also
/// belongs to the leg. Bones with unknown names are torso. If all are, no vertex is excluded, and a warning says so.
std::vector<char> body_parts(const SkinningWeights& skin);

/// The part of the posed body at each pixel; parts are grown to close the gaps between them.
class PartMask {
 public:
  /// Allows everything.
  PartMask() = default;
  /// @param parts 8-bit, BodyPart visible in each pixel of a window of the image
  /// @param growth pixels of the window by which each part is grown. Visible parts stay; where grown parts overlap, the
  /// torso wins.
  PartMask(const cv::Mat& parts, const CropBox& box, int growth);

  /// Whether an outline at `pixel` of the image attracts vertices of `part`: the pixel shows that part or none.
  bool allows(char part, const Eigen::Vector2d& pixel) const;

 private:
  CropBox box_;
  cv::Mat parts_;
};

}  // namespace doppel
