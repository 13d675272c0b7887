#include "doppel/data/prepare/prepare_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/template_check.h"
#include "doppel/data/capture/video.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/networks/network_config.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr double kMinPersonHeight = 0.5, kMaxPersonHeight = 2.5;        // metres
constexpr double kMinCameraDistance = 0.3, kMaxCameraDistance = 100.0;  // metres
constexpr int kPosesLookedAt = 8;

/// The number of frames that all cameras have: the rows of a sequence without a motion.
long count_frames(const PreparePlan& plan, const SequenceEntry& entry) {
  long rows = std::numeric_limits<long>::max(), expected = entry.last_frame.value_or(-1) + 1;
  for (std::size_t c = 0; c < plan.cameras.size(); ++c) {
    const auto videos = open_frames(plan.source(entry.videos, static_cast<int>(c)), PixelFormat::colour);
    const long frames = videos->num_frames(expected);
    rows = std::min(rows, plan.capture.clock(entry, plan.cameras[c].name).num_rows(frames));
    if (!entry.last_frame) expected = frames;
  }
  return rows;
}

/// Chooses the rows to prepare. @param rows number of rows @param what source of this number, for messages
void choose_rows(PlannedSequence& sequence, long rows, const std::string& what, const PrepareOptions& options) {
  const SequenceEntry& entry = sequence.entry;
  sequence.first_frame = entry.first_frame;
  sequence.last_frame = entry.last_frame.value_or(rows - 1);
  if (sequence.first_frame > sequence.last_frame || sequence.last_frame >= rows)
    fail("sequence {}: rows {} to {} are requested, but {} rows 0 to {}", entry.name, sequence.first_frame,
         sequence.last_frame, what, rows - 1);
  for (const long cut : entry.cuts)
    if (cut >= rows) fail("sequence {}: it has a cut at row {}, but {} rows 0 to {}", entry.name, cut, what, rows - 1);
  if (options.limit_frames > 0)
    sequence.last_frame = std::min(sequence.last_frame, sequence.first_frame + options.limit_frames - 1);
}

void plan_sequences(PreparePlan& plan, const PrepareOptions& options) {
  for (const SequenceEntry& entry : plan.capture.sequences) {
    PlannedSequence sequence;
    sequence.entry = entry;
    if (entry.motion.empty()) {
      log::info("sequence {}: no motion is named; commands that need poses cannot use it before `doppel track`",
                entry.name);
      choose_rows(sequence, count_frames(plan, entry), "its videos have", options);
    } else {
      sequence.motion = read_motion(plan.capture.resolve(entry.motion), plan.character.num_dofs());
      choose_rows(sequence, sequence.motion.num_frames(), fmt::format("the motion {} has", entry.motion), options);
    }
    plan.sequences.push_back(std::move(sequence));
  }
}

std::string describe_clock(const FrameClock& clock) {
  if (clock.rate != 1.0) return fmt::format(" ({:.6g} frames per row, frame_offset {})", clock.rate, clock.offset);
  return clock.offset == 0.0 ? "" : fmt::format(" (frame_offset {})", clock.offset);
}

