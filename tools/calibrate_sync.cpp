#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "calibrate_rig.h"
#include "calibrate_subcommands.h"
#include "doppel/calibration/estimation/audio_sync.h"
#include "doppel/calibration/estimation/synchronise.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel::tools {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kRounding = 1e-9;    // frames
constexpr double kSignificant = 2.0;  // standard deviations

struct SyncArguments {
  std::string capture, sequence, reference, out;
  double window = 30.0;
  bool audio = false, drift = false, points_only = false;
};

/// A number for a report; JSON has no infinity.
Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// Keeps offsets whose change is not significant: cameras that were started together stay together.
void keep_insignificant(Synchronisation& timing, const RigFootage& footage) {
  for (CameraTiming& camera : timing.cameras) {
    const FrameClock clock = footage.capture.clock(footage.entry(), camera.name);
    if (!camera.known || std::abs(camera.change) > kSignificant * camera.sigma) continue;
    camera.offset = clock.offset;
  }
}

/// The offsets by the sound of the videos.
Synchronisation synchronise_by_sound(const RigFootage& footage, int reference) {
  const auto recording = [&](std::size_t c) {
    const Camera& camera = footage.filmed.cameras[c];
    const std::string video = footage.capture.source(footage.entry().videos, footage.filmed.file_index[c], camera.name);
    const auto sound = read_audio(video);
    if (!sound) fail("synchronising by sound: {} has no sound; leave out --audio", video);
    return *sound;
  };
  const auto clock_of = [&](std::size_t c) {
    return footage.capture.clock(footage.entry(), footage.filmed.cameras[c].name);
  };
  const AudioTrack first = recording(as_size(reference));
  const FrameClock reference_clock = clock_of(as_size(reference));
  Synchronisation result;
  result.reference = reference;
  for (std::size_t c = 0; c < footage.filmed.cameras.size(); ++c) {
    const FrameClock clock = clock_of(c);
    CameraTiming timing;
    timing.name = footage.filmed.cameras[c].name;
    timing.offset = clock.offset;
    timing.fps = footage.capture.fps * clock.rate;
    timing.known = true;
    if (static_cast<int>(c) != reference) {
      const AudioOffset found = audio_offset(first, recording(c));
      timing.known = found.known;
      timing.contrast = found.contrast;
      timing.reason = found.reason;
      const double begin = reference_clock.offset / (footage.capture.fps * reference_clock.rate);
      if (found.known) timing.offset = (begin + found.seconds) * timing.fps;
      timing.change = timing.offset - clock.offset;
    }
    result.cameras.push_back(timing);
  }
  return result;
}

/// The capture with the offsets and rates that were found. Rows that some camera did not film are left out, by what is
/// known of the frames: they begin at 0 and reach at least to where the old offsets had the last row.
Capture with_timing(const RigFootage& footage, const Synchronisation& timing, bool drift) {
  Capture capture = footage.capture;
  SequenceEntry& sequence = capture.sequences[footage.sequence];
  for (const CameraTiming& camera : timing.cameras) {
    if (!camera.known) continue;
    sequence.frame_offset[camera.name] = camera.offset;
    if (drift) capture.camera_fps[camera.name] = camera.fps;
  }
  const SequenceEntry& old = footage.entry();
  for (const Camera& camera : footage.filmed.cameras) {
    const FrameClock clock = capture.clock(sequence, camera.name);
    const auto first = static_cast<long>(std::ceil((-clock.offset - kRounding) / clock.rate));
    sequence.first_frame = std::max(sequence.first_frame, first);
    if (!old.last_frame) continue;
    const double end = footage.capture.clock(old, camera.name).time(*old.last_frame);
    const auto last = static_cast<long>(std::floor((end - clock.offset + kRounding) / clock.rate));
    sequence.last_frame = std::min(*sequence.last_frame, last);
  }
  return capture;
}

Json json_of(const Synchronisation& timing, const RigFootage& footage, const std::string& out) {
  Json report{{"capture", footage.capture.name},
              {"sequence", footage.entry().name},
              {"reference", timing.cameras[timing.reference].name},
              {"out", out},
              {"median_before_px", timing.before},
              {"median_after_px", timing.after},
              {"cameras", Json::array()}};
  for (const CameraTiming& camera : timing.cameras)
    report["cameras"].push_back({{"name", camera.name},
                                 {"known", camera.known},
                                 {"frame_offset", camera.offset},
                                 {"change_frames", camera.change},
                                 {"sigma_frames", finite(camera.sigma)},
                                 {"fps", camera.fps},
                                 {"contrast", camera.contrast},
                                 {"median_before_px", camera.before},
                                 {"median_after_px", camera.after},
                                 {"reason", camera.reason}});
  return report;
}

