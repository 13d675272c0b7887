#include "doppel/detect/face/face_search.h"

#include "doppel/detect/face/face_roi.h"

namespace doppel {

std::optional<FacePose> find_face(const FaceReader& read, const cv::Mat& image, const BodyPose& body) {
  const std::optional<BodyRoi> roi = face_roi(body);
  if (!roi) return std::nullopt;
  const std::optional<FacePose> first = read(image, *roi);
  if (!first) return std::nullopt;
  const std::optional<FacePose> second = read(image, face_roi(*first));
  return second ? second : first;
}

double face_confidence(const FacePose& face, const BodyPose& body) {
  constexpr std::size_t kNoseOfBody = 0;
  return face.score * body.landmarks[kNoseOfBody].visibility;
}

}  // namespace doppel