/// The frame count of one source.
void check_count(const PlannedSequence& sequence, const FrameClock& clock, const std::string& camera, const char* what,
                 FrameReader& reader) {
  const long rows = sequence.has_motion() ? sequence.motion.num_frames() : sequence.last_frame + 1;
  const long frames = reader.num_frames(rows);
  const long first = clock.frame(sequence.first_frame), last = clock.frame(sequence.last_frame);
  const std::string shift = describe_clock(clock);
  if (first < 0)
    fail("sequence {}, camera {}: row {} would be frame {} of the {}{}; set first_frame to {} or more",
         sequence.entry.name, camera, sequence.first_frame, first, what, shift,
         static_cast<long>(std::ceil((-0.5 - clock.offset) / clock.rate)));
  if (last >= frames)
    fail(
        "sequence {}, camera {}: the {} {} has {} frames, but rows {} to {} need frames up to {}{}; if only a "
        "part "
        "belongs together, say so with first_frame and last_frame",
        sequence.entry.name, camera, what, reader.source(), frames, sequence.first_frame, sequence.last_frame, last,
        shift);
  // Where rows lie between frames, the last frames may have no row of their own.
  const long surplus = std::abs(clock.num_rows(frames) - rows);
  const bool agrees =
      surplus == 0 || (!clock.is_whole() && static_cast<double>(surplus) <= std::ceil(1.0 / clock.rate));
  if (sequence.has_motion() && !sequence.entry.last_frame && frames != rows && !agrees)
    fail(
        "sequence {}, camera {}: the {} {} has {} frames, the motion {} rows{}; they must agree. If the surplus does "
        "not belong to it, set last_frame: {}",
        sequence.entry.name, camera, what, reader.source(), frames, rows, shift,
        std::min(rows, clock.num_rows(frames)) - 1);
}

void check_mask_size(const PlannedSequence& sequence, const Camera& camera, FrameReader& masks) {
  const cv::Size size = masks.size();
  const double ratio = (static_cast<double>(size.width) / size.height) * camera.height / camera.width;
  if (std::abs(ratio - 1.0) > 0.01)
    fail("sequence {}, camera {}: the masks {} are {}x{} pixels, the video {}x{}; their aspect ratios must agree",
         sequence.entry.name, camera.name, masks.source(), size.width, size.height, camera.width, camera.height);
}

/// Opens every source once; checks sizes and counts, and adds a line of settings for each.
void inspect_sources(PreparePlan& plan) {
  std::vector<bool> sized(plan.cameras.size(), false);
  for (const PlannedSequence& sequence : plan.sequences)
    for (std::size_t c = 0; c < plan.cameras.size(); ++c) {
      const int index = static_cast<int>(c);
      Camera& camera = plan.cameras[c];
      const FrameClock clock = plan.capture.clock(sequence.entry, camera.name);
      const auto videos = open_frames(plan.source(sequence.entry.videos, index), PixelFormat::colour);
      check_count(sequence, clock, camera.name, "video", *videos);
      const Camera fitted = fit_to_images(camera, videos->size(), videos->source());
      if (sized[c] && (fitted.width != camera.width || fitted.height != camera.height))
        fail("camera {}: the video {} has another resolution than the sequences before; use one resolution",
             camera.name, videos->source());
      camera = fitted;
      sized[c] = true;
      if (sequence.entry.masks_from_images()) continue;
      const auto masks = open_masks(plan.capture, sequence.entry, camera.name, plan.file_index[c], PixelFormat::grey);
      check_count(sequence, clock, camera.name, "mask video", *masks);
      check_mask_size(sequence, camera, *masks);
    }
}

