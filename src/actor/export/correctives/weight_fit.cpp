#include "doppel/actor/export/correctives/weight_fit.h"

#include <torch/optim/adam.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr std::array kRidges{1e-4, 1e-3, 1e-2, 1e-1, 1.0};  ///< of the number of samples, for standardised inputs
constexpr double kMinDeviation = 1e-4;                      ///< inputs below are constant: metres, or radians
constexpr int kSamplesAtOnce = 256, kStepsBetweenChecks = 100;
constexpr double kLearningRate = 5e-3, kWeightDecay = 1e-4;
constexpr int kHeldOutEvery = 10;

Eigen::MatrixXf matrix_of(const Tensor& tensor) {
  const Tensor rows = tensor.detach().to(torch::kFloat32).contiguous();
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(rows.data_ptr<float>(), rows.size(0),
                                rows.numel() / std::max<int64_t>(rows.size(0), 1));
}

Eigen::VectorXf vector_of(const Tensor& tensor) { return matrix_of(tensor.reshape({-1, 1})); }

/// Rows of equal length as a tensor [S,n].
Tensor tensor_of_rows(const std::vector<Eigen::VectorXf>& rows) {
  const Tensor result =
      torch::empty({static_cast<std::int64_t>(rows.size()), static_cast<std::int64_t>(rows.front().size())});
  float* out = result.data_ptr<float>();
  for (const Eigen::VectorXf& row : rows) out = std::copy_n(row.data(), row.size(), out);
  return result;
}

/// The samples as the function sees them: z, and the weights relative to their mean, in units of their deviation.
struct Standardised {
  Tensor mean, scale;        // [I]
  Tensor weight_mean, unit;  // [K], []
  Tensor z, y;               // to fit
  Tensor held_z, held_y;

  Standardised(const WeightSamples& samples, double limit) {
    const Tensor fitted = samples.held_out.logical_not().nonzero().flatten(),
                 held = samples.held_out.nonzero().flatten();
    if (fitted.numel() < 2 || held.numel() < 1)
      fail("fitting the weights of correctives: {} samples to fit and {} held out; at least 2 and 1 are needed",
           fitted.numel(), held.numel());
    const Tensor inputs = samples.inputs.index_select(0, fitted), weights = samples.weights.index_select(0, fitted);
    mean = inputs.mean(0);
    const Tensor deviation = inputs.std(0);
    scale = at::where(deviation < kMinDeviation, at::zeros_like(deviation),
                      deviation.clamp_min(kMinDeviation).reciprocal());
    weight_mean = weights.mean(0);
    unit = (weights - weight_mean).square().sum(1).mean().sqrt().clamp_min(1e-9);
    const auto standard = [&](const Tensor& x) { return ((x - mean) * scale).clamp(-limit, limit); };
    const auto relative = [&](const Tensor& w) { return (w - weight_mean) / unit; };
    z = standard(inputs);
    y = relative(weights);
    held_z = standard(samples.inputs.index_select(0, held));
    held_y = relative(samples.weights.index_select(0, held));
  }
};

/// The weights of an affine function with one hidden layer.
struct WeightLayers {
  Tensor linear, offset, hidden, hidden_offset, output;

  std::vector<Tensor> all() const { return {linear, offset, hidden, hidden_offset, output}; }
  Tensor operator()(const Tensor& z) const {
    return at::addmm(offset, z, linear.t()) + at::tanh(at::addmm(hidden_offset, z, hidden.t())).matmul(output.t());
  }
  WeightLayers copy() const {
    return {linear.detach().clone(), offset.detach().clone(), hidden.detach().clone(), hidden_offset.detach().clone(),
            output.detach().clone()};
  }
};

/// Mean distance of the weights: for orthonormal shapes near to the mean distance of the vertices.
double error_of(const WeightLayers& layers, const Standardised& s) {
  const torch::NoGradGuard no_gradient;
  return (layers(s.held_z) - s.held_y).norm(2, 1).mean().item<double>();
}

/// The affine part [K, I + 1] with the ridge that is best for the samples held out.
Tensor affine_part(const Standardised& s) {
  const auto with_one = [](const Tensor& z) { return at::cat({z, at::ones({z.size(0), 1})}, 1).to(torch::kFloat64); };
  const Tensor z = with_one(s.z), held = with_one(s.held_z), y = s.y.to(torch::kFloat64);
  const Tensor gram = z.t().matmul(z), right = z.t().matmul(y);
  Tensor best;
  double least = 0.0;
  for (const double ridge : kRidges) {
    const Tensor damped = gram + at::eye(gram.size(0), gram.options()) * (ridge * static_cast<double>(z.size(0)));
    const Tensor found = at::linalg_solve(damped, right);
    const double error = (held.matmul(found) - s.held_y).norm(2, 1).mean().item<double>();
    if (best.defined() && error >= least) continue;
    best = found;
    least = error;
  }
  return best.t().to(torch::kFloat32);
}

