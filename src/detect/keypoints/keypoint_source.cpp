#include "doppel/detect/keypoints/keypoint_source.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/detect/keypoints/read_keypoints.h"

namespace doppel {

namespace fs = std::filesystem;

KeypointCamera keypoint_camera(const Camera& camera, int index) {
  return {camera.name, index, camera.width, camera.height};
}

std::map<long, fs::path> keypoint_files_of_folder(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().extension() == ".json")
      names.push_back(entry.path().filename().string());
  if (names.empty())
    fail_at({folder.string(), 0},
            "reading keypoints: the folder has no .json file; name the files with {{frame}}, or "
            "the file of all frames");
  const NumberedNames numbered = number_names(names);
  if (numbered.by_position && names.size() > 1)
    log::warn(
        "{}: the names of the files do not end in different frame numbers, or hold times; their frames are their "
        "positions in natural order",
        folder.string());
  std::map<long, fs::path> files;
  for (std::size_t i = 0; i < names.size(); ++i) files[numbered.frames[i]] = folder / names[i];
  return files;
}

namespace {

/// Whether a file says of no image which one it is: its name does.
bool is_of_one_image(const fs::path& path, const KeypointCamera& camera) {
  const Detections detections = read_detections(path, camera);
  return std::all_of(detections.images.begin(), detections.images.end(),
                     [](const DetectedImage& image) { return !image.frame && image.name.empty(); });
}

}  // namespace

KeypointSource::KeypointSource(std::string path, const PointLayout& layout, const KeypointCamera& camera, long offset)
    : path_(std::move(path)), layout_(layout), camera_(camera), offset_(offset) {
  if (has_frame_placeholder(path_)) return;
  if (fs::is_directory(path_)) files_ = keypoint_files_of_folder(path_);
  if (files_.size() > 1 || (files_.size() == 1 && is_of_one_image(files_.begin()->second, camera_))) return;
  all_ = read_all_people(files_.empty() ? fs::path(path_) : files_.begin()->second, layout_, camera_);
}

std::optional<People> KeypointSource::people(long frame) const {
  frame += offset_;
  if (frame < 0) return std::nullopt;
  if (all_) {
    const auto found = all_->find(frame);
    return found == all_->end() ? People() : found->second;
  }
  if (!files_.empty()) {
    const auto found = files_.find(frame);
    return found == files_.end() ? std::nullopt : std::optional(read_people(found->second, layout_, camera_));
  }
  const fs::path file = expand_pattern(path_, 0, "", frame);
  return fs::is_regular_file(file) ? std::optional(read_people(file, layout_, camera_)) : std::nullopt;
}

std::optional<std::pair<long, long>> KeypointSource::range() const {
  if (all_ && !all_->empty()) return std::pair(all_->begin()->first - offset_, all_->rbegin()->first - offset_);
  if (!files_.empty() && !all_) return std::pair(files_.begin()->first - offset_, files_.rbegin()->first - offset_);
  return std::nullopt;
}

}  // namespace doppel
