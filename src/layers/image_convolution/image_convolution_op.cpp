#include <ATen/Parallel.h>
#include <torch/types.h>

#include <algorithm>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/image_convolution/image_convolution.h"
#include "doppel/layers/image_convolution/image_convolution_kernel.h"

namespace doppel {
namespace {

using torch::Tensor;

const char* const kImageConvolutionOp = "doppel::image_convolution";

void check_channel(const char* name, const Tensor& values, const Tensor& weight) {
  if (!values.defined()) return;
  check_shape("image_convolution", name, values, {weight.size(0)}, "[Cout]");
  check_same_kind("image_convolution", name, values, weight);
}

void check_arguments(const Tensor& image, const Tensor& second, const ImageConvolution& layer) {
  const char* op = "image_convolution";
  check_shape(op, "image", image, {-1, -1, -1, -1}, "[B,C1,H,W]");
  const int64_t B = image.size(0), H = image.size(2), W = image.size(3);
  if (second.defined()) {
    check_shape(op, "second", second, {B, -1, H, W}, "[B,C2,H,W]");
    check_same_kind(op, "second", second, image);
  }
  const int64_t inputs = image.size(1) + (second.defined() ? second.size(1) : 0);
  const bool halves = layer.weight.defined() && layer.weight.dim() == 4 && layer.weight.size(2) == 4;
  const int64_t k = halves ? 4 : 3;
  check_shape(op, "weight", layer.weight, {-1, inputs, k, k}, "[Cout,Cin,3,3] or [Cout,Cin,4,4]");
  check_same_kind(op, "weight", layer.weight, image);
  check_channel("scale", layer.scale, layer.weight);
  check_channel("shift", layer.shift, layer.weight);
  if (H < 1 || W < 1 || (halves && (H % 2 != 0 || W % 2 != 0 || layer.enlarge)))
    fail<UsageError>(
        "image_convolution: 4x4 weights halve an image, so its sides must be even and it is not enlarged; found {} x "
        "{}",
        H, W);
}

/// Pixels of a row that neither share memory nor lie side by side are copied.
Tensor readable_rows(const Tensor& image) {
  const bool readable = image.size(3) == 1 || image.stride(3) == 1 || image.stride(3) == 0;
  return readable ? image : image.contiguous();
}

ImageChannels channels_of(const Tensor& image, int64_t item) {
  // A single column has any stride.
  const int64_t column = image.size(3) == 1 ? 1 : image.stride(3);
  return {image.data_ptr<float>() + item * image.stride(0), image.size(1), image.stride(1), image.stride(2), column};
}

const float* data_or_null(const OptionalTensor& values) {
  return values.has_value() && values->defined() ? values->data_ptr<float>() : nullptr;
}

/// The division of an image into tasks: blocks of rows, and groups of output channels where there are few blocks.
struct Tasks {
  int64_t rows, blocks, groups;

  Tasks(const ImageConvolutionParams& p) {
    // The rows of a block stay in the second-level cache. The number of tasks does not depend on the threads.
    constexpr int64_t kMaxScratchFloats = 64 * 1024, kMaxRows = 8, kFewBlocks = 4, kChannels = 4;
    rows = std::min(kMaxRows, p.out_height);
    while (rows > 1 && kernels::image_convolution_scratch(p, rows) > kMaxScratchFloats) rows = (rows + 1) / 2;
    blocks = (p.out_height + rows - 1) / rows;
    groups = blocks >= kFewBlocks ? 1 : std::clamp<int64_t>(p.outputs / kChannels, 1, kFewBlocks);
  }
  int64_t count() const { return blocks * groups; }
};

void run_task(const ImageConvolutionParams& p, const Tasks& tasks, int64_t task, float* scratch) {
  const int64_t begin = task / tasks.groups * tasks.rows, group = task % tasks.groups;
  constexpr int64_t kChannels = 4;  // groups begin at multiples of what the kernel computes at once
  const int64_t fours = (p.outputs + kChannels - 1) / kChannels;
  const int64_t first = group * fours / tasks.groups * kChannels;
  const int64_t last = std::min(p.outputs, (group + 1) * fours / tasks.groups * kChannels);
  kernels::image_convolution(p, begin, std::min(begin + tasks.rows, p.out_height), first, last, scratch);
}

Tensor image_convolution_cpu(const Tensor& image_in, const OptionalTensor& second_in, const Tensor& weight_in,
                             const OptionalTensor& scale, const OptionalTensor& shift, double slope, bool enlarge) {
  check_arguments(image_in, second_in.value_or(Tensor()),
                  {weight_in, scale.value_or(Tensor()), shift.value_or(Tensor()), slope, enlarge});
  const Tensor image = readable_rows(image_in), weight = weight_in.contiguous();
  const Tensor second = second_in.has_value() ? readable_rows(*second_in) : Tensor();
  ImageConvolutionParams p{};
  p.height = image.size(2);
  p.width = image.size(3);
  p.kernel = static_cast<int>(weight.size(2));
  p.enlarge = enlarge;
  p.out_height = p.kernel == 4 ? p.height / 2 : enlarge ? 2 * p.height : p.height;
  p.out_width = p.kernel == 4 ? p.width / 2 : enlarge ? 2 * p.width : p.width;
  p.outputs = weight.size(0);
  p.weight = weight.data_ptr<float>();
  const OptionalTensor scales = scale.has_value() ? OptionalTensor(scale->contiguous()) : scale;
  const OptionalTensor shifts = shift.has_value() ? OptionalTensor(shift->contiguous()) : shift;
  p.scale = data_or_null(scales);
  p.shift = data_or_null(shifts);
  p.slope = static_cast<float>(slope);
  const Tensor out = at::empty({image.size(0), p.outputs, p.out_height, p.out_width}, image.options());
  if (out.numel() == 0) return out;
  for (int64_t item = 0; item < image.size(0); ++item) {
    p.parts[0] = channels_of(image, item);
    p.parts[1] = second.defined() ? channels_of(second, item) : ImageChannels{};
    p.out = out.data_ptr<float>() + item * p.outputs * p.out_height * p.out_width;
    const Tasks tasks(p);
    at::parallel_for(0, tasks.count(), 1, [&](int64_t begin, int64_t end) {
      std::vector<float> scratch(static_cast<std::size_t>(kernels::image_convolution_scratch(p, tasks.rows)));
      for (int64_t task = begin; task < end; ++task) run_task(p, tasks, task, scratch.data());
    });
  }
  return out;
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "image_convolution(Tensor image, Tensor? second, Tensor weight, Tensor? scale, Tensor? shift, float slope, bool "
      "enlarge) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) { m.impl("image_convolution", TORCH_FN(image_convolution_cpu)); }

}  // namespace

Tensor image_convolution(const Tensor& image, const Tensor& second, const ImageConvolution& layer) {
  if (!takes_kernel(image)) {
    check_arguments(image, second, layer);  // the op checks its own
    return image_convolution_reference(image, second, layer);
  }
  static const auto op = find_op<decltype(image_convolution_cpu)>(kImageConvolutionOp);
  return op.call(image, optional_of(second), layer.weight, optional_of(layer.scale), optional_of(layer.shift),
                 layer.slope, layer.enlarge);
}

}  // namespace doppel
