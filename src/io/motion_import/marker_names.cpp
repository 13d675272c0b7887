#include "doppel/io/motion_import/marker_names.h"

#include <algorithm>
#include <map>
#include <set>

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

/// Names of points by their keys, as one person has them.
using KeyedPoints = std::map<std::string, int>;

/// The points of a choice; nothing unless all of them are there.
std::vector<int> points_of(const MarkerChoice& choice, bool left, const KeyedPoints& index_of) {
  std::vector<int> points;
  for (const std::string& pattern : choice.names) {
    const auto found = index_of.find(with_side(pattern, left));
    if (found == index_of.end()) return {};
    points.push_back(found->second);
  }
  return points;
}

MatchedMarkers match(const KeyedPoints& index_of) {
  MatchedMarkers matched;
  for (std::size_t j = 0; j < kMarkerJoints.size(); ++j) {
    const std::string name = kMarkerJoints[j].name;
    const bool left = name.rfind("left_", 0) == 0, right = name.rfind("right_", 0) == 0;
    const std::string part = left || right ? name.substr(name.find('_') + 1) : name;
    for (const MarkerChoice& choice : marker_choices().at(part)) {
      matched.points[j] = points_of(choice, left, index_of);
      if (matched.points[j].empty()) continue;
      matched.on_skin = matched.on_skin || choice.on_skin;
      break;
    }
  }
  return matched;
}

std::size_t num_joints(const MatchedMarkers& markers) {
  return as_size(std::count_if(markers.points.begin(), markers.points.end(), [](const auto& p) { return !p.empty(); }));
}

bool is_known(const std::string& name) {
  static const std::set<std::string> kKnown = [] {
    std::set<std::string> known;
    for (const auto& [part, choices] : marker_choices())
      for (const MarkerChoice& choice : choices)
        for (const std::string& pattern : choice.names)
          for (const bool left : {true, false}) known.insert(with_side(pattern, left));
    return known;
  }();
  return kKnown.count(landmark_key(name)) != 0;
}

struct MarkerName {
  std::string person, part;
};

MarkerName divided(const std::string& name) {
  if (const std::size_t colon = name.rfind(':'); colon != std::string::npos)
    return {name.substr(0, colon), name.substr(colon + 1)};
  if (is_known(name)) return {"", name};
  constexpr const char* kSeparators = " _.-/|";
  for (std::size_t at = name.find_first_of(kSeparators); at != std::string::npos;
       at = name.find_first_of(kSeparators, at + 1))
    if (at > 0 && is_known(name.substr(at + 1))) return {name.substr(0, at), name.substr(at + 1)};
  return {"", name};
}

}  // namespace

bool MatchedMarkers::show_a_body() const {
  constexpr std::size_t kMinJoints = 6;
  const auto has = [&](const std::string& name) {
    const auto joint = std::find_if(kMarkerJoints.begin(), kMarkerJoints.end(),
                                    [&](const MarkerJoint& other) { return other.name == name; });
    return !points[as_size(joint - kMarkerJoints.begin())].empty();
  };
  return has("pelvis") && (has("left_knee") || has("right_knee")) && num_joints(*this) >= kMinJoints;
}

std::vector<MarkerPerson> marker_people(const std::vector<std::string>& names) {
  constexpr std::size_t kFewJoints = 3;
  std::vector<std::string> people;  // in the order of the points
  std::map<std::string, KeyedPoints> points_of_person;
  KeyedPoints all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const MarkerName name = divided(names[i]);
    const std::string key = landmark_key(name.part);
    if (std::find(people.begin(), people.end(), name.person) == people.end()) people.push_back(name.person);
    points_of_person[name.person].emplace(key, static_cast<int>(i));
    all.emplace(key, static_cast<int>(i));
  }
  std::vector<MarkerPerson> found;
  for (const std::string& person : people)
    if (MatchedMarkers markers = match(points_of_person.at(person)); num_joints(markers) >= kFewJoints)
      found.push_back({person, std::move(markers)});
  if (found.empty()) found.push_back({"", match(all)});
  if (found.size() == 1 && !found[0].name.empty()) {
    KeyedPoints own = points_of_person.at(found[0].name);
    own.insert(points_of_person[""].begin(), points_of_person[""].end());
    found[0].markers = match(own);
  }
  for (MarkerPerson& person : found)
    if (person.name.empty()) person.name = kUnnamedPerson;
  return found;
}

}  // namespace doppel
