#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>

#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/face/face_pose.h"

namespace doppel {

/// Reads the face in a region of an image: `FaceDetector::read_face`.
using FaceReader = std::function<std::optional<FacePose>(const cv::Mat& image, const BodyRoi& roi)>;

/// The face of a body in its image, read in its `face_roi`, and then once more in the region around the points that
/// were found. The second reading counts, unless it finds nothing.
std::optional<FacePose> find_face(const FaceReader& read, const cv::Mat& image, const BodyPose& body);

/// How far to trust the points of a face: the probability of a face, times the visibility of the body's nose.
double face_confidence(const FacePose& face, const BodyPose& body);

}  // namespace doppel
