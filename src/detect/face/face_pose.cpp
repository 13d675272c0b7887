#include "doppel/detect/face/face_pose.h"

#include <cmath>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

constexpr char kFacePrefix[] = "face_mesh_";

}  // namespace

std::string face_point_name(int point) { return kFacePrefix + std::to_string(point); }

bool is_face_point(const std::string& landmark) { return landmark.starts_with(kFacePrefix); }

FacePose decode_face(const FaceOutputs& outputs, const BodyRoi& roi) {
  FacePose face;
  face.score = 1.0 / (1.0 + std::exp(-static_cast<double>(outputs.presence)));
  face.roi = roi;
  for (std::size_t i = 0; i < as_size(kNumFacePoints); ++i) {
    const float* point = &outputs.points[3 * i];
    const Eigen::Vector2d position = Eigen::Vector2d(point[0], point[1]) / kFacePixels;
    face.points[i] << roi.image_from_roi(position), point[2] / kFacePixels * roi.side;
  }
  return face;
}

}  // namespace doppel
