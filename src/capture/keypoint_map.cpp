#include "doppel/capture/keypoint_map.h"

#include <algorithm>
#include <array>
#include <set>

#include "doppel/capture/builtin_keypoint_maps.h"
#include "doppel/core/as_size.h"
#include "doppel/core/config.h"

namespace doppel {

namespace {

const std::vector<PointLayout>& known_layouts() {
  static const std::vector<PointLayout> layouts{
      {"body25", {"Nose", "Neck",    "RShoulder", "RElbow", "RWrist",  "LShoulder", "LElbow", "LWrist", "MidHip",
                  "RHip", "RKnee",   "RAnkle",    "LHip",   "LKnee",   "LAnkle",    "REye",   "LEye",   "REar",
                  "LEar", "LBigToe", "LSmallToe", "LHeel",  "RBigToe", "RSmallToe", "RHeel"}},
      {"coco18",
       {"Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "RHip", "RKnee", "RAnkle",
        "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar"}},
      {"coco17",
       {"nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
        "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
        "right_ankle"}}};
  return layouts;
}

std::vector<std::string> layout_names() {
  std::vector<std::string> names;
  for (const PointLayout& layout : known_layouts()) names.push_back(layout.name);
  return names;
}

PointLayout read_layout(const ConfigReader& root) {
  if (root.has("layout") == root.has("points"))
    root.fail_at_key("layout", "a map needs either `layout: {}` or `points:`, the detector's points in their order",
                     fmt::join(layout_names(), " | "));
  if (root.has("layout")) {
    const std::string name = root.choice("layout", layout_names());
    return *std::find_if(known_layouts().begin(), known_layouts().end(),
                         [&](const PointLayout& layout) { return layout.name == name; });
  }
  PointLayout layout{"points", root.list<std::string>("points")};
  const std::set<std::string> unique(layout.points.begin(), layout.points.end());
  if (layout.points.empty() || unique.size() != layout.points.size() || unique.count("") > 0)
    root.fail_at_key("points", "must be a list of names, each of them once");
  return layout;
}

int find_point(const ConfigReader& section, const std::string& landmark, const PointLayout& layout,
               const std::string& name) {
  const auto found = std::find(layout.points.begin(), layout.points.end(), name);
  if (found == layout.points.end())
    section.fail_at_key(landmark, "the detector has no point '{}'; '{}' has {}", name, layout.name,
                        fmt::join(layout.points, ", "));
  return static_cast<int>(found - layout.points.begin());
}

KeypointMap read_map(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  KeypointMap map;
  map.layout = read_layout(root);
  const auto add = [&](const ConfigReader& at, const std::string& key, KeypointMap::Entry entry) {
    if (map.find(entry.landmark)) at.fail_at_key(key, "the landmark '{}' is given twice", entry.landmark);
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
  if (map.entries.empty()) root.fail_at_key("landmarks", "a map needs lines `<landmark>: <point>` below `landmarks`");
  for (const std::string& landmark : root.list<std::string>("absent")) add(root, "absent", {landmark, {}});
  root.finish();
  return map;
}

}  // namespace

const KeypointMap::Entry* KeypointMap::find(const std::string& landmark) const {
  for (const Entry& entry : entries)
    if (entry.landmark == landmark) return &entry;
  return nullptr;
}

std::vector<std::string> builtin_keypoint_maps() {
  std::vector<std::string> names;
  names.reserve(kBuiltinKeypointMaps.size());
  for (const BuiltinKeypointMap& map : kBuiltinKeypointMaps) names.emplace_back(map.name);
  return names;
}

KeypointMap read_keypoint_map(const std::string& name_or_path) {
  for (const BuiltinKeypointMap& map : kBuiltinKeypointMaps)
    if (name_or_path == map.name) return read_map(ConfigDocument::parse(map.yaml, name_or_path + ".yaml (built in)"));
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
  std::vector<Marker> markers;
  for (const Marker& marker : skeleton.markers)
    if (map.find(marker.name)) markers.push_back(marker);
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
          map.layout.name, landmark.name, fmt::join(known, ", "));
    }
    points_.push_back(entry->points);
  }
}

std::vector<Keypoint> LandmarkPicker::pick(const std::optional<Person>& person) const {
  if (!person) return std::vector<Keypoint>(points_.size());
  std::vector<Keypoint> landmarks;
  for (const std::vector<int>& points : points_) {
    Keypoint middle{0.0f, 0.0f, points.empty() ? 0.0f : 1.0f};
    for (const int place : points) {
      const Keypoint& point = person->at(as_size(place));
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
    for (const int place : points) {
      const JointDetection& joint = joints.at(as_size(place));
      middle.position += joint.position / static_cast<double>(points.size());
      middle.seen = middle.seen && joint.seen;
    }
    landmarks.push_back(middle.seen ? middle : JointDetection());
  }
  return landmarks;
}

}  // namespace doppel
