#include "doppel/detect/keypoints/read_keypoints.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/file_head.h"
#include "doppel/core/log.h"
#include "doppel/detect/keypoints/csv_reader.h"
#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/detect/keypoints/json_parts.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHeadBytes = 16 << 10;
constexpr float kMaxFraction = 1.5f;
constexpr int kMinFractionPoints = 3;
constexpr double kShareOfFractions = 0.9, kShareOfNegatives = 0.3;

KeypointFile open_keypoint_file(const fs::path& path) {
  if (!fs::is_regular_file(path))
    fail_at({path.string(), 0}, "reading keypoints: there is no such file; check the path and its number of digits");
  KeypointFile file{path, read_head(path, kHeadBytes), nullptr};
  const std::size_t begin = file.head.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  const bool is_json = begin != std::string::npos && (file.head[begin] == '{' || file.head[begin] == '[');
  if (is_json) file.document = parse_keypoint_json(path);
  return file;
}

const KeypointFormat& format_of(const KeypointFile& file) {
  for (const auto& format : keypoint_formats())
    if (format->recognises(file)) return *format;
  std::vector<std::string> names;
  for (const auto& format : keypoint_formats()) names.push_back(format->name());
  const std::vector<std::string> columns =
      file.document ? std::vector<std::string>() : csv_cells(csv_header(file.head));
  const std::string found = columns.size() < 2 ? ""
                                               : fmt::format("; the first line names the columns {}",
                                                             excerpt(fmt::format("{}", fmt::join(columns, ", ")), 200));
  fail_at({file.path.string(), 0},
          "is not a keypoint file of a known format ({}): in JSON, a person must have `pose_keypoints_2d` or "
          "`keypoints`, in a list `people`, `annots`, `instances`, `predictions` or `annotations`; a table must have "
          "columns `frame`, `name` (or joint, keypoint, ...), `x` and `y`, or `frame` and two for each point like "
          "`nose_x` and `nose_y`{}",
          fmt::join(names, ", "), found);
}

/// Whether the coordinates of the seen points are fractions of the image's size.
PointUnit unit_by_content(const Detections& detections, const FileLocation& where) {
  int count = 0, small = 0, negative = 0;
  for (const DetectedImage& image : detections.images)
    for (const DetectedPerson& person : image.people)
      for (const Keypoint& point : person.body) {
        if (point.confidence <= 0.0f) continue;
        ++count;
        small += std::max(std::abs(point.x), std::abs(point.y)) <= kMaxFraction;
        negative += std::min(point.x, point.y) < 0.0f;
      }
  if (count < kMinFractionPoints || small < kShareOfFractions * count) return PointUnit::pixels;
  if (negative > kShareOfNegatives * count)
    fail_at(where,
            "reading keypoints: the coordinates are parts of the image's size from -1 to 1; pixels or parts from 0 to "
            "1 are needed (OpenPose: without --keypoint_scale)");
  return PointUnit::fractions;
}

std::string layouts_with(std::size_t count) {
  std::vector<std::string> names;
  for (const PointLayout& layout : builtin_layouts())
    if (layout.points.size() == count) names.push_back(layout.name);
  return names.empty() ? fmt::format("no built-in map has {}", count)
                       : fmt::format("{} has {}", fmt::join(names, " or "), count);
}

/// Brings the persons of one file into the order of a layout and into pixels.
class LayoutFit {
 public:
  LayoutFit(const Detections& detections, const PointLayout& layout, const KeypointCamera& camera, FileLocation where)
      : detections_(detections), layout_(layout), where_(std::move(where)) {
    order_names();
    if (detections.unit != PointUnit::fractions) return;
    if (camera.width <= 0 || camera.height <= 0)
      fail_at(where_,
              "reading keypoints: the coordinates are parts of the image's size, and the size of the images of camera "
              "'{}' is not known; state it in the calibration or name the video",
              camera.name);
    scale_x_ = static_cast<float>(camera.width);
    scale_y_ = static_cast<float>(camera.height);
  }

  /// Appends the image's people that have a seen point.
  void add(const DetectedImage& image, People& people) const {
    for (const DetectedPerson& detected : image.people) {
      const Person person = fitted(detected);
      const bool seen = std::any_of(person.begin(), person.end(), [](const Keypoint& p) { return p.confidence > 0; });
      if (seen) people.push_back(person);
    }
  }

