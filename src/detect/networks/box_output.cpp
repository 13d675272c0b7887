#include <algorithm>
#include <cmath>
#include <opencv2/dnn.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/networks/output_adapter.h"

namespace doppel {

namespace {

constexpr int kYoloxStrides[] = {8, 16, 32};
constexpr float kMaxOverlap = 0.45f;  ///< intersection over union above which two boxes are one person

/// The rows of an output: its last dimension is a row; all others but one have the size 1.
struct Rows {
  const float* values = nullptr;
  int count = 0, width = 0;

  const float* row(int i) const { return values + static_cast<std::ptrdiff_t>(i) * width; }
};

Rows rows_of(const NetworkOutput& output) {
  const int width = output.dims() > 0 ? output.size(output.dims() - 1) : 0;
  const auto total = static_cast<int>(output.values.total());
  return {output.values.ptr<float>(), width > 0 ? total / width : 0, width};
}

/// The best of boxes that overlap, best first.
std::vector<PersonBox> merged(const std::vector<PersonBox>& boxes, double threshold) {
  std::vector<cv::Rect2d> rectangles;
  std::vector<float> scores;
  for (const PersonBox& box : boxes) {
    rectangles.emplace_back(box.low.x(), box.low.y(), box.size().x(), box.size().y());
    scores.push_back(static_cast<float>(box.score));
  }
  std::vector<int> kept;
  cv::dnn::NMSBoxes(rectangles, scores, static_cast<float>(threshold), kMaxOverlap, kept);
  std::vector<PersonBox> best;
  best.reserve(kept.size());
  for (const int i : kept) best.push_back(boxes[i]);
  return best;
}

class BoxAdapter : public OutputAdapter {
 public:
  BoxAdapter(const NetworkOptions& options, OutputKind kind)
      : threshold_(options.threshold), person_(options.person), kind_(kind) {}

  NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size input) const override {
    const Rows rows = rows_of(outputs.at(0));
    std::vector<PersonBox> boxes = kind_ == OutputKind::ssd     ? read_ssd(rows, outputs, input)
                                   : kind_ == OutputKind::yolox ? read_yolox(rows, outputs, input)
                                                                : read_boxes(rows, outputs);
    // Boxes of no size would make crops of no size.
    std::erase_if(boxes,
                  [&](const PersonBox& box) { return !(box.score >= threshold_) || !(box.size().minCoeff() > 0); });
    return {{}, {}, merged(boxes, threshold_)};
  }

 private:
  /// x1, y1, x2, y2, score; the classes are in a second output.
  std::vector<PersonBox> read_boxes(const Rows& rows, const std::vector<NetworkOutput>& outputs) const {
    if (rows.width != 5) fail("boxes must have the shape [1, N, 5]; the network's outputs are {}", shapes_of(outputs));
    const bool classes = outputs.size() > 1 && outputs[1].values.total() == as_size(rows.count);
    std::vector<PersonBox> boxes;
    for (int i = 0; i < rows.count; ++i) {
      const float* const row = rows.row(i);
      if (classes && cvRound(outputs[1].values.ptr<float>()[i]) != person_.value_or(0)) continue;
      boxes.push_back({{row[0], row[1]}, {row[2], row[3]}, row[4]});
    }
    return boxes;
  }

  /// Image, class, score, x1, y1, x2, y2 as fractions of the input.
  std::vector<PersonBox> read_ssd(const Rows& rows, const std::vector<NetworkOutput>& outputs, cv::Size input) const {
    if (rows.width != 7)
      fail("boxes of an SSD must have the shape [1, 1, N, 7]; the network's outputs are {}", shapes_of(outputs));
    const Eigen::Vector2d pixels(input.width, input.height);
    std::vector<PersonBox> boxes;
    for (int i = 0; i < rows.count; ++i) {
      const float* const row = rows.row(i);
      if (person_ && cvRound(row[1]) != *person_) continue;
      boxes.push_back({Eigen::Vector2d(row[3], row[4]).cwiseProduct(pixels),
                       Eigen::Vector2d(row[5], row[6]).cwiseProduct(pixels), row[2]});
    }
    return boxes;
  }

  /// One row by cell of grids of 8, 16 and 32 pixels: centre = (value + cell) * stride, size = exp(value) * stride,
  /// score = probability of an object times that of the class.
  std::vector<PersonBox> read_yolox(const Rows& rows, const std::vector<NetworkOutput>& outputs, cv::Size input) const {
    int cells = 0;
    for (const int stride : kYoloxStrides) cells += (input.width / stride) * (input.height / stride);
    const int person = 5 + person_.value_or(0);
    if (rows.count != cells || rows.width <= person)
      fail(
          "boxes of YOLOX for an input of {}x{} must have the shape [1, {}, at least {}]; the network's outputs are {}",
          input.width, input.height, cells, person + 1, shapes_of(outputs));
    std::vector<PersonBox> boxes;
    int i = 0;
    for (const int stride : kYoloxStrides)
      for (int y = 0; y < input.height / stride; ++y)
        for (int x = 0; x < input.width / stride; ++x, ++i) {
          const float* const row = rows.row(i);
          const Eigen::Vector2d centre((row[0] + x) * stride, (row[1] + y) * stride);
          const Eigen::Vector2d half(0.5 * std::exp(row[2]) * stride, 0.5 * std::exp(row[3]) * stride);
          if (half.allFinite()) boxes.push_back({centre - half, centre + half, row[4] * row[person]});
        }
    return boxes;
  }

  double threshold_;
  std::optional<int> person_;
  OutputKind kind_;
};

}  // namespace

std::unique_ptr<OutputAdapter> make_box_adapter(const NetworkOptions& options, OutputKind kind) {
  return std::make_unique<BoxAdapter>(options, kind);
}

}  // namespace doppel
