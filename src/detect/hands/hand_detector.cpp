#include "doppel/detect/hands/hand_detector.h"

#include "doppel/detect/blazepose/network.h"
#include "doppel/detect/blazepose/network_input.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/tflite_model.h"
#include "doppel/detect/hands/hand_search.h"

namespace doppel {

namespace {

constexpr float kMinHandPresence = 0.5f;

/// The outputs of the network in the order of the file.
enum HandOutput : std::size_t { kHandPoints, kHandPresence, kHandedness, kHandWorld };

/// The inputs and outputs of the network in the order of the file.
const std::vector<TensorShape> kHandTensors = {
    {1, kHandPixels, kHandPixels, 3}, {1, 3 * kNumHandPoints}, {1, 1}, {1, 1}, {1, 3 * kNumHandPoints}};

}  // namespace

const Package kHandPackage = {"@mediapipe/hands@0.4.1675469240", {kHandFile}};

struct HandDetector::Impl {
  Network network;
};

HandDetector::HandDetector(const NetworkModel& model, int threads)
    : impl_(std::make_unique<Impl>(
          Impl{Network(require_tensors(model, kHandTensors, "the network of hands"), threads)})) {}
HandDetector::HandDetector(int threads, const std::filesystem::path& models)
    : HandDetector(read_tflite(find_package_file(kHandPackage, kHandFile, models.empty() ? models_folder() : models)),
                   threads) {}
HandDetector::~HandDetector() = default;
HandDetector::HandDetector(HandDetector&&) noexcept = default;
HandDetector& HandDetector::operator=(HandDetector&&) noexcept = default;

std::optional<HandPose> HandDetector::read_hand(const cv::Mat& image, const BodyRoi& roi) {
  require_image(image);
  if (!roi.valid()) return std::nullopt;
  Network& network = impl_->network;
  sample_roi(image, roi, kHandPixels, network.input());
  network.run();
  const HandOutputs outputs{network.output(kHandPoints), network.output(kHandWorld), network.output(kHandPresence)[0],
                            network.output(kHandedness)[0]};
  if (!(outputs.presence >= kMinHandPresence) || !all_finite(outputs.points) || !all_finite(outputs.world))
    return std::nullopt;
  return decode_hand(outputs, roi);
}

HandPair HandDetector::read_hands(const cv::Mat& image, const BodyPose& body) {
  return find_hands([this](const cv::Mat& frame, const BodyRoi& roi) { return read_hand(frame, roi); }, image, body);
}

}  // namespace doppel
