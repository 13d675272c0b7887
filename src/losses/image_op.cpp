#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include <algorithm>
#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/losses/image_kernel.h"
#include "doppel/losses/image_terms.h"

namespace doppel::image_loss {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kImageLossOp = "doppel::image_loss";
/// Rows per piece of work. The sums are added in the order of the pieces, so they do not depend on the threads.
constexpr std::int64_t kRows = 32;

/// The data of one call. The tensors own the memory that `params` points to.
struct ImageLossCall {
  Tensor rendered, target, mask;
  float matrix[6] = {};
  std::vector<float> taps;
  ImageLossParams params{};
  std::int64_t views = 0, pieces_per_view = 0, channels = 3;

  ImageLossCall(const Tensor& rendered_in, const Tensor& target_in, const Tensor& mask_in, std::int64_t measure,
                at::ArrayRef<double> taps_in)
      : taps(taps_in.begin(), taps_in.end()) {
    check_floats(kImageLossOp, "rendered", rendered_in, {-1, -1, -1, -1, 3}, "[B,C,H,W,3]");
    check_floats(kImageLossOp, "target", target_in, rendered_in.sizes(), "[B,C,H,W,3]");
    check_tensor(kImageLossOp, "mask", mask_in, {torch::kUInt8}, rendered_in.sizes().slice(0, 4), "[B,C,H,W]");
    TORCH_CHECK(measure >= 0 && measure <= 2 && !taps.empty(), kImageLossOp, ": no taps, or no measure ", measure);
    rendered = rendered_in.contiguous();
    target = target_in.contiguous();
    mask = mask_in.contiguous();
    for (int i = 0; i < 6; ++i) matrix[i] = static_cast<float>(255.0 * kChroma[i / 3][i % 3]);
    params.height = rendered.size(2);
    params.width = rendered.size(3);
    params.measure = static_cast<int>(measure);
    params.matrix = matrix;
    params.taps = taps.data();
    params.half_size = static_cast<int>(taps.size()) - 1;
    views = rendered.size(0) * rendered.size(1);
    pieces_per_view = (params.height + kRows - 1) / kRows;
    channels = measure == static_cast<int>(Measure::chroma) ? 2 : 3;
  }

  bool is_empty() const { return mask.numel() == 0; }
  std::int64_t pieces() const { return views * pieces_per_view; }

  /// Calls work(params of the piece, its number, its first and last row).
  template <typename Work>
  void for_each_piece(const Work& work) const {
    at::parallel_for(0, pieces(), 1, [&](std::int64_t begin, std::int64_t end) {
      std::vector<float> scratch(kernels::image_loss_scratch(params, kRows));
      ImageLossParams p = params;
      p.scratch = scratch.data();
      for (std::int64_t piece = begin; piece < end; ++piece) {
        const std::int64_t area = (piece / pieces_per_view) * p.height * p.width;
        const std::int64_t first = piece % pieces_per_view * kRows, last = std::min(first + kRows, p.height);
        p.rendered = rendered.data_ptr<float>() + 3 * area;
        p.target = target.data_ptr<float>() + 3 * area;
        p.mask = mask.data_ptr<std::uint8_t>() + area;
        work(p, piece, area, first, last);
      }
    });
  }
};

Tensor image_loss_cpu(const Tensor& rendered, const Tensor& target, const Tensor& mask, std::int64_t count,
                      std::int64_t measure, at::ArrayRef<double> taps) {
  const ImageLossCall call(rendered, target, mask, measure, taps);
  if (call.is_empty()) return at::zeros({}, call.rendered.options());
  std::vector<double> sums(call.pieces(), 0.0);
  call.for_each_piece([&](ImageLossParams& p, std::int64_t piece, std::int64_t, std::int64_t first, std::int64_t last) {
    p.sum = &sums[piece];
    kernels::image_loss_forward(p, first, last);
  });
  double sum = 0.0;
  for (double part : sums) sum += part;
  return at::full({}, sum / static_cast<double>(call.channels * count), call.rendered.options());
}

/// @return the gradient to `rendered`; the gradient to `target` is its negative
Tensor image_loss_backward_cpu(const Tensor& upstream, const Tensor& rendered, const Tensor& target, const Tensor& mask,
                               std::int64_t count, std::int64_t measure, at::ArrayRef<double> taps) {
  ImageLossCall call(rendered, target, mask, measure, taps);
  Tensor gradient = at::empty(call.rendered.sizes(), call.rendered.options());
  if (call.is_empty()) return gradient;
  call.params.scale = static_cast<float>(upstream.item<double>() / static_cast<double>(call.channels * count));
  float* to = gradient.data_ptr<float>();
  call.for_each_piece([&](ImageLossParams& p, std::int64_t, std::int64_t area, std::int64_t first, std::int64_t last) {
    p.gradient = to + 3 * area;
    kernels::image_loss_backward(p, first, last);
  });
  return gradient;
}

class ImageLossFunction : public torch::autograd::Function<ImageLossFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& rendered, const Tensor& target, const Tensor& mask,
                        std::int64_t count, std::int64_t measure, const std::vector<double>& taps) {
    static const auto op = find_op<decltype(image_loss_cpu)>(kImageLossOp);
    at::AutoDispatchBelowADInplaceOrView guard;
    // The backward pass recomputes the gradient from the images: a stored image of gradients would cost more memory
    // traffic than a second read.
    context->save_for_backward({rendered, target, mask});
    context->saved_data["count"] = count;
    context->saved_data["measure"] = measure;
    context->saved_data["taps"] = taps;
    return op.call(rendered, target, mask, count, measure, taps);
  }

  static variable_list backward(AutogradContext* context, const variable_list& upstream) {
    static const auto op = find_op<decltype(image_loss_backward_cpu)>("doppel::image_loss_backward");
    const variable_list saved = context->get_saved_variables();
    const auto taps = context->saved_data["taps"].toDoubleVector();
    Tensor to_rendered, to_target;
    {
      at::AutoDispatchBelowADInplaceOrView guard;
      const Tensor gradient = op.call(upstream[0], saved[0], saved[1], saved[2], context->saved_data["count"].toInt(),
                                      context->saved_data["measure"].toInt(), taps);
      if (context->needs_input_grad(1)) to_target = gradient.neg();
      if (context->needs_input_grad(0)) to_rendered = gradient;
    }
    return once_differentiable({to_rendered, to_target, Tensor(), Tensor(), Tensor(), Tensor()}, kImageLossOp);
  }
};

Tensor image_loss_autograd(const Tensor& rendered, const Tensor& target, const Tensor& mask, std::int64_t count,
                           std::int64_t measure, at::ArrayRef<double> taps) {
  return ImageLossFunction::apply(rendered, target, mask, count, measure, taps.vec());
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def("image_loss(Tensor rendered, Tensor target, Tensor mask, int count, int measure, float[] taps) -> Tensor");
  m.def(
      "image_loss_backward(Tensor upstream, Tensor rendered, Tensor target, Tensor mask, int count, int measure, "
      "float[] taps) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("image_loss", TORCH_FN(image_loss_cpu));
  m.impl("image_loss_backward", TORCH_FN(image_loss_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("image_loss", TORCH_FN(image_loss_autograd)); }

}  // namespace

Tensor fused(const Tensor& rendered, const Tensor& target, const PixelMask& mask, Measure measure,
             const std::vector<double>& taps) {
  static const auto op = find_op<decltype(image_loss_cpu)>(kImageLossOp);
  return op.call(rendered, target, mask.weight, std::max<std::int64_t>(mask.count, 1),
                 static_cast<std::int64_t>(measure), taps);
}

}  // namespace doppel::image_loss
