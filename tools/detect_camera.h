#pragma once

#include <filesystem>
#include <functional>
#include <optional>

#include "detect_sources.h"
#include "doppel/detect/blazepose/body_detector.h"
#include "doppel/detect/face/face_detector.h"
#include "doppel/detect/hands/hand_detector.h"
#include "doppel/detect/keypoints/keypoints.h"

namespace doppel::tools {

/// What is written for one camera, and where.
struct DetectFiles {
  std::filesystem::path keypoints;  ///< table of points in the images
  std::filesystem::path joints;     ///< table of points in space
  std::filesystem::path masks;      ///< folder of images, one for each frame; empty: no masks
  /// Whether masks mark what the network may have missed (detect/blazepose/possible_parts.h): other cameras decide.
  bool possible_parts = false;
};

/// What was found in the images of one camera.
struct DetectReport {
  long frames = 0, with_person = 0;
  double mean_confidence = 0.0;  ///< of all points of the body in frames with a person
};

/// The networks that read a person.
struct PersonDetectors {
  BodyDetector body;
  std::optional<HandDetector> hands;  ///< nothing: hands are not read
  std::optional<FaceDetector> face;   ///< nothing: the face is not read
};

/// Which points of a person are read.
enum class PersonPoints { body, body_hands, body_face_hands };

/// MediaPipe's points: mediapipe33 of the body, mediapipe75 of the body, the left and the right hand, or mediapipe543
/// of the body, the face and both hands.
PointLayout mediapipe_layout(PersonPoints points);
/// The landmarks of a pose as a person of the layout mediapipe33.
Person person_of_pose(const BodyPose& pose);
/// The same with the points of both hands: a person of the layout mediapipe75. Points of a hand that is not found have
/// the confidence 0, the others hand_confidence.
Person person_of_pose(const BodyPose& pose, const HandPair& hands);
/// The same with the points of the face: a person of the layout mediapipe543. Points of a face that is not found have
/// the confidence 0, the others face_confidence.
Person person_of_pose(const BodyPose& pose, const std::optional<FacePose>& face, const HandPair& hands);

/// Follows one person through the images of a camera and writes the files when all frames are done.
/// @param guide where the person is, as far as it is known
/// @param sharpen whether masks get the resolution of the image (detect/blazepose/mask_sharpening.h)
/// @param advance called after each frame; returns false to stop
/// @return nothing when it was stopped; no table is written then
std::optional<DetectReport> detect_camera(const DetectSource& source, const DetectFiles& files,
                                          PersonDetectors& detectors, const PersonGuide& guide, bool sharpen,
                                          const std::function<bool()>& advance);

}  // namespace doppel::tools
