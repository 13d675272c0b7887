#include "detected_capture.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/detect/keypoints/keypoint_map.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A path as capture.yaml should have it: relative to the root where it lies inside.
std::string written(const fs::path& path, const Capture& capture) {
  const fs::path full = fs::absolute(path).lexically_normal();
  const fs::path inside = full.lexically_relative(capture.root);
  return inside.empty() || *inside.begin() == ".." ? full.string() : inside.string();
}

/// The path of a sequence's files for all cameras, with `{name}` in place of the camera's name, with which the last
/// part of the path begins. Empty: none were written. @param key of the report
std::string pattern_of(const Json& report, const std::string& sequence, const char* key, const Capture& capture) {
  for (const Json& camera : report["cameras"]) {
    const fs::path path = camera[key].get<std::string>();
    if (camera["sequence"] != sequence || path.empty()) continue;
    const std::string rest = path.filename().string().substr(camera["camera"].get<std::string>().size());
    return written(path.parent_path() / ("{name}" + rest), capture);
  }
  return "";
}

bool needs_masks(const Capture& capture) {
  return std::any_of(capture.sequences.begin(), capture.sequences.end(),
                     [](const SequenceEntry& sequence) { return !sequence.has_masks(); });
}

/// Whether a detection was made of this capture: its calibration, and its sequences with their videos.
bool is_of(const Capture& capture, const Capture& detected) {
  const auto same_path = [&](const std::string& here, const std::string& there) {
    return fs::weakly_canonical(capture.resolve(here)) == fs::weakly_canonical(detected.resolve(there));
  };
  if (!same_path(capture.calibration, detected.calibration) || capture.cameras != detected.cameras) return false;
  return std::equal(capture.sequences.begin(), capture.sequences.end(), detected.sequences.begin(),
                    detected.sequences.end(), [&](const SequenceEntry& here, const SequenceEntry& there) {
                      return here.name == there.name && same_path(here.videos.sample(), there.videos.sample());
                    });
}

/// Whether a source of footage has changed after a time: a file, the images of a folder, or those of a pattern.
bool is_newer(const std::string& source, fs::file_time_type time) {
  std::vector<fs::path> files;
  if (has_frame_placeholder(source)) {
    for (const long frame : frames_of_pattern(source)) files.emplace_back(expand_pattern(source, 0, "", frame));
  } else if (fs::is_directory(source)) {
    for (const auto& entry : fs::directory_iterator(source)) files.push_back(entry.path());
  } else if (fs::exists(source)) {
    files.emplace_back(source);
  }
  return std::any_of(files.begin(), files.end(),
                     [&](const fs::path& file) { return fs::last_write_time(file) > time; });
}

/// Whether earlier results fit: they are of this capture, newer than it and its videos, and have the masks that are
/// needed.
bool is_current(const Capture& capture, const fs::path& results, bool masks) {
  if (!fs::exists(results) || !is_of(capture, read_capture(results))) return false;
  const fs::file_time_type made = fs::last_write_time(results);
  if (!capture.file.empty() && fs::last_write_time(capture.file) > made) return false;
  const CaptureCameras filmed = choose_cameras(capture);
  for (const SequenceEntry& sequence : capture.sequences)
    for (std::size_t c = 0; c < filmed.cameras.size(); ++c) {
      const std::string video = capture.source(sequence.videos, filmed.file_index[c], filmed.cameras[c].name);
      if (is_newer(video, made)) return false;
    }
  return !masks || !needs_masks(read_capture(results));
}

/// The layout of the detected points becomes the keypoint map of a capture.
void name_layout(const std::string& layout, Capture& capture) {
  capture.detector.reset();
  const std::vector<std::string> maps = builtin_keypoint_maps();
  if (std::find(maps.begin(), maps.end(), layout) != maps.end())
    capture.keypoint_map = layout;
  else
    log::warn("no built-in map has the layout {}; set `keypoint_map` in capture.yaml to the file of the map", layout);
}

/// The detected keypoints are those of the chosen person alone, so the index of another detection means nothing.
void forget_person(Capture& capture) {
  capture.person = {};
  for (SequenceEntry& sequence : capture.sequences) sequence.person.reset();
}

}  // namespace

void check_detect_out(const fs::path& source, const fs::path& out) {
  const fs::path file = fs::is_directory(source) ? source / "capture.yaml" : source;
  if (fs::exists(file) && fs::weakly_canonical(out / "capture.yaml") == fs::weakly_canonical(file))
    fail<UsageError>("{} holds the capture itself; choose another folder with --out", out.string());
}

void write_detected_capture(const fs::path& source, const fs::path& out, const Json& report, bool keep_keypoints) {
  const std::optional<CaptureGuess> recognised = recognise_capture(source);
  if (!recognised) return;
  Capture capture = recognised->capture;
  const bool keep = keep_keypoints && capture.has_keypoints(), same_layout = capture.keypoint_map == report["layout"];
  bool found_points = false;
  for (SequenceEntry& sequence : capture.sequences) {
    const std::string keypoints = pattern_of(report, sequence.name, "keypoints", capture);
    const std::string joints = pattern_of(report, sequence.name, "joints3d", capture);
    const std::string masks = pattern_of(report, sequence.name, "masks", capture);
    const bool has_own = !sequence.keypoints.empty() || capture.detector;
    const bool kept = keep && (has_own || !same_layout);
    if (kept && !has_own)
      log::warn(
          "sequence {} has no keypoints and gets none: those that were found have the points of {}, those of the "
          "other sequences that are kept have others",
          sequence.name, report["layout"].get<std::string>());
    if (!keypoints.empty() && !kept) {
      sequence.keypoints = keypoints;
      sequence.keypoint_offset.clear();  // of the files before
    }
    found_points = found_points || (!keypoints.empty() && !kept);
    if (!joints.empty()) sequence.joints3d = joints;
    if (!masks.empty() && !sequence.has_masks()) {
      sequence.masks = masks + "/{frame:06}.png";
      sequence.mask_offset.clear();
    }
  }
  if (found_points) {
    name_layout(report["layout"], capture);
    forget_person(capture);
  }
  write_capture(out / "capture.yaml", capture, {"Written by `doppel detect`: the capture with the detected files."});
  log::info("{} names the detected files", (out / "capture.yaml").string());
}

bool lacks_keypoints(const fs::path& path) {
  const auto recognised = fs::is_directory(path / "store") ? std::nullopt : recognise_capture(path);
  return recognised && !recognised->capture.has_keypoints();
}

fs::path with_keypoints(const fs::path& path, const fs::path& folder, const DetectNeeds& needs,
                        const CommonOptions& common) {
  if (!lacks_keypoints(path)) return path;
  const Capture capture = find_capture(path);
  if (needs.character) capture.character_path();  // an error now saves the time of the detection
  const bool masks = needs.masks && needs_masks(capture);
  const fs::path results = folder / "capture.yaml";
  if (is_current(capture, results, masks)) {
    log::info("{} names no keypoints; those of {} are used", path.string(), folder.string());
    return results;
  }
  log::info("{} names no keypoints; running `doppel detect {} --out {}{}`", path.string(), path.string(),
            folder.string(), masks ? " --masks" : "");
  if (!detect_capture(path, folder, masks, common)) fail("stopped; no keypoints were written");
  return results;
}

}  // namespace doppel::tools
