#include <ATen/Parallel.h>
#include <torch/autograd.h>
#include <torch/types.h>

#include <algorithm>
#include <atomic>
#include <functional>

#include "doppel/core/tensor/op.h"
#include "doppel/losses/silhouette_kernel.h"
#include "doppel/losses/silhouette_terms.h"

namespace doppel::silhouette {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kSilhouetteLossOp = "doppel::silhouette_loss";

/// Adds the gradients of the cameras of one batch item in order, so the bits are the same for any number of threads.
void add_gradients(const std::vector<CameraResult>& results, std::int64_t item, std::int64_t cameras, float weight[2],
                   float* model_to_data, float* data_to_model) {
  float* const out[2] = {model_to_data, data_to_model};
  for (std::int64_t c = 0; c < cameras; ++c) {
    for (const VertexGradient& g : results[item * cameras + c].gradients) {
      for (int s = 0; s < 2; ++s) {
        for (int d = 0; d < 3; ++d) out[s][3 * static_cast<std::int64_t>(g.vertex) + d] += weight[s] * g.gradient[s][d];
      }
    }
  }
}

std::vector<CameraResult> evaluate_cameras(std::int64_t views, const bool* valid,
                                           const std::function<CameraInput(std::int64_t)>& input) {
  std::vector<CameraResult> results(views);
  std::atomic<std::int64_t> next{0};
  at::parallel_for(0, std::min<std::int64_t>(views, at::get_num_threads()), 1,
                   [&](std::int64_t begin, std::int64_t end) {
                     CameraScratch scratch;
                     for (std::int64_t worker = begin; worker < end; ++worker) {
                       for (std::int64_t i = next++; i < views; i = next++) {
                         if (valid[i]) results[i] = evaluate_camera(input(i), scratch);
                       }
                     }
                   });
  return results;
}

/// @return both sums [2] and their gradients to the vertices [2,B,N,3]
std::tuple<Tensor, Tensor> silhouette_cpu(const Tensor& vertices_in, const Tensor& normals_in,
                                          const Tensor& boundary_in, const Tensor& projection_in,
                                          const Tensor& distance_in, const Tensor& scale_in,
                                          const Tensor& contour_scale_in, const Tensor& valid_in,
                                          const Tensor& contour_in, const Tensor& offsets_in, double model_to_data,
                                          double data_to_model, double radius, double inset) {
  const auto floats = [](const Tensor& t) { return t.to(torch::kFloat32).contiguous(); };
  const Tensor vertices = floats(vertices_in), normals = floats(normals_in), projection = floats(projection_in);
  const Tensor distance = floats(distance_in), scale = floats(scale_in), contour = floats(contour_in),
               contour_scale = floats(contour_scale_in);
  const Tensor boundary = boundary_in.contiguous(), valid = valid_in.contiguous(), offsets = offsets_in.contiguous();
  const std::int64_t batch = vertices.size(0), num_vertices = vertices.size(1), cameras = projection.size(1),
                     size = distance.size(3);
  TORCH_CHECK(
      boundary.sizes() == torch::IntArrayRef({batch, cameras, num_vertices}) && offsets.numel() == batch * cameras + 1,
      kSilhouetteLossOp, ": boundary must be [B,C,N] and contour_offsets [B*C+1], found ", boundary.sizes(), " and ",
      offsets.sizes());
  const std::int64_t* first = offsets.data_ptr<std::int64_t>();
  const bool* use = valid.data_ptr<bool>();

  const std::vector<CameraResult> results = evaluate_cameras(batch * cameras, use, [&](std::int64_t i) {
    const std::int64_t item = i / cameras;
    return CameraInput{vertices.data_ptr<float>() + 3 * num_vertices * item,
                       normals.data_ptr<float>() + 3 * num_vertices * item,
                       boundary.data_ptr<bool>() + num_vertices * i,
                       num_vertices,
                       projection.data_ptr<float>() + 12 * i,
                       distance.data_ptr<float>() + size * size * i,
                       size,
                       contour.data_ptr<float>() + 2 * first[i],
                       first[i + 1] - first[i],
                       scale.data_ptr<float>()[i],
                       static_cast<float>(inset),
                       contour_scale.data_ptr<float>()[i],
                       static_cast<float>(radius),
                       model_to_data != 0,
                       data_to_model != 0};
  });

  const auto num_valid = std::max<std::int64_t>(std::count(use, use + batch * cameras, true), 1);
  const double weight[2] = {model_to_data / static_cast<double>(num_valid),
                            data_to_model / static_cast<double>(num_valid)};
  double sums[2] = {0, 0};
  for (const CameraResult& r : results) {
    for (int s = 0; s < 2; ++s) sums[s] += r.value[s] * weight[s];
  }
  Tensor values = torch::empty({2}, torch::kFloat32),
         gradient = torch::zeros({2, batch, num_vertices, 3}, torch::kFloat32);
  for (int s = 0; s < 2; ++s) values.data_ptr<float>()[s] = static_cast<float>(sums[s]);
  at::parallel_for(0, batch, 1, [&](std::int64_t begin, std::int64_t end) {
    float w[2] = {static_cast<float>(weight[0]), static_cast<float>(weight[1])};
    float* out = gradient.data_ptr<float>();
    for (std::int64_t b = begin; b < end; ++b) {
      add_gradients(results, b, cameras, w, out + 3 * num_vertices * b, out + 3 * num_vertices * (batch + b));
    }
  });
  return {values, gradient};
}

Tensor silhouette_backward_cpu(const Tensor& upstream, const Tensor& gradient) {
  return upstream[0] * gradient[0] + upstream[1] * gradient[1];
}

class SilhouetteFunction : public torch::autograd::Function<SilhouetteFunction> {
 public:
  static Tensor forward(AutogradContext* context, const Tensor& vertices, const Tensor& normals, const Tensor& boundary,
                        const SilhouetteTarget& target, const ResidualScales& scales,
                        const SilhouetteOptions& options) {
    static const auto op = find_op<decltype(silhouette_cpu)>("doppel::silhouette_loss");
    at::AutoDispatchBelowADInplaceOrView guard;
    auto [values, gradient] =
        op.call(vertices, normals, boundary, target.projection, target.distance, scales.model_to_data,
                scales.data_to_model, target.valid, target.contour, target.contour_offsets, options.model_to_data,
                options.data_to_model, options.contour_radius, options.inset);
    context->save_for_backward({gradient});
    return values;
  }

