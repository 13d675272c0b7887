#include "doppel/detect/keypoints/limbs.h"

#include <map>
#include <optional>

#include "doppel/detect/face/face_pose.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace {

constexpr std::array<NamedLimb, 14> kFeetAndHead{{{"left_ankle", "left_heel"},
                                                  {"right_ankle", "right_heel"},
                                                  {"left_ankle", "left_bigtoe"},
                                                  {"right_ankle", "right_bigtoe"},
                                                  {"left_ankle", "left_footindex"},
                                                  {"right_ankle", "right_footindex"},
                                                  {"neck", "midhip"},
                                                  {"neck", "left_shoulder"},
                                                  {"neck", "right_shoulder"},
                                                  {"neck", "nose"},
                                                  {"nose", "left_eye"},
                                                  {"nose", "right_eye"},
                                                  {"left_eye", "left_ear"},
                                                  {"right_eye", "right_ear"}}};

constexpr std::array<const char*, 5> kFingers{"thumb", "forefinger", "middlefinger", "ringfinger", "pinkyfinger"};
constexpr int kFingerPoints = 4;  ///< of each finger, from the palm to the tip

/// Lines of MediaPipe's face mesh: outline, eyes, brows, nose and lips.
const std::array<std::vector<int>, 10> kFaceLines{{
    {10,  338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152,
     148, 176, 149, 150, 136, 172, 58,  132, 93,  234, 127, 162, 21,  54,  103, 67,  109, 10},
    {33, 7, 163, 144, 145, 153, 154, 155, 133},
    {33, 246, 161, 160, 159, 158, 157, 173, 133},
    {263, 249, 390, 373, 374, 380, 381, 382, 362},
    {263, 466, 388, 387, 386, 385, 384, 398, 362},
    {46, 53, 52, 65, 55},
    {276, 283, 282, 295, 285},
    {168, 6, 197, 195, 5, 4},
    {61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291},
    {61, 185, 40, 39, 37, 0, 267, 269, 270, 409, 291},
}};

/// Finds landmarks as find_landmark does, many of them in one list.
class LandmarkIndex {
 public:
  explicit LandmarkIndex(const std::vector<std::string>& names) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      by_name_.emplace(names[i], static_cast<int>(i));
      by_key_.emplace(landmark_key(names[i]), static_cast<int>(i));
    }
  }
  std::optional<int> find(const std::string& name) const {
    if (const auto found = by_name_.find(name); found != by_name_.end()) return found->second;
    const auto found = by_key_.find(landmark_key(name));
    return found == by_key_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  std::map<std::string, int> by_name_, by_key_;
};

}  // namespace

std::vector<std::array<int, 2>> sticks_between(const std::vector<std::string>& names) {
  const LandmarkIndex index(names);
  std::vector<std::array<int, 2>> sticks;
  const auto add = [&](const std::string& from, const std::string& to) {
    const std::optional<int> a = index.find(from), b = index.find(to);
    if (a && b) sticks.push_back({*a, *b});
  };
  for (const NamedLimb& limb : kBodyLimbs) add(limb[0], limb[1]);
  for (const NamedLimb& limb : kFeetAndHead) add(limb[0], limb[1]);
  for (const std::string side : {"left_", "right_"}) {
    for (const char* finger : kFingers) {
      const auto point = [&](int k) { return side + finger + std::to_string(k); };
      add(side + "handroot", point(1));
      for (int k = 1; k < kFingerPoints; ++k) add(point(k), point(k + 1));
    }
  }
  for (const std::vector<int>& line : kFaceLines)
    for (std::size_t i = 1; i < line.size(); ++i) add(face_point_name(line[i - 1]), face_point_name(line[i]));
  return sticks;
}

}  // namespace doppel
