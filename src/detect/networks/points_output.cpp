#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/networks/output_adapter.h"
#include "doppel/detect/networks/output_peaks.h"

namespace doppel {

namespace {

double sigmoid(double value) { return 1.0 / (1.0 + std::exp(-value)); }

/// What the values of a point mean if the options do not say: those of five are MediaPipe's.
std::vector<std::string> usual_values(int count) {
  if (count == 5) return {"x", "y", "skip", "logit", "skip"};
  if (count == 3) return {"x", "y", "score"};
  return {"x", "y"};
}

/// Coordinates as numbers: K times 2, 3 or 5 values, or those that the option `values` names. A second output of K
/// values, if there is one, has the scores. Without scores every point counts as seen.
class PointsAdapter : public OutputAdapter {
 public:
  PointsAdapter(const NetworkOptions& options, int points)
      : threshold_(options.threshold),
        points_(points),
        fractions_(options.fractions),
        grid_(options.grid.value_or(OutputGrid::cells)),
        values_(options.values) {}

  NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size input) const override {
    const int total = static_cast<int>(outputs.at(0).values.total()), count = total / points_;
    const std::vector<std::string> values = values_.empty() ? usual_values(count) : values_;
    if (total != points_ * static_cast<int>(values.size()) ||
        (values_.empty() && count != 2 && count != 3 && count != 5))
      fail("coordinates of {} points must be {} values; the network's outputs are {}", points_,
           values_.empty()
               ? fmt::format("{}, {} or {}", 2 * points_, 3 * points_, 5 * points_)
               : fmt::format("{} ({} each)", points_ * static_cast<int>(values.size()), fmt::join(values, ", ")),
           shapes_of(outputs));
    const bool scored = outputs.size() > 1 && outputs[1].values.total() == as_size(points_);
    NetworkResult result;
    for (int i = 0; i < points_; ++i) {
      NetworkPoint point = read_point(outputs[0].values.ptr<float>() + i * count, values, input);
      if (scored) point.score = outputs[1].values.ptr<float>()[i];
      point.score = point.score >= threshold_ ? std::min(point.score, 1.0) : 0.0;
      result.points.push_back(point);
    }
    return result;
  }

 private:
  NetworkPoint read_point(const float* numbers, const std::vector<std::string>& values, cv::Size input) const {
    NetworkPoint point{{0.0, 0.0}, 1.0};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double number = numbers[i];
      if (values[i] == "x") point.position.x() = position(number, input.width);
      if (values[i] == "y") point.position.y() = position(number, input.height);
      if (values[i] == "score") point.score = number;
      if (values[i] == "logit") point.score = sigmoid(number);
    }
    return point;
  }

  /// Pixels count like the entries of a grid with one entry by pixel, except that cells begin at their corner.
  double position(double number, int pixels) const {
    if (grid_ == OutputGrid::cells) return fractions_ ? number * pixels : number;
    if (!fractions_) return number + 0.5;
    return grid_ == OutputGrid::samples ? number * pixels + 0.5 : number * (pixels - 1) + 0.5;
  }

  double threshold_;
  int points_;
  bool fractions_;
  OutputGrid grid_;
  std::vector<std::string> values_;
};

}  // namespace

std::unique_ptr<OutputAdapter> make_points_adapter(const NetworkOptions& options, int points) {
  return std::make_unique<PointsAdapter>(options, points);
}

}  // namespace doppel
