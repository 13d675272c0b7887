#include "doppel/io/motion_import/marker_names.h"

#include <algorithm>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace {

/// Names whose points show one joint together; `$_` stands for the side as `left_`, `$` for `l` or `r`.
struct MarkerChoice {
  std::vector<std::string> names;
  bool on_skin = false;
};

const std::map<std::string, std::vector<MarkerChoice>>& marker_choices() {
  static const std::map<std::string, std::vector<MarkerChoice>> kChoices{
      {"pelvis",
       {{{"midhip"}},
        {{"left_hip", "right_hip"}},
        {{"lhjc", "rhjc"}},
        {{"lasi", "rasi", "lpsi", "rpsi"}},
        {{"lasi", "rasi", "sacr"}}}},
      {"hip", {{{"$_hip"}}, {{"$hjc"}}}},
      {"knee", {{{"$_knee"}}, {{"$kjc"}}, {{"$kne", "$knm"}}, {{"$kne", "$mkne"}}, {{"$kne"}, true}}},
      {"ankle", {{{"$_ankle"}}, {{"$ajc"}}, {{"$ank", "$mank"}}, {{"$ank", "$med"}}, {{"$ank"}, true}}},
      {"toe", {{{"$_bigtoe", "$_smalltoe"}}, {{"$_bigtoe"}}, {{"$_toe"}}, {{"$_toes"}}, {{"$_foot"}}, {{"$toe"}}}},
      {"neck", {{{"neck"}}, {{"left_shoulder", "right_shoulder"}}, {{"c7", "clav"}}, {{"lsho", "rsho"}}}},
      {"head",
       {{{"left_ear", "right_ear"}},
        {{"headtop"}},
        {{"lfhd", "rfhd", "lbhd", "rbhd"}},
        {{"lfhd", "rfhd"}},
        {{"nose"}}}},
      {"shoulder", {{{"$_shoulder"}}, {{"$sjc"}}, {{"$_upperarm"}}, {{"$_arm"}}, {{"$sho"}, true}}},
      {"elbow", {{{"$_elbow"}}, {{"$ejc"}}, {{"$_forearm"}}, {{"$elb", "$elbm"}}, {{"$elb"}, true}}},
      {"wrist", {{{"$_wrist"}}, {{"$wjc"}}, {{"$_hand"}}, {{"$wra", "$wrb"}}, {{"$wri"}}}}};
  return kChoices;
}

std::string with_side(std::string pattern, bool left) {
  if (pattern.rfind("$_", 0) == 0) return (left ? "left" : "right") + pattern.substr(1);
  if (pattern.rfind('$', 0) == 0) pattern[0] = left ? 'l' : 'r';
  return pattern;
}

/// The points of a choice; nothing unless all of them are there.
std::vector<int> points_of(const MarkerChoice& choice, bool left, const std::map<std::string, int>& index_of) {
  std::vector<int> points;
  for (const std::string& pattern : choice.names) {
    const auto found = index_of.find(with_side(pattern, left));
    if (found == index_of.end()) return {};
    points.push_back(found->second);
  }
  return points;
}

}  // namespace

std::array<std::vector<int>, kMarkerJoints.size()> match_markers(const std::vector<std::string>& names, bool& on_skin) {
  std::map<std::string, int> index_of;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = names[i].substr(names[i].rfind(':') + 1);
    index_of.emplace(landmark_key(name), static_cast<int>(i));
  }
  on_skin = false;
  std::array<std::vector<int>, kMarkerJoints.size()> points;
  for (std::size_t j = 0; j < kMarkerJoints.size(); ++j) {
    const std::string name = kMarkerJoints[j].name;
    const bool left = name.rfind("left_", 0) == 0, right = name.rfind("right_", 0) == 0;
    const std::string part = left || right ? name.substr(name.find('_') + 1) : name;
    for (const MarkerChoice& choice : marker_choices().at(part)) {
      points[j] = points_of(choice, left, index_of);
      if (points[j].empty()) continue;
      on_skin = on_skin || choice.on_skin;
      break;
    }
  }
  return points;
}

}  // namespace doppel
