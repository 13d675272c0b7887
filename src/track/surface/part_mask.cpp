#include "doppel/track/surface/part_mask.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <string>

#include "doppel/core/log.h"
#include "doppel/core/lower_case.h"
#include "doppel/track/fit/words.h"

namespace doppel {
namespace {

constexpr char kNone = static_cast<char>(BodyPart::none), kTorso = static_cast<char>(BodyPart::torso);

/// Whether the name contains the whole word, or its first letter alone at the start or the end.
bool is_of_side(const std::string& name, const std::string& side) {
  const std::string letter = side.substr(0, 1);
  return name.find(side) != std::string::npos || name.starts_with(letter + "_") || name.ends_with("_" + letter);
}

char part_of_bone(const std::string& name) {
  const bool left = is_of_side(name, "left");
  if (!left && !is_of_side(name, "right")) return kTorso;
  if (holds_any(name, {"leg", "hip", "thigh", "shin", "calf", "knee", "ankle", "foot", "toe"}))
    return static_cast<char>(left ? BodyPart::left_leg : BodyPart::right_leg);
  if (holds_any(name, {"arm", "elbow", "wrist", "hand", "finger", "thumb"}))
    return static_cast<char>(left ? BodyPart::left_arm : BodyPart::right_arm);
  return kTorso;
}

}  // namespace

std::vector<char> body_parts(const SkinningWeights& skin) {
  std::vector<char> part_of, parts;
  std::vector<bool> is_hip;
  for (const std::string& bone : skin.bones) {
    const std::string name = lower_case(bone);
    part_of.push_back(part_of_bone(name));
    is_hip.push_back(holds_any(name, {"hip"}));
  }
  for (int v = 0; v < skin.num_vertices(); ++v) {
    const std::span<const int> bones = skin.vertex_bones.row(v);
    char part = part_of[bones[0]];
    if (is_hip[bones[0]] && (bones.size() < 2 || part_of[bones[1]] != part)) part = kTorso;
    parts.push_back(part);
  }
  if (std::all_of(parts.begin(), parts.end(), [](char part) { return part == kTorso; }))
    log::warn(
        "no bone name names an arm or a leg of one side, as in left_knee or RightForeArm, so every vertex belongs to "
        "the "
        "torso and the part mask (4.6.2) has no effect; the bones are {}",
        fmt::join(skin.bones, ", "));
  return parts;
}

PartMask::PartMask(const cv::Mat& parts, const CropBox& box, int growth) : box_(box), parts_(parts.clone()) {
  const cv::Mat around = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * growth + 1, 2 * growth + 1});
  const cv::Mat free = parts == kNone;
  cv::Mat grown;
  for (const BodyPart part :
       {BodyPart::left_arm, BodyPart::right_arm, BodyPart::left_leg, BodyPart::right_leg, BodyPart::torso}) {
    cv::dilate(parts == static_cast<int>(part), grown, around);
    parts_.setTo(static_cast<int>(part), grown & free);
  }
}

bool PartMask::allows(char part, const Eigen::Vector2d& pixel) const {
  if (parts_.empty()) return true;
  const double scale = box_.image_pixels_per_pixel(parts_.cols);
  const double u = (pixel.x() - box_.u0) / scale, v = (pixel.y() - box_.v0) / scale;
  if (!(u >= 0.0 && v >= 0.0 && u < parts_.cols && v < parts_.rows)) return true;
  const char found = parts_.at<char>(static_cast<int>(v), static_cast<int>(u));
  return found == kNone || found == part;
}

}  // namespace doppel
