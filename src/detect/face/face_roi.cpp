#include "doppel/detect/face/face_roi.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace doppel {

namespace {

constexpr std::size_t kNose = 0, kLeftEye = 2, kRightEye = 5, kLeftEar = 7, kRightEar = 8, kMouthLeft = 9,
                      kMouthRight = 10;
/// Of the canonical face, enlarged 1.5 times: its height by the distance between the eyes, and by that from the eyes to
/// the mouth.
constexpr double kSidePerEyes = 4.2, kSidePerMouth = 3.8;
constexpr double kMaxTurn = 70.0 * std::numbers::pi / 180.0;
// Outer corners of the eyes among the points of a face.
constexpr std::size_t kOuterRight = 33, kOuterLeft = 263;
constexpr double kSidePerBox = 1.5;

Eigen::Vector2d pixel_of(const BodyPose& body, std::size_t landmark) {
  return {body.landmarks[landmark].x, body.landmarks[landmark].y};
}

/// Upwards in the image of a person whose left side is at the end of `across`.
Eigen::Vector2d above(const Eigen::Vector2d& across) { return {across.y(), -across.x()}; }

bool looks_away(const BodyPose& body) {
  const Eigen::Vector3d ahead = body.world[kNose] - 0.5 * (body.world[kLeftEar] + body.world[kRightEar]);
  return !(-ahead.z() > std::cos(kMaxTurn) * ahead.norm());
}

}  // namespace

std::optional<BodyRoi> face_roi(const BodyPose& body) {
  if (looks_away(body)) return std::nullopt;
  const Eigen::Vector2d left = pixel_of(body, kLeftEye), right = pixel_of(body, kRightEye), eyes = 0.5 * (left + right),
                        mouth = 0.5 * (pixel_of(body, kMouthLeft) + pixel_of(body, kMouthRight)), across = left - right;
  return BodyRoi{0.5 * (eyes + mouth), std::max(kSidePerEyes * across.norm(), kSidePerMouth * (eyes - mouth).norm()),
                 upright_rotation(above(across) + eyes - mouth)};
}

BodyRoi face_roi(const FacePose& face) {
  BodyRoi roi;
  const Eigen::Vector2d across = (face.points[kOuterLeft] - face.points[kOuterRight]).head<2>();
  roi.rotation = upright_rotation(above(across));
  const Eigen::Matrix2d axes = roi.axes();
  Eigen::Array2d low = Eigen::Array2d::Constant(INFINITY), high = -low;
  for (const Eigen::Vector3d& point : face.points) {
    const Eigen::Array2d turned = axes.transpose() * point.head<2>();
    low = low.min(turned);
    high = high.max(turned);
  }
  roi.centre = axes * (0.5 * (low + high)).matrix();
  roi.side = kSidePerBox * (high - low).maxCoeff();
  return roi;
}

}  // namespace doppel