void check_character(const PreparePlan& plan, const PrepareOptions& options) {
  Eigen::Vector3d low = plan.character.mesh.vertices.at(0), high = low;
  for (const Eigen::Vector3d& vertex : plan.character.mesh.vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const double size = (high - low).maxCoeff();
  if (size >= kMinPersonHeight && size <= kMaxPersonHeight) return;
  stop_or_warn(
      options,
      fmt::format("the character {} measures {:.4g} m, which no person does (allowed: {} to {} m); Skeletool's "
                  "files count in millimetres: check the units of the mesh",
                  plan.capture.character, size, kMinPersonHeight, kMaxPersonHeight));
}

/// A few poses spread over all sequences.
std::vector<Eigen::Matrix3Xf> some_poses(const PreparePlan& plan, TemplateChecker& checker) {
  std::vector<Eigen::Matrix3Xf> poses;
  for (const PlannedSequence& sequence : plan.sequences)
    for (int i = 0; sequence.has_motion() && i < kPosesLookedAt; ++i)
      poses.push_back(checker.skin(
          sequence.motion.frames.at(sequence.first_frame + i * (sequence.num_frames() - 1) / kPosesLookedAt)));
  return poses;
}

void check_camera(const Camera& camera, const std::vector<Eigen::Matrix3Xf>& poses, const PrepareOptions& options) {
  CameraView best;
  for (const Eigen::Matrix3Xf& pose : poses) {
    const CameraView view = look_at(pose, camera);
    best.distance = view.distance;
    best.share_in_front = std::max(best.share_in_front, view.share_in_front);
    best.share_in_image = std::max(best.share_in_image, view.share_in_image);
  }
  if (best.distance < kMinCameraDistance || best.distance > kMaxCameraDistance)
    stop_or_warn(
        options,
        fmt::format("camera {} is {:.4g} m from the person (allowed: {} to {} m); the calibration is probably "
                    "in other units than its format says (Skeletool files: millimetres; OpenCV files: metres, or "
                    "`units: millimetres`)",
                    camera.name, best.distance, kMinCameraDistance, kMaxCameraDistance));
  if (best.share_in_front == 0.0)
    stop_or_warn(options,
                 fmt::format("camera {} looks away from the person: the posed template is behind it at all times; "
                             "the extrinsics must map world to camera, with z forward (OpenCV)",
                             camera.name));
  else if (best.share_in_image == 0.0)
    stop_or_warn(options,
                 fmt::format("camera {} never sees the person: the posed template lies outside of its images at all "
                             "times; check its extrinsics and the motion's units",
                             camera.name));
}

/// Reads the tables of joints to report errors early. They are read again where they are used.
void check_joints(const PreparePlan& plan) {
  for (const PlannedSequence& sequence : plan.sequences) {
    if (sequence.entry.joints3d.empty()) continue;
    if (plan.evidence.landmarks.empty())
      fail(
          "sequence {}: `joints3d` are put on landmarks through the keypoint map; the capture has none, because no "
          "sequence names `keypoints`",
          sequence.entry.name);
    for (std::size_t c = 0; c < plan.cameras.size(); ++c) {
      const std::string table = plan.source(sequence.entry.joints3d, static_cast<int>(c));
      const auto frames = read_joint_detections(table, plan.evidence.map.layout);
      if (frames.empty())
        log::info("sequence {}, camera {}: no joints in space", sequence.entry.name, plan.cameras[c].name);
      else
        log::info("sequence {}, camera {}: joints in space for {} frames, {} to {}", sequence.entry.name,
                  plan.cameras[c].name, frames.size(), frames.begin()->first, frames.rbegin()->first);
    }
  }
}

std::string describe_sequence(const PlannedSequence& sequence) {
  const SequenceEntry& entry = sequence.entry;
  std::string key = "none";
  if (const auto& chroma = entry.chroma_key)
    key = fmt::format("{} {} {},{},{} {} {} {}", chroma->space == ChromaKey::Space::hsv ? "hsv" : "ycrcb",
                      chroma->against_background ? "background" : "colour", chroma->colour[0], chroma->colour[1],
                      chroma->colour[2], chroma->tolerance, chroma->min_saturation, chroma->smooth);
  // Empty without subtraction, so that captures prepared by versions without it still match.
  std::string subtracted;
  if (const auto& subtraction = entry.subtraction)
    subtracted =
        fmt::format(", empty scene {} {} to {}, threshold {}, shadow {}, refine {}", subtraction->empty.to_string(),
                    subtraction->first_frame, subtraction->last_frame.value_or(-1), subtraction->model.threshold,
                    subtraction->model.shadow, subtraction->model.refine);
  return fmt::format("sequence {}: rows {} to {}, mask threshold {}, largest component {}, chroma key {}{}\n",
                     entry.name, sequence.first_frame, sequence.last_frame, entry.mask_threshold,
                     entry.largest_component, key, subtracted);
}

/// Name and size of a source, to detect that the files were replaced.
std::string describe_source(const std::string& source) {
  std::error_code missing;  // who opens the file tells that it does not exist
  if (!has_frame_placeholder(source) && !fs::is_directory(source))
    return fmt::format("{} ({} bytes)", source, fs::file_size(source, missing));
  std::uintmax_t bytes = 0;
  std::size_t files = 0;
  const auto add = [&](const fs::path& file) {
    bytes += fs::file_size(file, missing);
    ++files;
  };
  if (fs::is_directory(source)) {
    for (const auto& entry : fs::directory_iterator(source))
      if (entry.is_regular_file()) add(entry.path());
  } else {
    for (const long frame : frames_of_pattern(source)) add(expand_pattern(source, 0, "", frame));
  }
  return fmt::format("{} ({} files, {} bytes)", source, files, bytes);
}

/// The images of the empty studio or scene that the masks of a camera are computed with; empty when there are none.
std::string describe_empty_scene(const PreparePlan& plan, const SequenceEntry& entry, int camera) {
  if (entry.chroma_key && entry.chroma_key->against_background && !plan.capture.background.empty())
    return ", background " + describe_source(plan.source(plan.capture.background, camera));
  if (entry.subtraction && !entry.subtraction->empty.empty())
    return ", empty scene " + describe_source(plan.source(entry.subtraction->empty, camera));
  return "";
}

/// The coefficients of a lens. Those that few lenses have are left out where they are 0.
std::string describe_lens(const Camera& camera) {
  const auto& all = camera.distortion;
  std::string text = fmt::format("{}", fmt::join(all.begin(), all.begin() + 8, " "));
  if (std::any_of(all.begin() + 8, all.end(), [](double k) { return k != 0; }))
    text += fmt::format(" {}", fmt::join(all.begin() + 8, all.end(), " "));
  if (camera.lens == Lens::fisheye) text += ", fisheye";
  if (camera.lens == Lens::polynomial) text += ", polynomial";
  return text;
}

std::string describe_settings(const PreparePlan& plan, const PrepareOptions& options) {
  std::string text = fmt::format("mask size {}\nimage size {}\nmargin {}\njpeg quality {}\n", options.mask_size,
                                 options.image_size, options.margin, options.jpeg_quality);
  for (std::size_t c = 0; c < plan.cameras.size(); ++c) {
    const Camera& camera = plan.cameras[c];
    text += fmt::format("camera {}: {}x{}, distortion {}, projection {:.9g}\n", camera.name, camera.width,
                        camera.height, describe_lens(camera), fmt::join(camera.projection().reshaped(), " "));
  }
  for (const PlannedSequence& sequence : plan.sequences) {
    text += describe_sequence(sequence);
    for (std::size_t c = 0; c < plan.cameras.size(); ++c) {
      const int index = static_cast<int>(c);
      const FrameClock clock = plan.capture.clock(sequence.entry, plan.cameras[c].name);
      text += fmt::format("sequence {}, camera {}: offset {}, video {}", sequence.entry.name, plan.cameras[c].name,
                          clock.offset, describe_source(plan.source(sequence.entry.videos, index)));
      if (clock.rate != 1.0) text += fmt::format(", {} frames per row", clock.rate);
      if (!sequence.entry.masks_from_images())
        text += ", masks " + describe_source(plan.source(sequence.entry.masks, index));
      if (const long offset = sequence.entry.mask_offset_of(plan.cameras[c].name); offset != 0)
        text += fmt::format(" from number {} on", offset);
      text += describe_empty_scene(plan, sequence.entry, index);
      text += "\n";
    }
  }
  return text;
}

std::string describe_detector(const Capture& capture) {
  PersonNetworkOptions options = *capture.detector;
  std::string files;
  for_each_network(options, [&](NetworkOptions& network) {
    for (const fs::path& path : {network.model, network.weights}) {
      if (path.empty()) continue;
      const fs::path found = capture.resolve(path.string());
      if (!fs::is_regular_file(found)) fail_at({found, 0}, "the detector's file does not exist");
      files += " " + describe_source(found.string());
    }
  });
  YAML::Emitter settings;
  settings.SetMapFormat(YAML::Flow);
  settings << person_network_node(options);
  return fmt::format("detected by{}, {}", files, settings.c_str());
}

std::string describe_paths(const Capture& capture, const CameraPaths& paths) {
  return paths.by_camera().empty() ? capture.resolve(paths.sample()).string() : paths.to_string();
}

/// Empty if nobody is named, so that captures prepared by versions without this choice still match.
std::string describe_person(const PersonChoiceOptions& options) {
  if (options.person) return fmt::format(", person {}", *options.person);
  if (!options.near) return "";
  return fmt::format(", person near {} {} {}", options.near->x(), options.near->y(), options.near->z());
}

/// Empty without keypoints, so that captures prepared by versions without them still match.
std::string describe_evidence(const PreparePlan& plan) {
  std::string text;
  if (plan.evidence.landmarks.empty()) return text;
  for (const Marker& landmark : plan.evidence.landmarks)
    text += fmt::format("landmark {}: joint {}, position {} {} {}, points {} of {}\n", landmark.name, landmark.joint,
                        landmark.position.x(), landmark.position.y(), landmark.position.z(),
                        fmt::join(plan.evidence.map.find(landmark.name)->points, " "), plan.evidence.map.layout.name);
  const KeypointFilter& filter = plan.capture.keypoint_filter;
  text +=
      fmt::format("keypoint filter: window {}, outlier {}, sigma {}\n", filter.window, filter.outlier, filter.sigma);
  for (const PlannedSequence& sequence : plan.sequences)
    text += fmt::format("sequence {}: keypoints {}, cuts {}{}\n", sequence.entry.name,
                        plan.detects(sequence) ? describe_detector(plan.capture)
                                               : describe_paths(plan.capture, sequence.entry.keypoints),
                        fmt::join(sequence.entry.cuts, " "), describe_person(plan.capture.person_of(sequence.entry)));
  return text;
}

StoreLayout make_layout(const PreparePlan& plan, const PrepareOptions& options) {
  StoreLayout layout;
  layout.settings = describe_settings(plan, options) + describe_evidence(plan);
  layout.landmarks = plan.evidence.landmarks;
  layout.num_dofs = plan.character.num_dofs();
  layout.skeleton = fingerprint_of(plan.character.skeleton);
  layout.mask_size = options.mask_size;
  layout.image_size = options.image_size;
  layout.file_index = plan.file_index;
  for (const Camera& camera : plan.cameras) layout.cameras.push_back(Undistorter(camera).pinhole());
  return layout;
}

}  // namespace

