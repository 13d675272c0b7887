#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/detect/networks/output_adapter.h"

namespace doppel {

namespace {

/// The probability of the person at each entry: one channel, background and person, or one channel for each class.
class MaskAdapter : public OutputAdapter {
 public:
  explicit MaskAdapter(const NetworkOptions& options) : activation_(options.activation), person_(options.person) {}

  NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size) const override {
    const NetworkOutput& output = outputs.at(0);
    const bool plane = output.dims() == 3 && output.size(0) == 1;                        // [1, h, w]
    const bool last = output.dims() == 4 && output.size(0) == 1 && output.size(3) == 1;  // [1, h, w, 1]
    if (!plane && (output.dims() != 4 || output.size(0) != 1))
      fail(
          "a mask must have the shape [1, channels, height, width] or [1, height, width]; the network's outputs are {}",
          shapes_of(outputs));
    const int rows = output.size(plane || last ? 1 : 2), columns = output.size(plane || last ? 2 : 3);
    const int channels = plane || last ? 1 : output.size(1);
    const int person = person_of(channels, outputs);
    const float* const values = output.values.ptr<float>();
    const auto channel = [&](int i) {
      return cv::Mat(rows, columns, CV_32F,
                     const_cast<float*>(values) + static_cast<std::ptrdiff_t>(i) * rows * columns);
    };
    cv::Mat mask = channel(person).clone();
    const MaskActivation activation = activation_of(output, channels);
    if (activation == MaskActivation::sigmoid) {
      for (float& value : cv::Mat_<float>(mask)) value = 1.0f / (1.0f + std::exp(-value));
    } else if (activation == MaskActivation::softmax) {
      softmax(channel, channels, mask);
    }
    return {{}, cv::max(cv::min(mask, 1.0), 0.0), {}};
  }

 private:
  int person_of(int channels, const std::vector<NetworkOutput>& outputs) const {
    if (channels > 2 && !person_)
      fail("the mask has {} classes; say with `person` which one is the person (0 to {})", channels, channels - 1);
    const int person = person_.value_or(channels - 1);
    if (person >= channels)
      fail("`person` is {}, but the mask has {} channels; the network's outputs are {}", person, channels,
           shapes_of(outputs));
    return person;
  }

  MaskActivation activation_of(const NetworkOutput& output, int channels) const {
    if (activation_ != MaskActivation::automatic) return activation_;
    for (const char* const done : {"Sigmoid", "Softmax", "SoftMax", "Clip", "ReLU6"})
      if (output.last_operator == done) return MaskActivation::none;
    return channels == 1 ? MaskActivation::sigmoid : MaskActivation::softmax;
  }

  /// @param mask in: the logits of the person; out: exp(person) / sum of exp of all channels
  template <typename Channel>
  static void softmax(const Channel& channel, int channels, cv::Mat& mask) {
    cv::Mat largest = channel(0).clone(), sum = cv::Mat::zeros(mask.size(), CV_32F), power;
    for (int i = 1; i < channels; ++i) largest = cv::max(largest, channel(i));
    for (int i = 0; i < channels; ++i) {
      cv::exp(channel(i) - largest, power);
      sum += power;
    }
    cv::exp(mask - largest, power);
    cv::divide(power, sum, mask);
  }

  MaskActivation activation_;
  std::optional<int> person_;
};

}  // namespace

std::unique_ptr<OutputAdapter> make_mask_adapter(const NetworkOptions& options) {
  return std::make_unique<MaskAdapter>(options);
}

}  // namespace doppel
