#include "doppel/detect/keypoints/guess_layout.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/core/path_pattern.h"
#include "doppel/core/thin_out.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/limbs.h"
#include "doppel/detect/keypoints/read_keypoints.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kMaxFilesRead = 40;
constexpr double kClearlyShorter = 0.8;  ///< ratio of the limbs' lengths in the two layouts
constexpr int kMinLimbs = 8;             ///< seen in both layouts

/// The order of a wrong layout joins points that are far apart.
std::vector<NamedLimb> checked_limbs() {
  std::vector<NamedLimb> limbs(kBodyLimbs.begin(), kBodyLimbs.end());
  limbs.push_back({"nose", "left_eye"});
  limbs.push_back({"nose", "right_eye"});
  return limbs;
}

/// Mean length of the limbs in the order of a layout.
struct LimbLength {
  double sum = 0.0;
  int count = 0;
  double mean() const { return sum / std::max(count, 1); }
};

LimbLength limb_length(const KeypointMap& map, const std::vector<Detections>& detections) {
  LimbLength length;
  for (const NamedLimb& limb : checked_limbs()) {
    const KeypointMap::Entry *a = map.find(limb[0]), *b = map.find(limb[1]);
    if (!a || !b || a->points.size() != 1 || b->points.size() != 1) continue;
    for (const Detections& file : detections)
      for (const DetectedImage& image : file.images)
        for (const DetectedPerson& person : image.people) {
          const std::size_t from = as_size(a->points[0]), to = as_size(b->points[0]);
          if (std::max(from, to) >= person.body.size()) continue;
          const Keypoint &p = person.body[from], &q = person.body[to];
          if (p.confidence <= 0.0f || q.confidence <= 0.0f) continue;
          length.sum += std::hypot(p.x - q.x, p.y - q.y);
          ++length.count;
        }
  }
  return length;
}

/// How many points most people have, with and without the points beside the body; 0: there is nobody.
std::pair<std::size_t, std::size_t> usual_number(const std::vector<Detections>& detections) {
  std::map<std::pair<std::size_t, std::size_t>, int> numbers;
  for (const Detections& file : detections)
    for (const DetectedImage& image : file.images)
      for (const DetectedPerson& person : image.people) {
        const bool seen = std::any_of(person.body.begin(), person.body.end(),
                                      [](const Keypoint& point) { return point.confidence > 0.0f; });
        if (seen) ++numbers[{person.body.size(), person.body.size() + person.rest.size()}];
      }
  const auto most = std::max_element(numbers.begin(), numbers.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == numbers.end() ? std::pair<std::size_t, std::size_t>() : most->first;
}

std::vector<std::string> layouts_of_size(std::size_t count) {
  std::vector<std::string> names;
  for (const PointLayout& layout : builtin_layouts())
    if (layout.points.size() == count) names.push_back(layout.name);
  return names;
}

/// The first layout of that number of points (any number if `is_subset`) that has all these names.
std::optional<std::string> layout_with_names(const std::vector<std::string>& names, bool is_subset) {
  for (const PointLayout& layout : builtin_layouts()) {
    if (names.empty() || (!is_subset && layout.points.size() != names.size())) continue;
    const bool all =
        std::all_of(names.begin(), names.end(), [&](const std::string& name) { return layout.find(name).has_value(); });
    if (all) return layout.name;
  }
  return std::nullopt;
}

std::string decide_by_limbs(const std::vector<std::string>& names, const std::vector<Detections>& detections,
                            const FileLocation& where) {
  std::vector<std::pair<double, std::string>> lengths;
  int fewest = kMinLimbs;
  for (const std::string& name : names) {
    const LimbLength length = limb_length(read_keypoint_map(name), detections);
    fewest = std::min(fewest, length.count);
    lengths.emplace_back(length.mean(), name);
  }
  std::sort(lengths.begin(), lengths.end());
  if (fewest < kMinLimbs || lengths[0].first > kClearlyShorter * lengths[1].first)
    fail_at(where,
            "reading keypoints: the points may be those of {}, and the detected people do not decide it; say which "
            "with `keypoint_map`",
            fmt::join(names, " or "));
  return lengths[0].second;
}

void read_some_of_folder(const fs::path& folder, const KeypointCamera& camera, std::vector<Detections>& found) {
  const std::map<long, fs::path> files = keypoint_files_of_folder(folder);
  const std::size_t step = std::max<std::size_t>(1, files.size() / as_size(kMaxFilesRead));
  std::size_t i = 0;
  for (const auto& [frame, file] : files)
    if (i++ % step == 0) found.push_back(read_detections(file, camera));
}

void read_some_of_pattern(const std::string& pattern, const KeypointCamera& camera, std::vector<Detections>& found) {
  std::vector<long> frames = frames_of_pattern(pattern);
  thin_out(frames, kMaxFilesRead);
  for (const long frame : frames) found.push_back(read_detections(expand_pattern(pattern, 0, "", frame), camera));
}

}  // namespace

std::optional<std::string> guess_layout(const std::vector<Detections>& detections, const FileLocation& where) {
  for (const Detections& file : detections)
    if (const auto named = layout_with_names(file.points, file.by_name)) return named;
  const auto [body, all] = usual_number(detections);
  if (body == 0) return std::nullopt;
  const bool has_all = all != body && !layouts_of_size(all).empty();
  const std::vector<std::string> names = layouts_of_size(has_all ? all : body);
  if (names.empty())
    fail_at(where,
            "reading keypoints: people have {} points, which is no built-in layout ({}); describe the detector's "
            "points in a map of your own and name it with `keypoint_map`",
            body, fmt::join(builtin_keypoint_maps(), ", "));
  return names.size() == 1 ? names[0] : decide_by_limbs(names, detections, where);
}

std::optional<std::string> guess_layout(const std::string& path, const KeypointCamera& camera) {
  std::vector<Detections> found;
  if (has_frame_placeholder(path)) {
    read_some_of_pattern(path, camera, found);
  } else if (fs::is_directory(path)) {
    read_some_of_folder(path, camera, found);
  } else {
    found.push_back(read_detections(path, camera));
  }
  return guess_layout(found, {path, 0});
}

}  // namespace doppel
