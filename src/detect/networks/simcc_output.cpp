#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/detect/networks/output_adapter.h"
#include "doppel/detect/networks/output_peaks.h"

namespace doppel {

namespace {

/// Coordinates as classification (Li et al., ECCV 2022): one row of bins of each point for x, another one for y. The
/// number of bins by pixel (the split ratio) follows from the shapes. The score is the smaller one of both maxima.
class SimccAdapter : public OutputAdapter {
 public:
  SimccAdapter(const NetworkOptions& options, int points)
      : threshold_(options.threshold),
        blur_(options.blur),
        points_(points),
        grid_(options.grid.value_or(OutputGrid::samples)),
        refine_(options.refine.value_or(PeakRefinement::none)) {}

  NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size input) const override {
    const auto rows_of = [&](std::size_t i) {
      return i < outputs.size() && outputs[i].dims() == 3 && outputs[i].size(0) == 1 && outputs[i].size(1) == points_;
    };
    if (!rows_of(0) || !rows_of(1))
      fail("SimCC bins of {} points must be two outputs of the shapes [1, {}, bins]; the network's outputs are {}",
           points_, points_, shapes_of(outputs));
    // Outputs come in the order of their names, so a file may have y before x.
    const auto fits = [&](std::size_t x, std::size_t y) {
      return static_cast<long>(outputs[x].size(2)) * input.height ==
             static_cast<long>(outputs[y].size(2)) * input.width;
    };
    if (!fits(0, 1) && !fits(1, 0))
      fail(
          "SimCC bins must be as many in x and y as the input of {}x{} pixels times one ratio; the network's outputs "
          "are {}",
          input.width, input.height, shapes_of(outputs));
    const std::size_t first = fits(0, 1) ? 0 : 1;
    NetworkResult result;
    for (int i = 0; i < points_; ++i) result.points.push_back(point(outputs[first], outputs[1 - first], i, input));
    return result;
  }

 private:
  static cv::Mat row(const NetworkOutput& output, int i) {
    return cv::Mat(1, output.size(2), CV_32F, const_cast<float*>(output.values.ptr<float>(0, i)));
  }

  NetworkPoint point(const NetworkOutput& x, const NetworkOutput& y, int i, cv::Size input) const {
    const NetworkPoint along_x = find_peak(row(x, i), refine_, blur_, threshold_);
    const NetworkPoint along_y = find_peak(row(y, i), refine_, blur_, threshold_);
    const double score = std::min(along_x.score, along_y.score);
    if (!(score > 0.0)) return {};
    return {{grid_position(along_x.position.x(), x.size(2), input.width, grid_),
             grid_position(along_y.position.x(), y.size(2), input.height, grid_)},
            score};
  }

  double threshold_;
  int blur_, points_;
  OutputGrid grid_;
  PeakRefinement refine_;
};

}  // namespace

std::unique_ptr<OutputAdapter> make_simcc_adapter(const NetworkOptions& options, int points) {
  return std::make_unique<SimccAdapter>(options, points);
}

}  // namespace doppel