WeightLayers first_layers(const Standardised& s, int hidden, at::Generator& generator) {
  const Tensor affine = affine_part(s);
  const int64_t inputs = s.z.size(1), outputs = s.y.size(1);
  return {affine.narrow(1, 0, inputs).clone(), affine.select(1, inputs).clone(),
          at::randn({hidden, inputs}, generator) / std::sqrt(static_cast<double>(inputs)), at::zeros({hidden}),
          at::zeros({outputs, hidden})};
}

/// Trains all layers; the result is the best for the samples held out.
WeightLayers trained_layers(const Standardised& s, const WeightFitOptions& options) {
  const torch::AutoGradMode with_gradients(true);
  auto generator = at::detail::createCPUGenerator(options.seed);
  WeightLayers layers = first_layers(s, options.hidden, generator), best = layers.copy();
  double least = error_of(layers, s);
  for (Tensor& tensor : layers.all()) tensor.requires_grad_(true);
  torch::optim::Adam adam(layers.all(), torch::optim::AdamOptions(kLearningRate).weight_decay(0.0));
  Progress progress("fitting the function", options.steps);
  for (int step = 1; step <= options.steps; ++step) {
    if (stop_requested()) fail("fitting the weights of correctives: stopped at step {} of {}", step, options.steps);
    const Tensor rows = at::randint(s.z.size(0), {kSamplesAtOnce}, generator, at::TensorOptions().dtype(torch::kInt64));
    const Tensor off = layers(s.z.index_select(0, rows)) - s.y.index_select(0, rows);
    Tensor loss = off.square().sum(1).mean();
    for (const Tensor& matrix : {layers.linear, layers.hidden, layers.output})
      loss = loss + kWeightDecay * matrix.square().sum();
    adam.zero_grad();
    loss.backward();
    const double share = 0.5 * (1.0 + std::cos(M_PI * step / options.steps));
    for (auto& group : adam.param_groups()) group.options().set_lr(kLearningRate * (0.01 + 0.99 * share));
    adam.step();
    progress.advance(1);
    if (step % kStepsBetweenChecks != 0) continue;
    if (const double error = error_of(layers, s); error < least) {
      least = error;
      best = layers.copy();
    }
  }
  return best;
}

}  // namespace

void SampleList::add(Eigen::VectorXf inputs, Eigen::VectorXf weights, bool held_out) {
  inputs_.push_back(std::move(inputs));
  weights_.push_back(std::move(weights));
  held_out_.push_back(held_out ? 1 : 0);
}

void SampleList::add(Eigen::VectorXf inputs, Eigen::VectorXf weights) {
  const bool held_out = inputs_.size() % kHeldOutEvery == 0;
  add(std::move(inputs), std::move(weights), held_out);
}

WeightSamples SampleList::tensors() const {
  return {tensor_of_rows(inputs_), tensor_of_rows(weights_), torch::tensor(held_out_).to(torch::kBool)};
}

Eigen::VectorXf SampleList::low() const {
  Eigen::VectorXf result = weights_.front();
  for (const Eigen::VectorXf& weights : weights_) result = result.cwiseMin(weights);
  return result;
}

Eigen::VectorXf SampleList::high() const {
  Eigen::VectorXf result = weights_.front();
  for (const Eigen::VectorXf& weights : weights_) result = result.cwiseMax(weights);
  return result;
}

void fit_weights(const WeightSamples& samples, const WeightFitOptions& options, CorrectiveFunction& function) {
  const Standardised s(samples, function.limit);
  const WeightLayers layers = trained_layers(s, options);
  function.mean = vector_of(s.mean);
  function.scale = vector_of(s.scale);
  function.linear = matrix_of(layers.linear * s.unit);
  function.offset = vector_of(layers.offset * s.unit + s.weight_mean);
  function.hidden = matrix_of(layers.hidden);
  function.hidden_offset = vector_of(layers.hidden_offset);
  function.output = matrix_of(layers.output * s.unit);
}

void mix_weights(CorrectiveFunction& function, const Eigen::MatrixXf& matrix, const Eigen::VectorXf& offset) {
  function.linear = matrix * function.linear;
  function.output = matrix * function.output;
  function.offset = matrix * function.offset + offset;
}

void scale_weights(CorrectiveFunction& function, const Eigen::VectorXf& low, const Eigen::VectorXf& high) {
  const Eigen::VectorXf factor = (high - low).cwiseMax(1e-9F).cwiseInverse();
  function.linear = factor.asDiagonal() * function.linear;
  function.output = factor.asDiagonal() * function.output;
  function.offset = (function.offset - low).cwiseProduct(factor);
}

}  // namespace doppel