std::string PreparePlan::source(const CameraPaths& paths, int camera) const {
  return capture.source(paths, file_index.at(camera), cameras.at(camera).name);
}

std::string PreparePlan::detected_table(const PlannedSequence& sequence, const fs::path& out) {
  return (fs::absolute(out).lexically_normal() / "detected" / (sequence.entry.name + "_{name}.csv")).string();
}

void stop_or_warn(const PrepareOptions& options, const std::string& sentence) {
  if (!options.force) fail("{} (--force continues with a warning)", sentence);
  log::warn("{}", sentence);
}

PreparePlan plan_preparation(const Capture& capture, const PrepareOptions& options) {
  PreparePlan plan;
  plan.capture = capture;
  for (const SequenceEntry& sequence : capture.sequences) sequence.require_masks("`doppel prepare`");
  plan.character = load_character(capture.character_path());
  check_character(plan, options);
  CaptureCameras chosen = choose_cameras(capture);
  plan.cameras = std::move(chosen.cameras);
  plan.file_index = std::move(chosen.file_index);
  plan.evidence = plan_evidence(capture, plan.character);
  plan_sequences(plan, options);
  inspect_sources(plan);
  TemplateChecker checker(plan.character);
  const std::vector<Eigen::Matrix3Xf> poses = some_poses(plan, checker);
  for (const Camera& camera : plan.cameras)
    if (!poses.empty()) check_camera(camera, poses, options);
  check_joints(plan);
  plan.layout = make_layout(plan, options);
  return plan;
}

}  // namespace doppel
