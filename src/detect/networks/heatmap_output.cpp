#include "doppel/core/error.h"
#include "doppel/detect/networks/output_adapter.h"
#include "doppel/detect/networks/output_peaks.h"

namespace doppel {

namespace {

/// One heatmap for each point; further channels (background, limbs) are ignored.
class HeatmapAdapter : public OutputAdapter {
 public:
  HeatmapAdapter(const NetworkOptions& options, int points)
      : threshold_(options.threshold),
        blur_(options.blur),
        points_(points),
        grid_(options.grid.value_or(OutputGrid::cells)),
        refine_(options.refine.value_or(PeakRefinement::parabola)) {}

  NetworkResult read(const std::vector<NetworkOutput>& outputs, cv::Size input) const override {
    const NetworkOutput& output = outputs.at(0);
    if (output.dims() != 4 || output.size(0) != 1 || output.size(1) < points_)
      fail("heatmaps of {} points must have the shape [1, at least {}, height, width]; the network's outputs are {}",
           points_, points_, shapes_of(outputs));
    NetworkResult result;
    for (int i = 0; i < points_; ++i) {
      const cv::Mat heatmap(output.size(2), output.size(3), CV_32F, const_cast<float*>(output.values.ptr<float>(0, i)));
      NetworkPoint point = find_peak(heatmap, refine_, blur_, threshold_);
      if (point.score > 0.0)
        point.position = {grid_position(point.position.x(), heatmap.cols, input.width, grid_),
                          grid_position(point.position.y(), heatmap.rows, input.height, grid_)};
      result.points.push_back(point);
    }
    return result;
  }

 private:
  double threshold_;
  int blur_, points_;
  OutputGrid grid_;
  PeakRefinement refine_;
};

}  // namespace

std::unique_ptr<OutputAdapter> make_heatmap_adapter(const NetworkOptions& options, int points) {
  return std::make_unique<HeatmapAdapter>(options, points);
}

}  // namespace doppel
