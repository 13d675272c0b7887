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

}  // namespace

std::vector<std::array<int, 2>> sticks_between(const std::vector<std::string>& names) {
  std::vector<std::array<int, 2>> sticks;
  const auto add = [&](const NamedLimb& limb) {
    const std::optional<int> a = find_landmark(names, limb[0]), b = find_landmark(names, limb[1]);
    if (a && b) sticks.push_back({*a, *b});
  };
  for (const NamedLimb& limb : kBodyLimbs) add(limb);
  for (const NamedLimb& limb : kFeetAndHead) add(limb);
  return sticks;
}

}  // namespace doppel
