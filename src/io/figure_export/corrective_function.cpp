#include "doppel/io/figure_export/corrective_function.h"

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

/// v(q)
Eigen::Vector3d half_turn_vector(const Eigen::Quaterniond& turn) { return (turn.w() < 0.0 ? -2.0 : 2.0) * turn.vec(); }

}  // namespace

Eigen::Index CorrectiveFunction::num_inputs() const {
  return static_cast<Eigen::Index>(parents.size() * (3 + 6 * lags.size()));
}

Eigen::VectorXf CorrectiveFunction::inputs(const std::vector<std::vector<Eigen::Affine3d>>& poses) const {
  std::vector<std::vector<Eigen::Quaterniond>> turns;
  for (const std::vector<Eigen::Affine3d>& pose : poses)
    for (turns.emplace_back(); const Eigen::Affine3d& bone : pose)
      turns.back().push_back(Eigen::Quaterniond(bone.linear()).normalized());
  Eigen::VectorXf x(num_inputs());
  Eigen::Index at = 0;
  const auto append = [&](const Eigen::Vector3d& values) {
    x.segment<3>(at) = values.cast<float>();
    at += 3;
  };
  for (std::size_t b = 0; b < parents.size(); ++b) {
    const Eigen::Quaterniond back = turns[0][b].conjugate();
    if (parents[b] < 0)
      append(back * Eigen::Vector3d::UnitY());
    else
      append(half_turn_vector(rest[b].conjugate() * turns[0][as_size(parents[b])].conjugate() * turns[0][b]));
    for (std::size_t l = 1; l <= lags.size(); ++l) {
      append(back * (poses[l][b].translation() - poses[0][b].translation()));
      append(half_turn_vector(back * turns[l][b]));
    }
  }
  return x;
}

Eigen::VectorXf CorrectiveFunction::weights(const Eigen::VectorXf& inputs) const {
  const Eigen::VectorXf z = ((inputs - mean).array() * scale.array()).max(-limit).min(limit).matrix();
  const Eigen::VectorXf inner = (hidden_offset + hidden * z).array().tanh().matrix();
  return (offset + linear * z + output * inner).array().max(0.0F).min(1.0F).matrix();
}

std::vector<Eigen::Affine3d> HelperFunction::transforms(const Eigen::VectorXf& inputs) const {
  const Eigen::VectorXd numbers = (low + (high - low).cwiseProduct(shares.weights(inputs))).cast<double>();
  std::vector<Eigen::Affine3d> helpers;
  for (Eigen::Index at = 0; at < numbers.size(); at += 6) {
    const Eigen::Vector3d turn = numbers.segment<3>(at + 3);
    const double angle = turn.norm();
    helpers.push_back(Eigen::Translation3d(numbers.segment<3>(at)) *
                      Eigen::AngleAxisd(angle, angle > 0.0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d::UnitX()));
  }
  return helpers;
}

}  // namespace doppel
