#include "doppel/detect/networks/output_choice.h"

#include "doppel/core/error.h"

namespace doppel {

namespace {

using What = Wanted::What;

bool of_boxes(OutputKind kind) {
  return kind == OutputKind::boxes || kind == OutputKind::ssd || kind == OutputKind::yolox;
}

bool of_points(OutputKind kind) {
  return kind == OutputKind::heatmaps || kind == OutputKind::simcc || kind == OutputKind::points;
}

OutputKind kind_of_boxes(const NetworkOutput& output) {
  const int width = output.dims() > 0 ? output.size(output.dims() - 1) : 0;
  if (output.dims() == 4 && width == 7) return OutputKind::ssd;
  if (output.dims() == 2 || (output.dims() == 3 && output.size(0) == 1)) {
    if (width == 5) return OutputKind::boxes;
    if (width > 5) return OutputKind::yolox;
  }
  return OutputKind::automatic;
}

bool is_mask(const NetworkOutput& output) {
  return (output.dims() == 4 || output.dims() == 3) && output.size(0) == 1 && output.size(output.dims() - 2) > 1;
}

bool are_bins(const std::vector<NetworkOutput>& outputs, int points, cv::Size input) {
  if (outputs.size() != 2) return false;
  for (const NetworkOutput& output : outputs)
    if (output.dims() != 3 || output.size(0) != 1 || output.size(1) != points) return false;
  const long a = outputs[0].size(2), b = outputs[1].size(2);
  const auto fits = [&](long x, long y) { return x >= input.width && x * input.height == y * input.width; };
  return fits(a, b) || fits(b, a);
}

OutputKind kind_of_person(const std::vector<NetworkOutput>& outputs, int points, cv::Size input) {
  const NetworkOutput& first = outputs.at(0);
  if (points == 0) return is_mask(first) ? OutputKind::mask : OutputKind::automatic;
  if (are_bins(outputs, points, input)) return OutputKind::simcc;
  const bool image = first.dims() == 4 && first.size(0) == 1 && first.size(2) > 1 && first.size(3) > 1;
  if (image && first.size(1) >= points) return OutputKind::heatmaps;
  if (image && first.size(1) <= 2) return OutputKind::mask;
  const auto total = static_cast<int>(first.values.total());
  const bool row = first.dims() == 2 || (first.dims() == 3 && first.size(1) == points) || (first.dims() == 4 && !image);
  if (row && (total == 2 * points || total == 3 * points || total == 5 * points)) return OutputKind::points;
  return OutputKind::automatic;
}

}  // namespace

std::unique_ptr<OutputAdapter> choose_adapter(const NetworkOptions& options, const Wanted& wanted,
                                              const std::vector<NetworkOutput>& outputs, cv::Size input) {
  if (outputs.empty()) fail("the network has no outputs");
  OutputKind kind = options.output;
  if (kind == OutputKind::automatic)
    kind = wanted.what == What::boxes  ? kind_of_boxes(outputs[0])
           : wanted.what == What::mask ? (is_mask(outputs[0]) ? OutputKind::mask : kind)
                                       : kind_of_person(outputs, wanted.points, input);
  if (wanted.what == What::boxes) {
    if (of_boxes(kind)) return make_box_adapter(options, kind);
    fail(
        "the network should find boxes of people, but its outputs are {}; allowed are [1, N, 5], [1, 1, N, 7] and "
        "[1, N, 5 + classes], chosen with `output`: boxes, ssd or yolox",
        shapes_of(outputs));
  }
  if (kind == OutputKind::mask) return make_mask_adapter(options);
  if (wanted.what == What::mask)
    fail("the network should find a mask, [1, channels, height, width], but its outputs are {}", shapes_of(outputs));
  if (wanted.points == 0)
    fail("the network's outputs are {}; for points, say which ones with a layout, for a mask, set `output: mask`",
         shapes_of(outputs));
  if (!of_points(kind))
    fail(
        "no form of outputs fits {} points and the network's outputs {}: heatmaps are [1, at least {}, height, width], "
        "SimCC is two of [1, {}, bins], coordinates are [1, {}|{}|{}]; choose with `output`: heatmaps, simcc, points "
        "or mask",
        wanted.points, shapes_of(outputs), wanted.points, wanted.points, 2 * wanted.points, 3 * wanted.points,
        5 * wanted.points);
  if (kind == OutputKind::heatmaps) return make_heatmap_adapter(options, wanted.points);
  if (kind == OutputKind::simcc) return make_simcc_adapter(options, wanted.points);
  return make_points_adapter(options, wanted.points);
}

}  // namespace doppel
