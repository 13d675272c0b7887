#include <ATen/Parallel.h>

#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/global_alignment/global_alignment.h"
#include "doppel/layers/global_alignment/global_alignment_checks.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

const char* const kAlignmentOp = "doppel::global_alignment";

using Vector = std::array<double, 3>;
/// A symmetric matrix: xx xy xz yy yz zz.
using Symmetric = std::array<double, 6>;

Vector operator*(const Symmetric& a, const Vector& x) {
  return {a[0] * x[0] + a[1] * x[1] + a[2] * x[2], a[1] * x[0] + a[3] * x[1] + a[4] * x[2],
          a[2] * x[0] + a[4] * x[1] + a[5] * x[2]};
}
double squared_norm(const Symmetric& a) {
  return a[0] * a[0] + a[3] * a[3] + a[5] * a[5] + 2.0 * (a[1] * a[1] + a[2] * a[2] + a[4] * a[4]);
}
Symmetric adjugate(const Symmetric& a) {
  return {a[3] * a[5] - a[4] * a[4], a[2] * a[4] - a[1] * a[5], a[1] * a[4] - a[2] * a[3],
          a[0] * a[5] - a[2] * a[2], a[1] * a[2] - a[0] * a[4], a[0] * a[3] - a[1] * a[1]};
}
double determinant(const Symmetric& a, const Symmetric& adj) { return a[0] * adj[0] + a[1] * adj[1] + a[2] * adj[2]; }
bool is_finite(const double* x) { return std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]); }

/// One sample of the batch: its rays, and the sums over them.
class Sample {
 public:
  Sample(const double* origin, const double* direction, const double* confidence, int64_t num_cameras,
         int64_t num_landmarks, const GlobalAlignmentOptions& options)
      : per_landmark_(num_landmarks, Symmetric{}) {
    for (int64_t c = 0; c < num_cameras; ++c, origin += 3) {
      if (!is_finite(origin)) continue;
      for (int64_t m = 0; m < num_landmarks; ++m) {
        const int64_t ray = c * num_landmarks + m;
        add(m, origin, direction + 3 * ray, confidence[ray], options);
      }
    }
    const double trace = matrix_[0] + matrix_[3] + matrix_[5];
    scale_ = trace > 0.0 ? trace / 3.0 : 1.0;
    for (double& entry : matrix_) entry /= scale_;
    const Symmetric adj = adjugate(matrix_);
    const double det = determinant(matrix_, adj);
    valid_ = count_ >= 2 && det > 0.0 &&
             std::sqrt(squared_norm(matrix_) * squared_norm(adj)) <= options.largest_condition * det;
  }

  /// @param points [M,3] @return whether the translation is determined
  bool solve(const float* points, const Vector& prior, double damping, float* translation) const {
    Vector right = from_origins_;
    bool valid = valid_;
    for (const Symmetric& projector : per_landmark_) {
      Vector p{points[0], points[1], points[2]};
      points += 3;
      for (double& coordinate : p) {
        if (std::isfinite(coordinate)) continue;
        coordinate = 0.0;
        valid = false;
      }
      const Vector weighted = projector * p;
      for (int i = 0; i < 3; ++i) right[i] -= weighted[i];
    }
    const double pull = valid ? 0.0 : damping;
    for (int i = 0; i < 3; ++i) right[i] = right[i] / scale_ + pull * (std::isfinite(prior[i]) ? prior[i] : 0.0);
    const Vector t = solve(right, pull);
    for (int i = 0; i < 3; ++i) translation[i] = static_cast<float>(t[i]);
    return valid;
  }

  /// dL/dp_m = -W_m A^-1 dL/dt of a valid sample. @param grad_points [M,3]
  void pull_back(const float* grad, float* grad_points) const {
    const Vector right{grad[0] / scale_, grad[1] / scale_, grad[2] / scale_};
    const Vector through = solve(right, 0.0);
    for (const Symmetric& projector : per_landmark_) {
      const Vector g = projector * through;
      for (int i = 0; i < 3; ++i) *grad_points++ = static_cast<float>(-g[i]);
    }
  }

