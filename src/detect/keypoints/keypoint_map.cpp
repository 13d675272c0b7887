#include "doppel/detect/keypoints/keypoint_map.h"

#include <algorithm>
#include <regex>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/detect/keypoints/builtin_keypoint_maps.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxPoints = 10000;  ///< of a layout
constexpr std::size_t kMaxListed = 150;    ///< names in a message

/// The names in a message.
std::string listed(const std::vector<std::string>& names) {
  const std::size_t shown = std::min(names.size(), kMaxListed);
  const std::string text = fmt::format("{}", fmt::join(names.begin(), names.begin() + static_cast<long>(shown), ", "));
  return shown == names.size() ? text : fmt::format("{} and {} more", text, names.size() - shown);
}

/// "face_{0..2}" stands for face_0, face_1 and face_2; a name without such a range stands for itself.
std::vector<std::string> names_of_range(const ConfigReader& root, const std::string& text) {
  static const std::regex range(R"((.*)\{(\d{1,9})\.\.(\d{1,9})\}(.*))");
  std::smatch parts;
  if (text.size() > 200 || !std::regex_match(text, parts, range)) return {text};
  const int first = std::stoi(parts[2]), last = std::stoi(parts[3]);
  if (first > last || as_size(last) >= kMaxPoints)
    root.fail_at_key("points", "the range '{}' must ascend, to at most {}", text, kMaxPoints - 1);
  std::vector<std::string> names;
  for (int i = first; i <= last; ++i) names.push_back(fmt::format("{}{}{}", parts[1].str(), i, parts[4].str()));
  return names;
}

PointLayout read_points(const ConfigReader& root) {
  PointLayout layout{"points", {}};
  for (const std::string& text : root.list<std::string>("points"))
    for (std::string& name : names_of_range(root, text)) {
      if (layout.points.size() == kMaxPoints) root.fail_at_key("points", "are more than {}", kMaxPoints);
      layout.points.push_back(std::move(name));
    }
  const std::set<std::string> unique(layout.points.begin(), layout.points.end());
  if (layout.points.empty() || unique.size() != layout.points.size() || unique.count("") > 0)
    root.fail_at_key("points", "must be a list of names, each of them once");
  return layout;
}

PointLayout read_layout(const ConfigReader& root) {
  if (root.has("layout") == root.has("points"))
    root.fail_at_key("layout", "a map needs either `layout: {}` or `points:`, the detector's points in their order",
                     fmt::join(builtin_keypoint_maps(), " | "));
  if (root.has("points")) return read_points(root);
  const std::string name = root.choice("layout", builtin_keypoint_maps());
  const std::vector<PointLayout>& layouts = builtin_layouts();
  return *std::find_if(layouts.begin(), layouts.end(), [&](const PointLayout& layout) { return layout.name == name; });
}

int find_point(const ConfigReader& section, const std::string& landmark, const PointLayout& layout,
               const std::string& name) {
  const std::optional<int> found = layout.find(name);
  if (!found)
    section.fail_at_key(landmark, "the detector has no point '{}'; '{}' has {}", name, layout.name,
                        listed(layout.points));
  return *found;
}

void read_landmarks_of_map(const ConfigReader& root, KeypointMap& map) {
  std::set<std::string> given;
  const auto add = [&](const ConfigReader& at, const std::string& key, KeypointMap::Entry entry) {
    if (!given.insert(entry.landmark).second) at.fail_at_key(key, "the landmark '{}' is given twice", entry.landmark);
    map.entries.push_back(std::move(entry));
  };
  const ConfigReader landmarks = root.section("landmarks");
  for (const std::string& landmark : landmarks.keys()) {
    KeypointMap::Entry entry{landmark, {}};
    for (const std::string& point : landmarks.list<std::string>(landmark))
      entry.points.push_back(find_point(landmarks, landmark, map.layout, point));
    if (entry.points.empty())
      landmarks.fail_at_key(landmark, "names no point; list the landmark under `absent` if the detector has none");
    add(landmarks, landmark, std::move(entry));
  }
  for (const std::string& landmark : root.list<std::string>("absent")) add(root, "absent", {landmark, {}});
}

std::set<std::string> landmark_keys(const KeypointMap& map) {
  std::set<std::string> keys;
  for (const KeypointMap::Entry& entry : map.entries) keys.insert(landmark_key(entry.landmark));
  return keys;
}

void add_every_point(KeypointMap& map) {
  std::set<std::string> keys = landmark_keys(map);
  for (std::size_t i = 0; i < map.layout.points.size(); ++i)
    if (keys.insert(landmark_key(map.layout.points[i])).second)
      map.entries.push_back({map.layout.points[i], {static_cast<int>(i)}});
}

