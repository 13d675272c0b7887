#include "doppel/detect/keypoints/limbs.h"

#include <optional>

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

}  // namespace

std::vector<std::array<int, 2>> sticks_between(const std::vector<std::string>& names) {
  std::vector<std::array<int, 2>> sticks;
  const auto add = [&](const std::string& from, const std::string& to) {
    const std::optional<int> a = find_landmark(names, from), b = find_landmark(names, to);
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
  return sticks;
}

}  // namespace doppel