 private:
  /// Finds the positions of points that have names. Names that the layout has at another index decide the order; names
  /// that the layout does not have leave it as it is.
  void order_names() {
    const std::vector<std::string>& names = detections_.points;
    if (!detections_.by_name && names.size() != layout_.points.size()) return;
    bool all = true, moved = false;
    std::set<int> taken;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::optional<int> index = layout_.find(names[i]);
      if (!index && detections_.by_name)
        fail_at(where_, "there is no point '{}'; '{}' has {}", names[i].substr(0, 60), layout_.name,
                fmt::join(layout_.points, ", "));
      const bool is_new = !index || taken.insert(*index).second;
      if (!is_new && detections_.by_name)
        fail_at(where_, "the point '{}' is given twice, under two spellings of its name", names[i].substr(0, 60));
      indices_.push_back(index.value_or(-1));
      all &= index && is_new;
      moved |= index && as_size(*index) != i;
    }
    if (!all && moved)
      fail_at(where_,
              "reading keypoints: the file names its points {}; those of the keypoint map '{}' are {}: name the "
              "detector's own map with `keypoint_map`",
              fmt::join(names, ", "), layout_.name, fmt::join(layout_.points, ", "));
    if (!all) indices_.clear();
  }

  Person fitted(const DetectedPerson& detected) const {
    const std::size_t count = layout_.points.size();
    Person person = detected.body;
    if (!indices_.empty() && person.size() == indices_.size()) {
      Person moved(count);
      for (std::size_t i = 0; i < indices_.size(); ++i) moved[indices_[i]] = person[i];
      person = std::move(moved);
    } else if (person.size() != count && !person.empty()) {
      person.insert(person.end(), detected.rest.begin(), detected.rest.end());
      if (person.size() != count) fail_count(detected);
    }
    for (Keypoint& point : person) {
      point.x *= scale_x_;
      point.y *= scale_y_;
    }
    return person;
  }

  [[noreturn]] void fail_count(const DetectedPerson& detected) const {
    const std::string more = detected.rest.empty() ? "" : fmt::format(" and {} more", detected.rest.size());
    fail_at(where_,
            "a person has {} points{}, but the keypoint map is for the {} of '{}' ({}); name the detector's own with "
            "`keypoint_map`",
            detected.body.size(), more, layout_.points.size(), layout_.name, layouts_with(detected.body.size()));
  }

  const Detections& detections_;
  const PointLayout& layout_;
  FileLocation where_;
  std::vector<int> indices_;
  float scale_x_ = 1.0f, scale_y_ = 1.0f;
};

/// The frame of each file name in the detections.
std::map<std::string, long> frames_by_name(const Detections& detections, const fs::path& path) {
  std::set<std::string> unique;
  for (const DetectedImage& image : detections.images)
    if (!image.name.empty()) unique.insert(image.name);
  const std::vector<std::string> names(unique.begin(), unique.end());
  const NumberedNames numbered = number_names(names);
  if (numbered.by_position)
    log::warn(
        "{}: the names of the {} images do not end in different frame numbers, or hold times; their frames are their "
        "positions in natural order",
        path.string(), names.size());
  std::map<std::string, long> frames;
  for (std::size_t i = 0; i < names.size(); ++i) frames[names[i]] = numbered.frames[i];
  return frames;
}

}  // namespace

Detections read_detections(const fs::path& path, const KeypointCamera& camera) {
  const KeypointFile file = open_keypoint_file(path);
  const KeypointFormat& format = format_of(file);
  Detections detections = format.read(file, camera);
  detections.format = format.name();
  if (detections.unit == PointUnit::unknown) detections.unit = unit_by_content(detections, {path.string(), 0});
  return detections;
}

People read_people(const fs::path& path, const PointLayout& layout, const KeypointCamera& camera) {
  const Detections detections = read_detections(path, camera);
  const LayoutFit fit(detections, layout, camera, {path.string(), 0});
  People people;
  for (const DetectedImage& image : detections.images) fit.add(image, people);
  return people;
}

std::map<long, People> read_all_people(const fs::path& path, const PointLayout& layout, const KeypointCamera& camera) {
  const Detections detections = read_detections(path, camera);
  const LayoutFit fit(detections, layout, camera, {path.string(), 0});
  const std::map<std::string, long> frames = frames_by_name(detections, path);
  std::map<long, People> all;
  for (const DetectedImage& image : detections.images) {
    if (!image.frame && image.name.empty())
      fail_at({path.string(), 0},
              "reading keypoints of all frames: an entry has no frame number (`frame_id`, or `image_id` as a number or "
              "a file name); files of one frame each need {{frame}} in their path, or the path of their folder");
    fit.add(image, all[image.frame ? *image.frame : frames.at(image.name)]);
  }
  return all;
}

}  // namespace doppel
