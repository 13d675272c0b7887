#include "doppel/track/live/live_view.h"

#include <fmt/ranges.h>

#include "doppel/core/error.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/detect/keypoints/keypoint_source.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

SequenceEntry find_entry(const Capture& capture, const std::string& name) {
  std::vector<std::string> known;
  for (const SequenceEntry& entry : capture.sequences) {
    if (name.empty() || entry.name == name) return entry;
    known.push_back(entry.name);
  }
  fail<UsageError>("there is no sequence {} in the capture; it has {}", name, fmt::join(known, ", "));
}

/// The camera of the images, at their size.
CaptureCameras find_camera(Capture capture, const std::string& name, cv::Size images) {
  if (!name.empty()) capture.cameras = {name};
  CaptureCameras chosen = choose_cameras(capture);
  if (chosen.cameras.size() != 1) {
    std::vector<std::string> names;
    for (const Camera& camera : chosen.cameras) names.push_back(camera.name);
    fail<UsageError>("the images come from one camera, and the capture has {}; choose it with --camera: {}",
                     names.size(), fmt::join(names, ", "));
  }
  chosen.cameras.front() = fit_to_images(chosen.cameras.front(), images, "--source");
  return chosen;
}

/// The finder of keypoints in files. @return nothing when the sequence names none, or they belong to other images
PeopleFinder people_finder(const Capture& capture, const SequenceEntry& entry, const PointLayout& layout,
                           const CaptureCameras& filmed, const LiveViewOptions& options) {
  if (entry.keypoints.empty() || options.from_camera || options.blazepose) return {};
  const Camera& camera = filmed.cameras.front();
  const int index = filmed.file_index.front();
  const auto source =
      std::make_shared<KeypointSource>(capture.source(entry.keypoints, index, camera.name), layout,
                                       keypoint_camera(camera, index), entry.keypoint_offset_of(camera.name));
  return [source](const SourceImage& image) { return source->people(image.frame); };
}

NetworkFinder network_finder(const Capture& capture, const PointLayout& layout, const LiveViewOptions& options) {
  if (options.blazepose) return blazepose_finder(*options.blazepose);
  if (!capture.detector)
    fail<UsageError>(
        "nothing finds the keypoints of these images: {} names no `detector`{} (docs/capture.md says how to add one), "
        "and --detect, which finds them without one, is not given",
        capture.name, options.from_camera ? "" : ", and its sequence no `keypoints`");
  return detector_finder(capture, layout);
}

/// Whether masks come from the network: BlazePose, or a detector with a `mask` where the capture has no masks.
bool network_has_masks(const Capture& capture, const SequenceEntry& entry, const LiveViewOptions& options) {
  if (options.blazepose) return true;
  const bool own = options.from_camera ? entry.masks_from_images() : entry.has_masks();
  return !own && capture.detector && capture.detector->mask;
}

}  // namespace

LiveView::LiveView(const fs::path& capture, cv::Size images, const LiveViewOptions& options)
    : capture_(options.blazepose ? with_blazepose(find_capture(capture)) : find_capture(capture)),
      character_(load_character(capture_.character_path())),
      plan_(plan_evidence(capture_, character_)),
      options_(options),
      entry_(find_entry(capture_, options.sequence)),
      filmed_(find_camera(capture_, options.camera, images)),
      undistort_(filmed_.cameras.front()),
      picker_(plan_.map, plan_.landmarks),
      people_(people_finder(capture_, entry_, plan_.map.layout, filmed_, options)),
      cutter_(entry_, filmed_.cameras.front()) {
  if (!people_) {
    network_ = network_finder(capture_, plan_.map.layout, options);
    network_masks_ = network_has_masks(capture_, entry_, options);
  }
  if (!entry_.joints3d.empty() && !options.from_camera && !options.blazepose)
    joint_table_ = read_joint_detections(capture_.source(entry_.joints3d, filmed_.file_index.front(), camera().name),
                                         plan_.map.layout);
}

void LiveView::learn_empty_scene(const std::vector<cv::Mat>& images) {
  if (images.empty()) fail("the source delivered no image of the empty scene");
  BackgroundModel model(entry_.subtraction ? entry_.subtraction->model : BackgroundOptions());
  for (const cv::Mat& image : images) model.learn(image);
  masks_.emplace(std::move(model), entry_, filmed_.cameras.front());
}

void LiveView::open_masks(long frame) {
  // Files of masks are read forwards only. They are opened again when the images start again.
  const bool again = masks_ && !masks_->needs_image() && frame <= last_frame_;
  last_frame_ = frame;
  if (masks_ && !again) return;
  if (options_.from_camera && !entry_.masks_from_images())
    fail<UsageError>(
        "nothing cuts the person out of these images: name `background_subtraction` with images of the `empty` "
        "scene in {}, or film the empty scene first (--empty-frames 25)",
        capture_.name);
  entry_.require_masks("live tracking");
  masks_.emplace(capture_, entry_, filmed_.cameras.front(), filmed_.file_index.front());
}

void LiveView::look(const cv::Mat& image, const std::function<cv::Mat()>& mask, FootageFrame& seen) const {
  NetworkPerson found = network_(image);
  seen.evidence.front().keypoints = pick_person(std::move(found.people), mask, picker_, undistort_);
  seen.joints = {found.joints.empty() ? std::vector<JointDetection>() : picker_.pick(found.joints)};
  if (masks_by_network()) seen.masks = {found.mask.empty() ? cv::Mat(image.size(), CV_8U, cv::Scalar(0)) : found.mask};
}

FootageFrame LiveView::preprocess(const SourceImage& image) {
  FootageFrame seen;
  seen.evidence.emplace_back();
  if (masks_by_network()) {
    // One person at most, so no mask is needed to choose.
    const auto no_mask = [] { return cv::Mat(); };
    look(image.image, no_mask, seen);
  } else {
    open_masks(image.frame);
    seen.masks.push_back(masks_->read(image.frame, image.image));
    seen.evidence.front().outline = OutlineField(seen.masks.front(), options_.outline_pixels);
  }
  seen.images.push_back(undistort_.apply(image.image));
  return seen;
}

void LiveView::detect(const SourceImage& image, FootageFrame& seen) const {
  const auto mask = [&] { return seen.masks.front(); };
  if (masks_by_network()) {
    seen.masks.front() = cutter_.cut(seen.masks.front());
    seen.evidence.front().outline = OutlineField(seen.masks.front(), options_.outline_pixels);
  } else if (people_) {
    seen.evidence.front().keypoints = pick_person(people_(image), mask, picker_, undistort_);
  } else {
    look(image.image, mask, seen);
  }
  if (joint_finder_ || seen.joints.empty() || seen.joints.front().empty()) seen.joints = {joints(image.frame, seen)};
}

std::vector<JointDetection> LiveView::joints(long frame, const FootageFrame& seen) const {
  if (joint_finder_) return joint_finder_(seen);
  const auto found = joint_table_.find(frame);
  return found == joint_table_.end() ? std::vector<JointDetection>{} : picker_.pick(found->second);
}

}  // namespace doppel