 private:
  void add(int64_t landmark, const double* o, const double* d, double confidence,
           const GlobalAlignmentOptions& options) {
    if (!(confidence >= options.confidence_threshold) || !(confidence > 0.0)) return;
    if (!std::isfinite(confidence) || !is_finite(d)) return;
    const double sigma = options.binary ? 1.0 : confidence;
    const Symmetric projector{sigma * (1.0 - d[0] * d[0]), -sigma * d[0] * d[1], -sigma * d[0] * d[2],
                              sigma * (1.0 - d[1] * d[1]), -sigma * d[1] * d[2], sigma * (1.0 - d[2] * d[2])};
    const Vector moment = projector * Vector{o[0], o[1], o[2]};
    for (int i = 0; i < 6; ++i) {
      per_landmark_[landmark][i] += projector[i];
      matrix_[i] += projector[i];
    }
    for (int i = 0; i < 3; ++i) from_origins_[i] += moment[i];
    ++count_;
  }

  Vector solve(const Vector& right, double pull) const {
    Symmetric damped = matrix_;
    for (int diagonal : {0, 3, 5}) damped[diagonal] += pull;
    const Symmetric adj = adjugate(damped);
    const double det = determinant(damped, adj);
    Vector x = adj * right;
    for (double& value : x) value /= det;
    return x;
  }

  std::vector<Symmetric> per_landmark_;  ///< W_m = sum over cameras of sigma Q
  Symmetric matrix_{};                   ///< A / scale
  Vector from_origins_{};                ///< sum of sigma Q o
  double scale_ = 1.0;                   ///< trace(A) / 3
  int count_ = 0;
  bool valid_ = false;
};

/// The data of one call. The tensors own the memory that the pointers refer to.
struct AlignmentCall {
  /// @param rays origin, direction, confidence
  AlignmentCall(const Tensor& points_in, at::TensorList rays, double threshold, bool binary, double damping,
                double condition)
      : options{threshold, binary, damping, condition} {
    TORCH_CHECK(rays.size() == 3, kAlignmentOp, ": rays must hold origin, direction, confidence");
    check_floats(kAlignmentOp, "points", points_in, {-1, -1, 3}, "[B,M,3]");
    check_alignment_arguments(points_in, {rays[0], rays[1], rays[2]}, {});
    points = points_in.contiguous();
    origin = rays[0].to(torch::kFloat64).contiguous();
    direction = rays[1].to(torch::kFloat64).contiguous();
    confidence = rays[2].to(torch::kFloat64).contiguous();
  }

  Sample sample(int64_t b) const {
    const int64_t C = origin.size(1), M = points.size(1);
    return {origin.data_ptr<double>() + b * C * 3,
            direction.data_ptr<double>() + b * C * M * 3,
            confidence.data_ptr<double>() + b * C * M,
            C,
            M,
            options};
  }
  const float* points_of(int64_t b) const { return points.data_ptr<float>() + b * points.size(1) * 3; }

  template <typename Work>
  void for_each_sample(const Work& work) const {
    at::parallel_for(0, points.size(0), 4, [&](int64_t begin, int64_t end) {
      for (int64_t b = begin; b < end; ++b) work(b);
    });
  }

  GlobalAlignmentOptions options;
  Tensor points, origin, direction, confidence;
};

std::tuple<Tensor, Tensor> alignment_cpu(const Tensor& points, at::TensorList rays, const Tensor& prior_in,
                                         double threshold, bool binary, double damping, double condition) {
  const AlignmentCall call(points, rays, threshold, binary, damping, condition);
  check_shape(kAlignmentOp, "prior", prior_in, {points.size(0), 3}, "[B,3]");
  const Tensor prior = prior_in.to(torch::kFloat64).contiguous();
  Tensor translation = at::empty({points.size(0), 3}, call.points.options());
  Tensor valid = at::empty({points.size(0)}, call.points.options().dtype(torch::kBool));
  call.for_each_sample([&](int64_t b) {
    const double* position = prior.data_ptr<double>() + 3 * b;
    valid.data_ptr<bool>()[b] = call.sample(b).solve(call.points_of(b), {position[0], position[1], position[2]},
                                                     call.options.damping, translation.data_ptr<float>() + 3 * b);
  });
  return {translation, valid};
}