void print_table(const Synchronisation& timing, bool sound) {
  std::printf("%-16s %12s %10s %10s %10s %12s %12s\n", "camera", "frame_offset", "change", "sigma", "contrast",
              "before (px)", "after (px)");
  for (const CameraTiming& camera : timing.cameras) {
    if (!camera.known) {
      std::printf("%-16s cannot tell: %s\n", camera.name.c_str(), camera.reason.c_str());
      continue;
    }
    std::printf("%-16s %12.2f %10.2f", camera.name.c_str(), camera.offset, camera.change);
    if (sound)
      std::printf(" %10s %10.2f\n", "-", camera.contrast);
    else
      std::printf(" %10.3f %10.2f %12.2f %12.2f\n", camera.sigma, camera.contrast, camera.before, camera.after);
  }
}

/// Refuses to replace a file that has offsets of other sequences, which the capture lacks.
void check_sync_out(const std::filesystem::path& out, const RigFootage& footage) {
  check_capture_out(out);
  if (!std::filesystem::exists(out)) return;
  for (const SequenceEntry& earlier : read_capture(out).sequences)
    for (const SequenceEntry& sequence : footage.capture.sequences)
      if (sequence.name == earlier.name && sequence.name != footage.entry().name &&
          sequence.frame_offset != earlier.frame_offset)
        fail<UsageError>(
            "{} has other offsets of the sequence {} than the capture. To keep them, give this file as the capture; "
            "to lose them, delete the file or choose another --out",
            out.string(), sequence.name);
}

int run_sync(const SyncArguments& arguments, const CommonOptions& common) {
  RigFootage footage = open_rig_footage(arguments.capture, arguments.sequence);
  const std::filesystem::path out =
      arguments.out.empty() ? folder_of(footage.capture) / "capture_synced.yaml" : std::filesystem::path(arguments.out);
  check_sync_out(out, footage);
  SynchroniseOptions options;
  options.window = arguments.window;
  options.drift = arguments.drift;
  const std::vector<Camera>& cameras = footage.filmed.cameras;
  const auto named = std::find_if(cameras.begin(), cameras.end(),
                                  [&](const Camera& camera) { return camera.name == arguments.reference; });
  if (!arguments.reference.empty() && named == cameras.end())
    fail<UsageError>("{} has no camera {} to keep as it is", arguments.capture, arguments.reference);
  if (named != cameras.end()) options.reference = static_cast<int>(named - cameras.begin());
  Synchronisation timing;
  if (arguments.audio) {
    timing = synchronise_by_sound(footage, options.reference);
  } else {
    read_tracks(footage);
    const auto outlines = arguments.points_only ? std::vector<OutlineTrack>() : read_first_outlines(footage);
    timing = synchronise(cameras, footage.tracks, options, outlines);
    if (!arguments.drift) keep_insignificant(timing, footage);
  }
  const Capture mended = with_timing(footage, timing, arguments.drift && !arguments.audio);
  write_capture(
      out, mended,
      {fmt::format("Written by `doppel calibrate sync`: frame_offset of sequence {}.", footage.entry().name)});
  if (common.json) {
    std::printf("%s\n", json_of(timing, footage, out.string()).dump(2).c_str());
    return 0;
  }
  print_table(timing, arguments.audio);
  if (!arguments.audio)
    std::printf("median distance of points from their epipolar lines: %.2f px before, %.2f px after\n", timing.before,
                timing.after);
  std::printf("written: %s\n", out.string().c_str());
  return 0;
}

}  // namespace

Command add_calibrate_sync(CLI::App& calibrate) {
  CLI::App* app = calibrate.add_subcommand(
      "sync", "Find the frame offsets of a capture's cameras by the person's motion or by sound");
  app->fallthrough();
  auto arguments = std::make_shared<SyncArguments>();
  app->add_option("capture", arguments->capture, "capture.yaml, or a folder that is recognised as a capture")
      ->required();
  app->add_option("--sequence", arguments->sequence, "Sequence to synchronise (default: the first with keypoints)");
  app->add_option("--reference", arguments->reference, "Camera whose offset is kept (default: the first)");
  app->add_option("--window", arguments->window, "Largest change of an offset, in frames of the slower camera")
      ->capture_default_str();
  app->add_flag("--drift", arguments->drift, "Also find the frame rates (not with --audio)");
  app->add_flag("--points-only", arguments->points_only, "Use the keypoints alone, not the outlines of the masks");
  app->add_flag("--audio", arguments->audio, "By the sound of the videos; needs the program ffmpeg");
  app->add_option("--out", arguments->out, "capture.yaml to write (default: capture_synced.yaml beside the old one)");
  app->footer("Example: doppel calibrate sync recordings/anna --drift");
  return {app, [arguments](const CommonOptions& common) { return run_sync(*arguments, common); }};
}

}  // namespace doppel::tools
