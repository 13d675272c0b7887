#include "doppel/rig/offset_problem.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/rig/quantiles.h"

namespace doppel {
namespace {

constexpr int kTerms = 5;
constexpr double kSecondsOfStretch = 0.5;  // errors of keypoints that are farther apart are independent
constexpr double kSampleGroup = 10.0;      // rows whose errors are about the same

}  // namespace

OffsetProblem::OffsetProblem(const std::vector<Camera>& cameras, const PointTracks& tracks,
                             const std::vector<std::pair<int, int>>& pairs, std::vector<double> times,
                             const OffsetProblemOptions& options)
    : cameras_(cameras), tracks_(tracks), times_(std::move(times)), options_(options) {
  if (!times_.empty()) middle_ = 0.5 * (times_.front() + times_.back());
  for (int c = 0; c < tracks_.num_cameras(); ++c) {
    index_.push_back(c == options.reference ? -1 : static_cast<int>(num_camera_unknowns_));
    if (c != options.reference) num_camera_unknowns_ += options.drift ? 2 : 1;
  }
  for (const auto& [a, b] : pairs) {
    const double scale = 2048.0 / (cameras[as_size(a)].width + cameras[as_size(b)].width);
    pairs_.push_back({a, b, EpipolarPair(cameras[as_size(a)], cameras[as_size(b)]), scale, {}, {}});
  }
}

const MovingPoint& OffsetProblem::sampled(int camera, int time, int point) const {
  return samples_[(as_size(camera) * times_.size() + as_size(time)) * as_size(tracks_.num_points()) + as_size(point)];
}

void OffsetProblem::sample(const Eigen::VectorXd& state) {
  const std::size_t points = as_size(tracks_.num_points());
  samples_.resize(tracks_.cameras.size() * times_.size() * points);
  std::size_t next = 0;
  for (std::size_t c = 0; c < tracks_.cameras.size(); ++c) {
    const CameraTrack& track = tracks_.cameras[c];
    const int index = index_[c];
    for (const double time : times_) {
      double later = index < 0 ? 0.0 : state[index];
      if (index >= 0 && options_.drift) later += state[index + 1] * (time - middle_);
      const double frame = track.frame_at(time) + later * track.fps;
      for (std::size_t k = 0; k < points; ++k)
        samples_[next++] = smooth_sample(track, frame, static_cast<int>(k), options_.width * track.fps);
    }
  }
}

OffsetProblem::Residual OffsetProblem::residual(std::size_t index, const Row& row, const Eigen::VectorXd& state) const {
  const Pair& pair = pairs_[index];
  const MovingPoint &a = sampled(pair.a, row.time, row.point), &b = sampled(pair.b, row.time, row.point);
  Residual result;
  if (!a.seen || !b.seen) return result;
  const Camera &in_a = cameras_[as_size(pair.a)], &in_b = cameras_[as_size(pair.b)];
  const Eigen::Vector3d line_in_b = pair.geometry.fundamental() * a.pixel.homogeneous();
  const Eigen::Vector3d line_in_a = pair.geometry.fundamental().transpose() * b.pixel.homogeneous();
  const double slope = std::sqrt(line_in_a.head<2>().squaredNorm() + line_in_b.head<2>().squaredNorm());
  if (!(slope > 0.0)) return result;
  result.valid = true;
  result.terms << 1.0, a.pixel.x() / in_a.width - 0.5, a.pixel.y() / in_a.height - 0.5, b.pixel.x() / in_b.width - 0.5,
      b.pixel.y() / in_b.height - 0.5;
  const Eigen::Index first = num_camera_unknowns_ + kTerms * static_cast<Eigen::Index>(index);
  result.value =
      pair.scale * b.pixel.homogeneous().dot(line_in_b) / slope + result.terms.dot(state.segment<kTerms>(first));
  result.by_a = pair.scale * line_in_a.head<2>().dot(a.velocity) / slope;
  result.by_b = pair.scale * line_in_b.head<2>().dot(b.velocity) / slope;
  return result;
}

void OffsetProblem::begin_round(const Eigen::VectorXd& state, double kernel, double factor) {
  sample(state);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    Pair& pair = pairs_[p];
    pair.rows.clear();
    std::vector<double> sizes;
    for (int t = 0; t < static_cast<int>(times_.size()); ++t)
      for (int k = 0; k < tracks_.num_points(); ++k) {
        const Residual found = residual(p, {t, k}, state);
        if (!found.valid) continue;
        pair.rows.push_back({t, k});
        sizes.push_back(std::abs(found.value));
      }
    pair.kernel = RobustKernel::geman_mcclure_of(std::max(kernel, factor * quantile(sizes, 0.5)));
  }
}

/// The weight of the squared bias terms. They have the variance of the noise of a row over that of the terms; rows
/// whose errors are the same count once.
double OffsetProblem::prior_weight(const Pair& pair) const {
  const double noise = pair.kernel.scale / 3.0, allowed = options_.calibration_error;
  return kSampleGroup * noise * noise / (allowed * allowed);
}

