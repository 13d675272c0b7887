#include "doppel/detect/face/face_detector.h"

#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/network_input.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "doppel/detect/face/face_search.h"

namespace doppel {

namespace {

constexpr double kMinFaceScore = 0.5;
constexpr FilePart kFacePart = {2495952, 1241896};  ///< face_landmark.tflite

/// The outputs of the network in the order of the file.
enum FaceOutput : std::size_t { kFacePoints, kFacePresence };

/// The inputs and outputs of the network in the order of the file.
const std::vector<TensorShape> kFaceTensors = {
    {1, kFacePixels, kFacePixels, 3}, {1, 1, 1, 3 * kNumFacePoints}, {1, 1, 1, 1}};

}  // namespace

const Package kFacePackage = {"@mediapipe/face_mesh@0.4.1657299874", {kFaceFile}};

struct FaceDetector::Impl {
  Network network;
};

FaceDetector::FaceDetector(const NetworkModel& model, int threads)
    : impl_(std::make_unique<Impl>(
          Impl{Network(require_tensors(model, kFaceTensors, "the network of faces"), threads)})) {}
FaceDetector::FaceDetector(int threads, const std::filesystem::path& models)
    : FaceDetector(
          read_tflite(find_package_file(kFacePackage, kFaceFile, models.empty() ? models_folder() : models), kFacePart),
          threads) {}
FaceDetector::~FaceDetector() = default;
FaceDetector::FaceDetector(FaceDetector&&) noexcept = default;
FaceDetector& FaceDetector::operator=(FaceDetector&&) noexcept = default;

std::optional<FacePose> FaceDetector::read_face(const cv::Mat& image, const BodyRoi& roi) {
  require_image(image);
  if (!roi.valid()) return std::nullopt;
  Network& network = impl_->network;
  sample_roi(image, roi, kFacePixels, network.input());
  network.run();
  const FaceOutputs outputs{network.output(kFacePoints), network.output(kFacePresence)[0]};
  if (!all_finite(outputs.points)) return std::nullopt;
  const FacePose face = decode_face(outputs, roi);
  return face.score >= kMinFaceScore ? std::optional(face) : std::nullopt;
}

std::optional<FacePose> FaceDetector::read_face(const cv::Mat& image, const BodyPose& body) {
  return find_face([this](const cv::Mat& frame, const BodyRoi& roi) { return read_face(frame, roi); }, image, body);
}

}  // namespace doppel
