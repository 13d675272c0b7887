#include "calibrate_rig.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/person_tracks.h"

namespace doppel::tools {

namespace {

constexpr double kMinConfidence = 0.1;
constexpr long kMaxFirstOutlines = 1500;

/// The frames of a camera between which the times lie.
std::set<long> frames_around(const CameraTrack& track, const std::vector<double>& times) {
  std::set<long> frames;
  for (const double time : times)
    for (const double frame : {std::floor(track.frame_at(time)), std::ceil(track.frame_at(time))})
      if (frame >= 0.0 && frame < static_cast<double>(track.num_frames())) frames.insert(static_cast<long>(frame));
  return frames;
}

/// The outlines of one camera in some frames. @throws FileError when a mask cannot be read
OutlineTrack outlines_of(const RigFootage& footage, std::size_t c, const std::set<long>& frames) {
  const Camera& camera = footage.filmed.cameras[c];
  MaskReader masks(footage.capture, footage.entry(), camera, footage.filmed.file_index[c]);
  OutlineTrack outlines(as_size(footage.tracks.cameras[c].num_frames()));
  for (const long frame : frames) outlines[frame] = outline_of(masks.read(frame), camera);
  return outlines;
}

/// @param frames [C]
std::vector<OutlineTrack> outlines_of(const RigFootage& footage, const std::vector<std::set<long>>& frames) {
  std::vector<OutlineTrack> outlines;
  if (!footage.entry().has_masks()) return outlines;
  for (std::size_t c = 0; c < frames.size(); ++c) {
    try {
      outlines.push_back(outlines_of(footage, c, frames[c]));
    } catch (const FileError& error) {
      log::warn("the masks of camera {} are not used: {}", footage.filmed.cameras[c].name, error.what());
      outlines.emplace_back(as_size(footage.tracks.cameras[c].num_frames()));
    }
  }
  return outlines;
}

}  // namespace

RigFootage open_rig_footage(const std::filesystem::path& path, const std::string& sequence) {
  RigFootage footage;
  footage.capture = find_capture(path);
  const std::vector<SequenceEntry>& all = footage.capture.sequences;
  if (all.empty()) fail("{} has no sequences", path.string());
  const auto found = std::find_if(all.begin(), all.end(), [&](const SequenceEntry& entry) {
    return sequence.empty() ? !entry.keypoints.empty() : entry.name == sequence;
  });
  if (found == all.end() && !sequence.empty()) {
    std::string names;
    for (const SequenceEntry& entry : all) names += (names.empty() ? "" : ", ") + entry.name;
    fail<UsageError>("{} has no sequence {}; its sequences are {}", path.string(), sequence, names);
  }
  footage.sequence = found == all.end() ? 0 : as_size(found - all.begin());
  footage.filmed = filmed_cameras(footage.capture);
  return footage;
}

void read_tracks(RigFootage& footage) {
  footage.tracks = read_tracks_of_rough_rig(footage.capture, footage.entry(), footage.filmed);
  drop_unusable(footage.tracks, kMinConfidence);
}

std::vector<OutlineTrack> read_outlines(const RigFootage& footage, const std::vector<double>& times) {
  std::vector<std::set<long>> frames;
  for (const CameraTrack& track : footage.tracks.cameras) frames.push_back(frames_around(track, times));
  return outlines_of(footage, frames);
}

std::vector<OutlineTrack> read_first_outlines(const RigFootage& footage) {
  std::vector<std::set<long>> frames;
  for (const CameraTrack& track : footage.tracks.cameras) {
    std::set<long>& of_camera = frames.emplace_back();
    for (long frame = 0; frame < std::min(track.num_frames(), kMaxFirstOutlines); ++frame) of_camera.insert(frame);
  }
  return outlines_of(footage, frames);
}

std::filesystem::path calibration_to_write(const Capture& capture, const std::string& out, const std::string& ending) {
  return out.empty() ? folder_of(capture) / (capture.calibration_path().stem().string() + ending + ".yml")
                     : std::filesystem::path(out);
}

void check_refined_target(const std::filesystem::path& out, const Capture& capture) {
  const std::vector<Camera> cameras = calibrated_cameras(capture);
  check_calibration_target(
      out, "", std::any_of(cameras.begin(), cameras.end(), [](const Camera& c) { return c.has_distortion(); }));
}

void write_result(const std::filesystem::path& out, const std::vector<Camera>& cameras, const std::string& format,
                  const CalibrationWriting& write) {
  try {
    write(out, cameras, format);
  } catch (const Error& error) {
    const std::exception_ptr first = std::current_exception();
    const std::string beside = folder_path(out).string() + ".yml";
    if (std::filesystem::exists(beside)) throw;
    try {
      write(beside, cameras, "opencv");
    } catch (const Error&) {
      std::rethrow_exception(first);  // the folder or the disk is at fault
    }
    fail("{}; the cameras were written to {} instead", error.what(), beside);
  }
}

void print_keys_to_remove(const Capture& capture) {
  const CalibrationOptions& keys = capture.calibration_options;
  const bool unit = !keys.unit.empty() && keys.unit != "m", up = !keys.up.empty() && keys.up != "+y";
  if (!unit && !up) return;
  std::printf(
      "note: the capture's %s would change how this file is read, which is in metres with y up. Remove %s from the "
      "capture when you name this file there, or use `doppel capture amend --calibration`, which does so\n",
      !up     ? "key `unit`"
      : !unit ? "key `up`"
              : "keys `unit` and `up`",
      unit && up ? "them" : "it");
}

std::filesystem::path folder_of(const Capture& capture) {
  return capture.file.empty() ? capture.root : capture.file.parent_path();
}

}  // namespace doppel::tools
