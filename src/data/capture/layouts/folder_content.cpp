#include "doppel/data/capture/layouts/folder_content.h"

#include <algorithm>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/layouts/file_streams.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/detect/keypoints/read_keypoints.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr long kFilesTried = 20;            // files of a stream that are searched for a person
constexpr long kMaxCameras = 100;           // longer streams of keypoint files are frames
constexpr double kMaxNegative = 0.3;        // of the points of an image that lie left of it or above
constexpr long kMaxCalibrationFiles = 100;  // RealityCapture writes a file per camera; longer streams are frames

/// For files whose coordinates are parts of the image's size.
const KeypointCamera kAnySize{"", -1, 1, 1};

/// Reads the files step by step.
class FolderReader {
 public:
  explicit FolderReader(const FolderListing& listing) : streams_(group_streams(listing.files())) {
    content_.root = listing.root();
    content_.files = listing.files();
  }

  FolderContent read(const std::vector<std::string>& folders) {
    find_calibrations(folders);
    for (const FileStream& stream : streams_) {
      if (stream.kind == FileKind::video || (stream.kind == FileKind::image && stream.per_frame)) inspect(stream);
      if (stream.kind == FileKind::json || stream.kind == FileKind::table) inspect_keypoints(stream);
    }
    return std::move(content_);
  }

 private:
  fs::path full(const std::string& path) const { return content_.root / path; }

  void find_calibrations(const std::vector<std::string>& folders) {
    for (const std::string& folder : folders) try_calibration(folder);
    std::set<std::string> frames;  // folders
    for (const FileStream& stream : streams_)
      if (stream.per_frame && stream.files > kMaxCalibrationFiles) frames.insert(folder_of(stream.first_file));
    for (const std::string& file : content_.files) {
      const FileKind kind = kind_of_file(file);
      const bool is_frame = kind == FileKind::json && frames.count(folder_of(file)) > 0;
      if (kind != FileKind::video && kind != FileKind::image && !is_frame) try_calibration(file);
    }
  }

  void try_calibration(const std::string& path) {
    try {
      if (!is_calibration(full(path))) return;
      Calibration calibration = load_calibration(full(path));
      if (calibration.has_poses && !calibration.cameras.empty())
        content_.calibrations.push_back({path, std::move(calibration)});
      else
        content_.notes.push_back(
            fmt::format("{} ({}) holds intrinsics without poses; it is not used", path, calibration.format));
    } catch (const Error& e) {
      content_.notes.push_back(fmt::format("{} looks like a calibration, but cannot be read: {}", path, e.what()));
    }
  }

  void inspect(const FileStream& stream) {
    try {
      content_.footage[stream.first_file] = inspect_footage(full(stream.first_file).string());
      if (role_of_file(stream.first_file) == FileRole::masks)
        content_.masks[stream.first_file] =
            look_at_masks(full(stream.per_frame ? stream.path : stream.first_file).string());
    } catch (const Error& e) {
      content_.notes.emplace_back(e.what());
    }
  }

  void inspect_keypoints(const FileStream& stream) {
    if (stream.kind == FileKind::table) return inspect_table(stream.first_file);
    const std::vector<std::string> maps = maps_of(stream);
    if (maps.empty()) return;
    content_.keypoint_maps[stream.first_file] = maps;
    const PointLayout layout = read_keypoint_map(maps.front()).layout;
    for (const std::string& path : files_of_all_frames(stream))
      if (!note_frames(path, layout)) break;
  }

  /// Files that may hold all frames of a camera: few that differ in a number may be one for each camera.
  std::vector<std::string> files_of_all_frames(const FileStream& stream) const {
    if (!stream.per_frame) return {stream.first_file};
    std::vector<std::string> paths;
    if (stream.by_position || stream.files > kMaxCameras) return paths;
    for (long number = stream.first_frame; number <= stream.last_frame && paths.size() < as_size(kMaxCameras);
         ++number) {
      const std::string path = expand_pattern(stream.path, 0, "", number);
      if (fs::exists(full(path))) paths.push_back(path);
    }
    return paths;
  }

