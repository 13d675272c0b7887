#pragma once

#include <torch/types.h>

#include <cstdint>
#include <vector>

#include "doppel/io/figure_export/corrective_function.h"

namespace doppel {

/// What a function of weights is fitted to. S samples, I inputs, K shapes.
struct WeightSamples {
  torch::Tensor inputs;    ///< float32 [S,I], of CorrectiveFunction::inputs
  torch::Tensor weights;   ///< float32 [S,K]; for orthonormal shapes their squared error is that of the vertices
  torch::Tensor held_out;  ///< bool [S]: not fitted, but used to choose the ridge and when to stop
};

/// Collects samples one by one.
class SampleList {
 public:
  /// @param inputs [I] @param weights [K]
  void add(Eigen::VectorXf inputs, Eigen::VectorXf weights, bool held_out);
  /// The same with every tenth sample held out.
  void add(Eigen::VectorXf inputs, Eigen::VectorXf weights);

  WeightSamples tensors() const;
  /// [K] the ends of the range of the weights.
  Eigen::VectorXf low() const;
  Eigen::VectorXf high() const;

 private:
  std::vector<Eigen::VectorXf> inputs_, weights_;
  std::vector<std::int64_t> held_out_;
};

struct WeightFitOptions {
  int hidden = 64;   ///< H
  int steps = 6000;  ///< of Adam
  std::uint64_t seed = 1;
};

/// Fits all numbers of a function but its bones and lags: first the affine part alone by least squares with a ridge,
/// then the affine part and the hidden layer together by Adam. Both minimise the squared error of the weights.
/// The range of the weights stays that of the samples; `scale_weights` brings it to 0 to 1.
/// @throws Error unless there are at least two samples to fit and one that is held out
void fit_weights(const WeightSamples& samples, const WeightFitOptions& options, CorrectiveFunction& function);

/// Replaces the weights w [K] by M w + offset. @param matrix M [L, K] @param offset [L]
void mix_weights(CorrectiveFunction& function, const Eigen::MatrixXf& matrix, const Eigen::VectorXf& offset);

/// Replaces each weight w by (w - low) / (high - low). @param low, high [K]
void scale_weights(CorrectiveFunction& function, const Eigen::VectorXf& low, const Eigen::VectorXf& high);

}  // namespace doppel