double OffsetProblem::cost(const Eigen::VectorXd& state) {
  sample(state);
  last_cost_ = 0.0;
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const Pair& pair = pairs_[p];
    for (const Row& row : pair.rows) {
      const Residual found = residual(p, row, state);
      const double worst = pair.kernel.scale * pair.kernel.scale;
      last_cost_ += found.valid ? pair.kernel.cost(found.value * found.value) : worst;
    }
    const Eigen::Index first = num_camera_unknowns_ + kTerms * static_cast<Eigen::Index>(p);
    last_cost_ += prior_weight(pair) * state.segment<kTerms>(first).squaredNorm();
  }
  return last_cost_;
}

void OffsetProblem::add(std::size_t p, const Row& row, const Residual& found) {
  const Pair& pair = pairs_[p];
  const double weight = pair.kernel.weight(found.value * found.value);
  const double seconds = times_[as_size(row.time)];
  Eigen::Matrix<double, 4 + kTerms, 1> jacobian;
  std::array<Eigen::Index, 4 + kTerms> at{};
  Eigen::Index count = 0;
  for (const auto& [camera, by_frame] : {std::pair{pair.a, found.by_a}, {pair.b, found.by_b}}) {
    if (index_[as_size(camera)] < 0) continue;
    const double by_seconds = by_frame * tracks_.cameras[as_size(camera)].fps;
    at[as_size(count)] = index_[as_size(camera)];
    jacobian[count++] = by_seconds;
    if (!options_.drift) continue;
    at[as_size(count)] = index_[as_size(camera)] + 1;
    jacobian[count++] = by_seconds * (seconds - middle_);
  }
  for (int i = 0; i < kTerms; ++i) {
    at[as_size(count)] = num_camera_unknowns_ + kTerms * static_cast<Eigen::Index>(p) + i;
    jacobian[count++] = found.terms[i];
  }
  const auto stretch = as_size((seconds - times_.front()) / kSecondsOfStretch);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double pull = weight * jacobian[i] * found.value;
    gradient_[at[as_size(i)]] += pull;
    stretches_[stretch][at[as_size(i)]] += pull;
    for (Eigen::Index j = 0; j < count; ++j)
      hessian_(at[as_size(i)], at[as_size(j)]) += weight * jacobian[i] * jacobian[j];
  }
}

double OffsetProblem::linearise(const Eigen::VectorXd& state) {
  const double found = cost(state);
  hessian_.setZero(num_unknowns(), num_unknowns());
  gradient_.setZero(num_unknowns());
  const double length = times_.empty() ? 0.0 : times_.back() - times_.front();
  stretches_.assign(as_size(length / kSecondsOfStretch) + 1, Eigen::VectorXd::Zero(num_unknowns()));
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    for (const Row& row : pairs_[p].rows) {
      const Residual here = residual(p, row, state);
      if (here.valid) add(p, row, here);
    }
    const Eigen::Index first = num_camera_unknowns_ + kTerms * static_cast<Eigen::Index>(p);
    const double weight = prior_weight(pairs_[p]);
    hessian_.diagonal().segment<kTerms>(first).array() += weight;
    gradient_.segment<kTerms>(first) += weight * state.segment<kTerms>(first);
  }
  return found;
}

bool OffsetProblem::solve(double damping, Eigen::VectorXd& step) {
  Eigen::MatrixXd damped = hessian_;
  for (Eigen::Index i = 0; i < damped.rows(); ++i)
    damped(i, i) = damped(i, i) > 0.0 ? damped(i, i) * (1.0 + damping) : 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(damped);
  if (factor.info() != Eigen::Success) return false;
  step = factor.solve(-gradient_);
  return step.allFinite();
}

std::vector<long> OffsetProblem::samples() const {
  std::vector<long> counts(tracks_.cameras.size(), 0);
  for (const Pair& pair : pairs_)
    for (const int camera : {pair.a, pair.b}) counts[as_size(camera)] += static_cast<long>(pair.rows.size());
  return counts;
}

Eigen::MatrixXd OffsetProblem::covariance() const {
  Eigen::MatrixXd regular = hessian_;
  for (Eigen::Index i = 0; i < regular.rows(); ++i) regular(i, i) = std::max(1e-12, regular(i, i) * (1.0 + 1e-9));
  const Eigen::MatrixXd inverse = regular.llt().solve(Eigen::MatrixXd::Identity(regular.rows(), regular.cols()));
  const auto count = static_cast<double>(stretches_.size());
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(regular.rows(), regular.cols());
  for (const Eigen::VectorXd& stretch : stretches_) spread += stretch * stretch.transpose();
  for (std::size_t p = 0; p < pairs_.size(); ++p) {  // the bias terms are as uncertain as their prior says
    const Eigen::Index first = num_camera_unknowns_ + kTerms * static_cast<Eigen::Index>(p);
    const double weight = prior_weight(pairs_[p]) * options_.calibration_error;
    spread.diagonal().segment<kTerms>(first).array() += weight * weight;
  }
  return inverse * spread * inverse * (count / std::max(1.0, count - 1.0));
}

}  // namespace doppel
