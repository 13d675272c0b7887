#include "doppel/track/live/network_finder.h"

#include <memory>

#include "doppel/data/capture/evidence.h"
#include "doppel/detect/blazepose/body_detector.h"

namespace doppel {

namespace {

constexpr std::size_t kLeftHip = 23, kRightHip = 24;

NetworkPerson person_of(const BodyPose& pose) {
  NetworkPerson found;
  Person person;
  const Eigen::Vector3d root = 0.5 * (pose.world[kLeftHip] + pose.world[kRightHip]);
  for (std::size_t i = 0; i < pose.landmarks.size(); ++i) {
    const BodyLandmark& point = pose.landmarks[i];
    person.push_back(
        {static_cast<float>(point.x), static_cast<float>(point.y), static_cast<float>(landmark_confidence(pose, i))});
    found.joints.push_back({pose.world[i] - root, true, kBlazePoseJointNoise});
  }
  found.people.push_back(std::move(person));
  found.mask = pose.mask;
  return found;
}

/// A detector and the tracker that refers to it.
struct BlazePose {
  explicit BlazePose(BlazePoseModel model)
      : detector({.model = model, .threads = 1, .masks = true, .mirror = false, .models = {}}) {}

  BodyDetector detector;
  BodyTracker tracker{detector};
};

}  // namespace

NetworkFinder detector_finder(const Capture& capture, const PointLayout& layout) {
  const auto detector = std::make_shared<PoseDetector>(open_detector(capture, layout));
  return [detector](const cv::Mat& image) {
    NetworkPerson found;
    found.people = detector->detect(image);
    found.mask = detector->mask();
    return found;
  };
}

NetworkFinder blazepose_finder(BlazePoseModel model) {
  const auto blazepose = std::make_shared<BlazePose>(model);
  return [blazepose](const cv::Mat& image) {
    const std::optional<BodyPose> pose = blazepose->tracker.track(image);
    return pose ? person_of(*pose) : NetworkPerson();
  };
}

Capture with_blazepose(Capture capture) {
  capture.keypoint_map = "mediapipe33";
  capture.detector.emplace();  // points in the order of the map, as those of any detector
  return capture;
}

}  // namespace doppel