KeypointMap read_map(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  KeypointMap map;
  map.layout = read_layout(root);
  read_landmarks_of_map(root, map);
  if (root.get("every_point", false)) add_every_point(map);
  const bool has_points =
      std::any_of(map.entries.begin(), map.entries.end(), [](const auto& entry) { return !entry.points.empty(); });
  if (!has_points) root.fail_at_key("landmarks", "a map needs lines `<landmark>: <point>` below `landmarks`");
  root.finish();
  return map;
}

KeypointMap read_builtin_map(const BuiltinFile& file) {
  KeypointMap map = read_map(ConfigDocument::parse(file.text, std::string(file.name) + ".yaml (built in)"));
  map.layout.name = file.name;
  return map;
}

}  // namespace

const KeypointMap::Entry* KeypointMap::find(const std::string& landmark) const {
  std::vector<std::string> names;
  for (const Entry& entry : entries) names.push_back(entry.landmark);
  const std::optional<int> index = find_landmark(names, landmark);
  return index ? &entries[*index] : nullptr;
}

std::vector<std::string> builtin_keypoint_maps() {
  std::vector<std::string> names;
  names.reserve(kBuiltinKeypointMaps.size());
  for (const BuiltinFile& map : kBuiltinKeypointMaps) names.emplace_back(map.name);
  return names;
}

const std::vector<PointLayout>& builtin_layouts() {
  static const std::vector<PointLayout> layouts = [] {
    std::vector<PointLayout> all;
    for (const BuiltinFile& map : kBuiltinKeypointMaps) all.push_back(read_builtin_map(map).layout);
    return all;
  }();
  return layouts;
}

KeypointMap read_keypoint_map(const std::string& name_or_path) {
  for (const BuiltinFile& map : kBuiltinKeypointMaps)
    if (name_or_path == map.name) return read_builtin_map(map);
  if (!std::filesystem::exists(name_or_path))
    fail<UsageError>("there is no keypoint map '{}': it is neither a file nor one of those built in, {}", name_or_path,
                     fmt::join(builtin_keypoint_maps(), ", "));
  return read_map(ConfigDocument::load(name_or_path));
}

KeypointMap map_of_names(const std::vector<Marker>& landmarks) {
  KeypointMap map;
  map.layout.name = "names";
  for (std::size_t m = 0; m < landmarks.size(); ++m) {
    map.layout.points.push_back(landmarks[m].name);
    map.entries.push_back({landmarks[m].name, {static_cast<int>(m)}});
  }
  return map;
}

std::vector<Marker> known_markers(const Skeleton& skeleton, const KeypointMap& map) {
  const std::set<std::string> keys = landmark_keys(map);
  std::vector<Marker> markers;
  for (const Marker& marker : skeleton.markers)
    if (keys.contains(landmark_key(marker.name))) markers.push_back(marker);
  return markers;
}

LandmarkPicker::LandmarkPicker(const KeypointMap& map, const std::vector<Marker>& landmarks) {
  for (const Marker& landmark : landmarks) {
    const KeypointMap::Entry* const entry = map.find(landmark.name);
    if (!entry) {
      std::vector<std::string> known;
      for (const KeypointMap::Entry& other : map.entries) known.push_back(other.landmark);
      fail(
          "the keypoint map of '{}' does not contain the landmark '{}'; it contains {}. List it under `absent` of a "
          "map of your own if the detector does not find it",
          map.layout.name, landmark.name, listed(known));
    }
    points_.push_back(entry->points);
  }
}

std::vector<Keypoint> LandmarkPicker::pick(const std::optional<Person>& person) const {
  if (!person) return std::vector<Keypoint>(points_.size());
  std::vector<Keypoint> landmarks;
  for (const std::vector<int>& points : points_) {
    Keypoint middle{0.0f, 0.0f, points.empty() ? 0.0f : 1.0f};
    for (const int number : points) {
      const Keypoint& point = person->at(as_size(number));
      middle.x += point.x / static_cast<float>(points.size());
      middle.y += point.y / static_cast<float>(points.size());
      middle.confidence = std::min(middle.confidence, point.confidence);
    }
    landmarks.push_back(middle.confidence > 0.0f ? middle : Keypoint());
  }
  return landmarks;
}

std::vector<JointDetection> LandmarkPicker::pick(const std::vector<JointDetection>& joints) const {
  std::vector<JointDetection> landmarks;
  for (const std::vector<int>& points : points_) {
    JointDetection middle;
    middle.seen = !points.empty();
    for (const int number : points) {
      const JointDetection& joint = joints.at(as_size(number));
      middle.position += joint.position / static_cast<double>(points.size());
      middle.seen = middle.seen && joint.seen;
      middle.noise = joint.noise;  // a mean of points does not lower the network's error, which neighbours share
    }
    landmarks.push_back(middle.seen ? middle : JointDetection());
  }
  return landmarks;
}

}  // namespace doppel
