#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>

#include "doppel/detect/blazepose/roi.h"

namespace doppel {

inline constexpr int kNumFacePoints = 468;
/// The name of a point in layouts: "face_mesh_0". The 68 points of other layouts are called "face-0".
std::string face_point_name(int point);
/// Whether a landmark is a point of a face.
bool is_face_point(const std::string& landmark);

/// One face in one image.
struct FacePose {
  /// In the order of MediaPipe's face mesh. x and y: pixels of the image, first pixel centre at (0.5, 0.5), may lie
  /// outside of the image. z: depth relative to the middle of the head, in pixels too; negative: nearer to the camera.
  std::array<Eigen::Vector3d, kNumFacePoints> points;
  double score = 0.0;  ///< probability that the region shows a face
  BodyRoi roi;         ///< the region that the network saw
};

inline constexpr int kFacePixels = 192;  ///< side of the network's input

/// What the network of faces computes.
struct FaceOutputs {
  std::span<const float> points;  ///< [468, 3] pixels of the input
  float presence = 0.0f;          ///< of a face, a logit
};

/// @param roi not mirrored: the points of both sides have numbers of their own
FacePose decode_face(const FaceOutputs& outputs, const BodyRoi& roi);

}  // namespace doppel
