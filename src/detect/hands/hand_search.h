#pragma once

#include <functional>
#include <opencv2/core.hpp>

#include "doppel/detect/blazepose/body_pose.h"
#include "doppel/detect/hands/hand_pose.h"

namespace doppel {

/// Reads the hand in a region of an image: `HandDetector::read_hand`.
using HandReader = std::function<std::optional<HandPose>(const cv::Mat& image, const BodyRoi& roi)>;

/// The hands of a body in its image, each read in its `hand_roi`. A reading that looks clearly like a hand of the other
/// side is dropped. If both sides find the same hand, the side with the nearer wrist keeps it.
HandPair find_hands(const HandReader& read, const cv::Mat& image, const BodyPose& body);

/// How far to trust the points of a hand: the probability of a hand, times the visibility of the body's wrist.
double hand_confidence(const HandPose& hand, const BodyPose& body, HandSide side);

}  // namespace doppel