  /// Tables of other programs than ours count if their points are those of a built-in layout.
  void inspect_table(const std::string& path) {
    const fs::path file = full(path);
    if (is_joint_table(file)) content_.joint_tables.push_back(path);
    const bool one_row_per_point = is_keypoint_table(file);
    if (one_row_per_point) content_.keypoint_maps[path] = {"names"};
    try {
      const Detections found = read_detections(file);
      const std::optional<std::string> layout =
          one_row_per_point ? std::nullopt : guess_layout({found}, {file.string(), 0});
      if (one_row_per_point)
        note_frames(path, {"names", found.points});
      else if (layout && !is_in_space(found) && note_frames(path, read_keypoint_map(*layout).layout))
        content_.keypoint_maps[path] = {"names"};
    } catch (const Error&) {  // no table of keypoints, or one of several cameras
      if (one_row_per_point) note_frames_of_cameras(path);
    }
  }

  /// The frames of a table with a column for the names of cameras.
  void note_frames_of_cameras(const std::string& path) {
    std::set<std::string> names;
    for (const FoundCalibration& found : content_.calibrations)
      for (const Camera& camera : found.calibration.cameras) names.insert(camera.name);
    for (const std::string& name : names) try {
        for (const DetectedImage& image : read_detections(full(path), {name, -1, 1, 1}).images) {
          if (!image.frame) continue;
          const auto [entry, is_new] = content_.keypoint_frames.emplace(path, std::pair(*image.frame, *image.frame));
          entry->second = {std::min(entry->second.first, *image.frame), std::max(entry->second.second, *image.frame)};
        }
      } catch (const Error&) {  // the table has no such camera
      }
  }

  /// The first and the last frame with people. @return whether the file can be read, and shows anybody
  bool note_frames(const std::string& path, const PointLayout& layout) {
    try {
      const std::map<long, People> people = read_all_people(full(path), layout, kAnySize);
      long first = -1, last = -1;
      for (const auto& [frame, found] : people) {
        if (found.empty()) continue;
        if (first < 0) first = frame;
        last = frame;
      }
      if (first >= 0) content_.keypoint_frames[path] = {first, last};
      return first >= 0;
    } catch (const Error&) {
      return false;
    }
  }

  /// Many points with negative coordinates are no points of an image.
  static bool is_in_space(const Detections& detections) {
    int negative = 0, all = 0;
    for (const DetectedImage& image : detections.images)
      for (const DetectedPerson& person : image.people)
        for (const Keypoint& point : person.body) {
          all += point.confidence > 0.0f;
          negative += std::min(point.x, point.y) < 0.0f;
        }
    return negative > kMaxNegative * all;
  }

  /// The maps whose points the people in the files of a stream have; of several, the one whose order of points fits the
  /// limbs, if they decide. Many files may show nobody.
  std::vector<std::string> maps_of(const FileStream& stream) const {
    const std::vector<std::string> paths = some_files(stream);
    std::vector<std::string> maps;
    for (const std::string& name : builtin_keypoint_maps()) {
      const PointLayout layout = read_keypoint_map(name).layout;
      if (std::any_of(paths.begin(), paths.end(), [&](const auto& path) { return has_people(path, layout, stream); }))
        maps.push_back(name);
    }
    if (maps.size() < 2) return maps;
    try {
      const auto layout = guess_layout(full(stream.per_frame ? stream.path : stream.first_file).string(), {});
      return layout ? std::vector<std::string>{*layout} : maps;
    } catch (const FileError&) {
      return maps;
    }
  }

  /// Files from the whole recording: it may begin with the empty scene.
  std::vector<std::string> some_files(const FileStream& stream) const {
    if (!stream.per_frame) return {full(stream.first_file).string()};
    std::vector<std::string> paths;
    if (stream.by_position) {
      for (const auto& [frame, path] : keypoint_files_of_folder(full(stream.path))) paths.push_back(path.string());
      const std::size_t every = (paths.size() + kFilesTried - 1) / kFilesTried;
      std::vector<std::string> some;
      for (std::size_t i = 0; i < paths.size(); i += every) some.push_back(paths[i]);
      return some;
    }
    const long step = (stream.files + kFilesTried - 1) / kFilesTried;
    for (long i = 0; i < stream.files; i += step) {
      const fs::path path = full(expand_pattern(stream.path, 0, "", stream.first_frame + i));
      if (fs::exists(path)) paths.push_back(path.string());
    }
    return paths;
  }

  static bool has_people(const std::string& path, const PointLayout& layout, const FileStream& stream) {
    try {
      return stream.per_frame ? !read_people(path, layout).empty() : !read_all_people(path, layout).empty();
    } catch (const Error&) {
      return false;
    }
  }

  FolderContent content_;
  std::vector<FileStream> streams_;
};

}  // namespace

FolderContent read_folder(const FolderListing& listing) { return FolderReader(listing).read(listing.folders()); }

}  // namespace doppel