  static variable_list backward(AutogradContext* context, variable_list upstream) {
    static const auto op = find_op<decltype(silhouette_backward_cpu)>("doppel::silhouette_loss_backward");
    const Tensor gradient = context->get_saved_variables()[0];
    Tensor to_vertices;
    {
      at::AutoDispatchBelowADInplaceOrView guard;
      to_vertices = op.call(upstream[0], gradient);
    }
    return once_differentiable({to_vertices, Tensor(), Tensor(), Tensor(), Tensor(), Tensor()}, "silhouette_loss");
  }
};

}  // namespace

SilhouetteLoss fused(const Tensor& vertices, const Tensor& normals, const Tensor& boundary,
                     const SilhouetteTarget& target, const ResidualScales& scales, const SilhouetteOptions& options) {
  const Tensor values = SilhouetteFunction::apply(vertices, normals, boundary, target, scales, options);
  return {values[0], values[1]};
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "silhouette_loss(Tensor vertices, Tensor normals, Tensor boundary, Tensor projection, Tensor distance, Tensor "
      "residual_scale, Tensor contour_scale, Tensor valid, Tensor contour, Tensor contour_offsets, float "
      "model_to_data, float data_to_model, "
      "float radius, float inset) -> (Tensor values, Tensor gradient)");
  m.def("silhouette_loss_backward(Tensor upstream, Tensor gradient) -> Tensor");
}

TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("silhouette_loss", &silhouette_cpu);
  m.impl("silhouette_loss_backward", &silhouette_backward_cpu);
}

}  // namespace doppel::silhouette
