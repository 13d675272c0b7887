#include "doppel/data/capture/layouts/folder_content.h"

#include <algorithm>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/layouts/file_streams.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/detect/keypoints/read_keypoints.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr long kFilesTried = 20;            // files of a stream that are searched for a person
constexpr long kMaxCalibrationFiles = 100;  // RealityCapture writes a file per camera; longer streams are frames

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
      if (stream.per_frame && stream.files > kMaxCalibrationFiles) frames.insert(folder_of(stream.path));
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
    } catch (const Error& e) {
      content_.notes.emplace_back(e.what());
    }
  }

      if (role_of_file(stream.first_file) == FileRole::masks)
        content_.masks[stream.first_file] =
            look_at_masks(full(stream.per_frame ? stream.path : stream.first_file).string());
  void inspect_keypoints(const FileStream& stream) {
    const fs::path file = full(stream.first_file);
    std::vector<std::string> maps = stream.kind == FileKind::json ? maps_of(stream) : std::vector<std::string>();
    if (stream.kind == FileKind::table) {
      if (is_joint_table(file)) content_.joint_tables.push_back(stream.first_file);
      if (is_keypoint_table(file)) maps = {"names"};
    }
    if (!maps.empty()) content_.keypoint_maps[stream.first_file] = maps;
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
