#include "doppel/detect/blazepose/body_detector.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/network_edits.h"
#include "doppel/detect/blazepose/network_input.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/tflite_model.h"

namespace doppel {

namespace {

constexpr float kMinPresence = 0.5f;
constexpr std::size_t kLeftHip = 23, kRightHip = 24;

/// The outputs of the landmark network in the order of use: the mask is the last one, so that it can be left out.
enum LandmarkOutput : std::size_t { kPoints, kPresence, kHeatmaps, kWorld, kMaskLogits };
/// The same in the order of the file.
const std::vector<std::size_t> kLandmarkOutputIndices = {0, 1, 3, 4, 2};

NetworkModel read_network(const PackageFile& file, const std::filesystem::path& folder,
                          const std::vector<TensorShape>& expected) {
  return require_tensors(read_tflite(find_model(file, folder)), expected, "this network of BlazePose");
}

NetworkModel read_detector(const std::filesystem::path& folder) {
  return read_network(
      kDetectorFile, folder,
      {{1, kDetectorPixels, kDetectorPixels, 3}, {1, kDetectorAnchors, kDetectorValues}, {1, kDetectorAnchors, 1}});
}

/// @param with_mask otherwise the part of the network that computes the mask is left out
NetworkModel read_landmarks(BlazePoseModel model, const std::filesystem::path& folder, bool with_mask) {
  const NetworkModel network = read_network(landmark_file(model), folder,
                                            {{1, kRoiPixels, kRoiPixels, 3},
                                             {1, 5 * kNetworkPoints},
                                             {1, 1},
                                             {1, kRoiPixels, kRoiPixels, 1},
                                             {1, kHeatmapPixels, kHeatmapPixels, kNetworkPoints},
                                             {1, 3 * kNetworkPoints}});
  std::vector<std::size_t> outputs = kLandmarkOutputIndices;
  if (!with_mask) outputs.pop_back();
  return keep_outputs(network, outputs);
}

}  // namespace

struct BodyDetector::Impl {
  Impl(const BodyDetectorOptions& options, const std::filesystem::path& folder)
      : masks(options.masks),
        boxes(read_detector(folder), options.threads),
        landmarks(read_landmarks(options.model, folder, options.masks), options.threads) {
    if (options.mirror) mirrored.emplace(read_landmarks(options.model, folder, false), options.threads);
  }

  /// The pose of the person in one region. @return as read_pose
  std::optional<BodyPose> read(const cv::Mat& image, const BodyRoi& roi) {
    std::optional<BodyPose> pose = read(landmarks, image, roi);
    if (pose && masks) pose->mask = draw_person_mask(landmarks.output(kMaskLogits), roi, image.size());
    if (!pose || !mirrored) return pose;
    BodyRoi in_mirror = roi;
    in_mirror.mirrored = true;
    const std::optional<BodyPose> other = read(*mirrored, image, in_mirror);
    return other ? mean_pose(*pose, *other) : pose;
  }

  /// The same without a mask.
  static std::optional<BodyPose> read(Network& landmarks, const cv::Mat& image, const BodyRoi& roi) {
    sample_roi(image, roi, kRoiPixels, landmarks.input());
    landmarks.run();
    const LandmarkOutputs outputs{landmarks.output(kPoints), landmarks.output(kHeatmaps), landmarks.output(kWorld),
                                  landmarks.output(kPresence)[0]};
    if (!(outputs.presence > kMinPresence) || !all_finite(outputs.points) || !all_finite(outputs.world))
      return std::nullopt;
    return decode_pose(outputs, roi);
  }

  bool masks;
  Network boxes, landmarks;
  std::optional<Network> mirrored;  ///< `landmarks` without masks, which a second look hardly improves
};

BodyDetector::BodyDetector(const BodyDetectorOptions& options)
    : impl_(std::make_unique<Impl>(options, options.models.empty() ? models_folder() : options.models)) {}
BodyDetector::~BodyDetector() = default;
BodyDetector::BodyDetector(BodyDetector&&) noexcept = default;
BodyDetector& BodyDetector::operator=(BodyDetector&&) noexcept = default;

std::vector<BodyBox> BodyDetector::find_boxes(const cv::Mat& image) {
  require_image(image);
  Network& network = impl_->boxes;
  sample_letterbox(image, kDetectorPixels, network.input());
  network.run();
  std::vector<BodyBox> boxes = merge_boxes(decode_boxes(network.output(0), network.output(1)));
  for (BodyBox& box : boxes) box = box_in_image(box, image.size());
  return boxes;
}

std::optional<BodyPose> BodyDetector::read_pose(const cv::Mat& image, const BodyRoi& roi) {
  require_image(image);
  if (!roi.valid()) return std::nullopt;
  return impl_->read(image, roi);
}

std::optional<BodyPose> BodyDetector::detect(const cv::Mat& image) {
  const std::vector<BodyBox> boxes = find_boxes(image);
  return boxes.empty() ? std::nullopt : read_pose(image, roi_of_box(boxes[0]));
}

std::vector<BodyPose> BodyDetector::detect_all(const cv::Mat& image) {
  std::vector<BodyPose> people;
  for (const BodyBox& box : find_boxes(image)) {
    if (auto pose = read_pose(image, roi_of_box(box))) people.push_back(std::move(*pose));
  }
  return people;
}

BodyRoi roi_of_box(const BodyBox& box) { return body_roi(box.keypoints[0], box.keypoints[1]); }

Eigen::Vector2d hips_of(const BodyPose& pose) {
  const BodyLandmark &left = pose.landmarks[kLeftHip], &right = pose.landmarks[kRightHip];
  return {0.5 * (left.x + right.x), 0.5 * (left.y + right.y)};
}

BodyTracker::BodyTracker(BodyDetector& detector, const std::optional<Eigen::Vector2d>& hint)
    : detector_(&detector), position_(hint) {}

std::optional<BodyPose> BodyTracker::track(const cv::Mat& image, const std::optional<PersonAnchor>& known) {
  std::optional<BodyPose> pose;
  const bool hidden = known && !known->visible;
  if (roi_ && !hidden) pose = detector_->read_pose(image, *roi_);
  if (pose && known && !known->holds(hips_of(*pose))) pose.reset();
  if (!pose && !hidden) pose = find_again(image, known);
  roi_.reset();
  if (!pose) return pose;
  roi_ = pose->next_roi;
  position_ = pose->next_roi.centre;
  return pose;
}

std::optional<BodyPose> BodyTracker::find_again(const cv::Mat& image, const std::optional<PersonAnchor>& known) {
  if (known) position_ = known->hips;
  std::vector<BodyBox> boxes = detector_->find_boxes(image);
  const auto distance = [&](const BodyBox& box) { return (box.keypoints[0] - *position_).norm(); };
  if (position_) {
    std::stable_sort(boxes.begin(), boxes.end(),
                     [&](const BodyBox& a, const BodyBox& b) { return distance(a) < distance(b); });
  }
  for (const BodyBox& box : boxes) {
    auto pose = detector_->read_pose(image, roi_of_box(box));
    if (pose && (!known || known->holds(hips_of(*pose)))) return pose;
  }
  return std::nullopt;
}

}  // namespace doppel
