#pragma once

/// Networks that find the person in live images.

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/detect/blazepose/model_files.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// What a network finds in one image. Pixels of the image as filmed, with lens distortion.
struct NetworkPerson {
  People people;                       ///< one person or nobody, in the layout of the capture's keypoint map
  cv::Mat mask;                        ///< 8-bit, probability * 255; empty when the network finds no masks
  std::vector<JointDetection> joints;  ///< [n] in the same layout; empty when the network finds none
};

/// Is called with the images in their order. @param image 8-bit BGR
using NetworkFinder = std::function<NetworkPerson(const cv::Mat& image)>;

/// The capture's `detector`. @pre the capture has one @throws as open_detector
NetworkFinder detector_finder(const Capture& capture, const PointLayout& layout);

/// MediaPipe's BlazePose: points in the layout `mediapipe33`, 3D joints and masks, one thread.
/// @throws as BodyDetector
NetworkFinder blazepose_finder(BlazePoseModel model);

/// A capture whose keypoints come from BlazePose instead of its own files.
Capture with_blazepose(Capture capture);

}  // namespace doppel
