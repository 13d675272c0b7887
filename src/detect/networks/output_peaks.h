#pragma once

#include <opencv2/core.hpp>

#include "doppel/detect/networks/output_adapter.h"

namespace doppel {

/// The position of entry `index` of `count` on an input of `pixels` pixels. See OutputGrid.
double grid_position(double index, int count, int pixels, OutputGrid grid);

/// The largest entry of a heatmap and its refined index; the centre of the first entry is (0, 0). The score is the
/// largest value, at most 1. Not seen: below `threshold`. @param heatmap 32-bit; one row or one column is refined along
/// the other axis only
NetworkPoint find_peak(const cv::Mat& heatmap, PeakRefinement refine, int blur, double threshold);

}  // namespace doppel