Tensor alignment_backward_cpu(const Tensor& grad_in, const Tensor& points, at::TensorList rays, const Tensor& valid,
                              double threshold, bool binary, double damping, double condition) {
  const AlignmentCall call(points, rays, threshold, binary, damping, condition);
  TORCH_CHECK(grad_in.scalar_type() == torch::kFloat32 && grad_in.numel() == 3 * points.size(0), kAlignmentOp,
              "_backward: grad must be float32 [B,3], found ", describe(grad_in));
  const Tensor grad = grad_in.contiguous();
  Tensor grad_points = at::zeros_like(call.points);
  call.for_each_sample([&](int64_t b) {
    if (!valid.data_ptr<bool>()[b]) return;
    call.sample(b).pull_back(grad.data_ptr<float>() + 3 * b, grad_points.data_ptr<float>() + b * points.size(1) * 3);
  });
  return grad_points;
}

std::tuple<Tensor, Tensor> call_forward(const Tensor& points, at::TensorList rays, const Tensor& prior,
                                        const GlobalAlignmentOptions& o) {
  static const auto op = find_op<decltype(alignment_cpu)>(kAlignmentOp);
  return op.call(points, rays, prior, o.confidence_threshold, o.binary, o.damping, o.largest_condition);
}

class AlignmentFunction : public torch::autograd::Function<AlignmentFunction> {
 public:
  static variable_list forward(AutogradContext* ctx, const Tensor& points, const std::vector<Tensor>& rays,
                               const Tensor& prior, double threshold, bool binary, double damping, double condition) {
    at::AutoDispatchBelowADInplaceOrView below_autograd;
    const GlobalAlignmentOptions options{threshold, binary, damping, condition};
    const auto [translation, valid] = call_forward(points, rays, prior, options);
    ctx->save_for_backward({points, valid, rays[0], rays[1], rays[2]});
    ctx->saved_data["options"] = std::vector<double>{threshold, binary ? 1.0 : 0.0, damping, condition};
    ctx->mark_non_differentiable({valid});
    return {translation, valid};
  }

  static variable_list backward(AutogradContext* ctx, const variable_list& grads) {
    static const auto op = find_op<decltype(alignment_backward_cpu)>("doppel::global_alignment_backward");
    const variable_list saved = ctx->get_saved_variables();
    const std::vector<double> o = ctx->saved_data["options"].toDoubleVector();
    Tensor grad_points;
    {
      at::AutoDispatchBelowADInplaceOrView below_autograd;
      const std::vector<Tensor> rays(saved.begin() + 2, saved.end());
      grad_points = op.call(grads[0], saved[0], rays, saved[1], o[0], o[1] != 0.0, o[2], o[3]);
    }
    variable_list gradients(7);
    gradients[0] = grad_points;
    return once_differentiable(gradients, kAlignmentOp);
  }
};

std::tuple<Tensor, Tensor> alignment_autograd(const Tensor& points, at::TensorList rays, const Tensor& prior,
                                              double threshold, bool binary, double damping, double condition) {
  const variable_list out = AlignmentFunction::apply(points, rays.vec(), prior, threshold, binary, damping, condition);
  return {out[0], out[1]};
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.def(
      "global_alignment(Tensor points, Tensor[] rays, Tensor prior, float threshold, bool binary, float damping, "
      "float condition) -> (Tensor, Tensor)");
  m.def(
      "global_alignment_backward(Tensor grad, Tensor points, Tensor[] rays, Tensor valid, float threshold, "
      "bool binary, float damping, float condition) -> Tensor");
}
TORCH_LIBRARY_IMPL(doppel, CPU, m) {
  m.impl("global_alignment", TORCH_FN(alignment_cpu));
  m.impl("global_alignment_backward", TORCH_FN(alignment_backward_cpu));
}
TORCH_LIBRARY_IMPL(doppel, Autograd, m) { m.impl("global_alignment", TORCH_FN(alignment_autograd)); }

}  // namespace

GlobalAlignment global_alignment(const Tensor& points, const LandmarkRays& rays, const Tensor& prior,
                                 const GlobalAlignmentOptions& options) {
  check_alignment_arguments(points, rays, prior);
  if (!takes_kernel(points)) return global_alignment_reference(points, rays, prior, options);
  const Tensor towards = prior.defined() ? prior.detach() : torch::zeros_like(points.sum(1), torch::kFloat64);
  const auto [translation, valid] =
      call_forward(points, {rays.origin, rays.direction, rays.confidence}, towards, options);
  return {translation, valid};
}

}  // namespace doppel
