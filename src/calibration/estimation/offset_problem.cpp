#include "doppel/calibration/estimation/offset_problem.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/statistics.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

constexpr double kSecondsOfStretch = 0.5;  // errors of keypoints that are farther apart are independent
constexpr double kMarginOfSample = 0.8;    // widths by which a sample may be moved
constexpr double kMinShareOfStretches = 0.3;
constexpr double kStepOfCurvature = 0.4;       // widths
constexpr double kSampleGroup = 10.0;          // rows whose errors are about the same
constexpr double kMinTangentKernel = 0.1;      // kernel of frontier points over the smallest kernel of points
constexpr double kMaxTangentPrecision = 12.0;  // times that a frontier point is surer than a point, at most

}  // namespace

OffsetProblem::OffsetProblem(const std::vector<Camera>& cameras, const PointTracks& tracks,
                             const std::vector<std::pair<int, int>>& pairs, std::vector<double> times,
                             const OffsetProblemOptions& options)
    : cameras_(cameras), tracks_(tracks), times_(std::move(times)), options_(options) {
  allowed_bias_ = options.calibration_error;
  if (!times_.empty()) middle_ = 0.5 * (times_.front() + times_.back());
  for (int c = 0; c < tracks_.num_cameras(); ++c) {
    index_.push_back(c == options.reference ? -1 : static_cast<int>(num_camera_unknowns_));
    if (c != options.reference) num_camera_unknowns_ += options.drift ? 2 : 1;
  }
  for (const auto& [a, b] : pairs) {
    const double scale = 2048.0 / (cameras[a].width + cameras[b].width);
    pairs_.push_back({a, b, EpipolarPair(cameras[a], cameras[b]), scale, {}, {}, 1.0});
  }
}

const MovingPoint& OffsetProblem::sampled(int camera, int time, int point) const {
  return samples_[(as_size(camera) * times_.size() + as_size(time)) * as_size(tracks_.num_points()) + as_size(point)];
}

double OffsetProblem::frame_at(const Eigen::VectorXd& state, std::size_t camera, double seconds) const {
  const CameraTrack& track = tracks_.cameras[camera];
  const int index = index_[camera];
  if (index < 0) return track.frame_at(seconds);
  const double later = state[index] + (options_.drift ? state[index + 1] * (seconds - middle_) : 0.0);
  return track.frame_at(seconds) + later * track.fps;
}

void OffsetProblem::sample(const Eigen::VectorXd& state) {
  const std::size_t points = as_size(tracks_.num_points());
  samples_.resize(tracks_.cameras.size() * times_.size() * points);
  std::size_t next = 0;
  for (std::size_t c = 0; c < tracks_.cameras.size(); ++c) {
    const CameraTrack& track = tracks_.cameras[c];
    for (const double time : times_) {
      const double frame = frame_at(state, c, time);
      for (std::size_t k = 0; k < points; ++k)
        samples_[next++] = smooth_sample(track, frame, static_cast<int>(k), options_.width * track.fps);
    }
  }
}

/// [C, T, K] which samples stay when the offsets change a little. Rows that come and go with the offsets would make the
/// cost jump.
std::vector<bool> OffsetProblem::lasting_samples(const Eigen::VectorXd& state) const {
  std::vector<bool> lasting;
  for (std::size_t c = 0; c < tracks_.cameras.size(); ++c) {
    const CameraTrack& track = tracks_.cameras[c];
    const double width = options_.width * track.fps, margin = kMarginOfSample * width;
    for (const double time : times_)
      for (int k = 0; k < tracks_.num_points(); ++k) {
        const double frame = frame_at(state, c, time);
        lasting.push_back(smooth_sample(track, frame - margin, k, width).between &&
                          smooth_sample(track, frame, k, width).between &&
                          smooth_sample(track, frame + margin, k, width).between);
      }
  }
  return lasting;
}

OffsetProblem::Residual OffsetProblem::residual(std::size_t index, const Row& row, const Eigen::VectorXd& state) const {
  const Pair& pair = pairs_[index];
  const MovingPoint &a = sampled(pair.a, row.time, row.point), &b = sampled(pair.b, row.time, row.point);
  Residual result;
  if (!a.seen || !b.seen) return result;
  const Camera &in_a = cameras_[pair.a], &in_b = cameras_[pair.b];
  const Eigen::Vector3d line_in_b = pair.geometry.fundamental() * a.pixel.homogeneous();
  const Eigen::Vector3d line_in_a = pair.geometry.fundamental().transpose() * b.pixel.homogeneous();
  const double slope = std::sqrt(line_in_a.head<2>().squaredNorm() + line_in_b.head<2>().squaredNorm());
  if (!(slope > 0.0)) return result;
  result.valid = true;
  const Eigen::Vector4d at(a.pixel.x() / in_a.width - 0.5, a.pixel.y() / in_a.height - 0.5,
                           b.pixel.x() / in_b.width - 0.5, b.pixel.y() / in_b.height - 0.5);
  result.terms.head<5>() << 1.0, at;
  for (int i = 0, term = 5; i < 4; ++i)
    for (int j = i; j < 4; ++j) result.terms[term++] = at[i] * at[j];
  const Eigen::Index first = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(index);
  result.value =
      pair.scale * b.pixel.homogeneous().dot(line_in_b) / slope + result.terms.dot(state.segment<kBiasTerms>(first));
  result.by_a = pair.scale * line_in_a.head<2>().dot(a.velocity) / slope;
  result.by_b = pair.scale * line_in_b.head<2>().dot(b.velocity) / slope;
  return result;
}

void OffsetProblem::begin_round(const Eigen::VectorXd& state, double kernel, double factor) {
  sample(state);
  const Eigen::Index terms = state.size() - num_camera_unknowns_;
  const double bias = terms > 0 ? std::sqrt(state.tail(terms).squaredNorm() / static_cast<double>(terms)) : 0.0;
  allowed_bias_ = std::max(options_.calibration_error, 1.5 * bias);
  const std::vector<bool> lasting = lasting_samples(state);
  const auto lasts = [&](int camera, int time, int point) {
    return lasting[(as_size(camera) * times_.size() + as_size(time)) * as_size(tracks_.num_points()) + as_size(point)];
  };
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    Pair& pair = pairs_[p];
    pair.rows.clear();
    std::array<std::vector<double>, 2> sizes;
    for (int t = 0; t < static_cast<int>(times_.size()); ++t)
      for (int k = 0; k < tracks_.num_points(); ++k) {
        if (!lasts(pair.a, t, k) || !lasts(pair.b, t, k)) continue;
        const Residual found = residual(p, {t, k}, state);
        if (!found.valid) continue;
        pair.rows.push_back({t, k});
        sizes[is_tangent({t, k}) ? 1 : 0].push_back(std::abs(found.value));
      }
    const double of_points = std::max(kernel, factor * quantile(sizes[0], 0.5));
    const double of_tangents = std::max(kMinTangentKernel * kernel, factor * quantile(sizes[1], 0.5));
    pair.kernels = {RobustKernel::geman_mcclure_of(of_points), RobustKernel::geman_mcclure_of(of_tangents)};
    pair.weight_of_tangents = std::pow(std::min(kMaxTangentPrecision, of_points / of_tangents), 2);
  }
}

/// The weight of the squared bias terms. They have the variance of the noise of a row over that of the terms; rows
/// whose errors are the same count once.
double OffsetProblem::prior_weight(const Pair& pair) const {
  const double noise = pair.kernels[0].scale / 3.0, allowed = allowed_bias_;
  return kSampleGroup * noise * noise / (allowed * allowed);
}

double OffsetProblem::cost(const Eigen::VectorXd& state) {
  sample(state);
  last_cost_ = 0.0;
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const Pair& pair = pairs_[p];
    for (const Row& row : pair.rows) {
      const Residual found = residual(p, row, state);
      const RobustKernel& kernel = kernel_of(pair, row);
      const double worst = kernel.scale * kernel.scale;
      last_cost_ += weight_of(pair, row) * (found.valid ? kernel.cost(found.value * found.value) : worst);
    }
    const Eigen::Index first = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(p);
    last_cost_ += prior_weight(pair) * state.segment<kBiasTerms>(first).squaredNorm();
  }
  return last_cost_;
}

std::size_t OffsetProblem::stretch_of(const Row& row) const {
  const auto part = as_size((times_[row.time] - times_.front()) / kSecondsOfStretch);
  return part * as_size(tracks_.num_points()) + as_size(row.point);
}

void OffsetProblem::add(std::size_t p, const Row& row, const Residual& found) {
  const Pair& pair = pairs_[p];
  const double weight = weight_of(pair, row) * kernel_of(pair, row).weight(found.value * found.value);
  const double seconds = times_[row.time];
  Eigen::Matrix<double, 4 + kBiasTerms, 1> jacobian;
  std::array<Eigen::Index, 4 + kBiasTerms> at{};
  Eigen::Index count = 0;
  for (const auto& [camera, by_frame] : {std::pair{pair.a, found.by_a}, {pair.b, found.by_b}}) {
    if (index_[camera] < 0) continue;
    const double by_seconds = by_frame * tracks_.cameras[camera].fps;
    at[count] = index_[camera];
    jacobian[count++] = by_seconds;
    if (!options_.drift) continue;
    at[count] = index_[camera] + 1;
    jacobian[count++] = by_seconds * (seconds - middle_);
  }
  for (int i = 0; i < kBiasTerms; ++i) {
    at[count] = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(p) + i;
    jacobian[count++] = found.terms[i];
  }
  const std::size_t stretch = stretch_of(row);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double pull = weight * jacobian[i] * found.value;
    gradient_[at[i]] += pull;
    stretches_[stretch][at[i]] += pull;
    for (Eigen::Index j = 0; j < count; ++j) hessian_(at[i], at[j]) += weight * jacobian[i] * jacobian[j];
  }
}

double OffsetProblem::linearise(const Eigen::VectorXd& state) {
  const double found = cost(state);
  hessian_.setZero(num_unknowns(), num_unknowns());
  gradient_.setZero(num_unknowns());
  const double length = times_.empty() ? 0.0 : times_.back() - times_.front();
  const std::size_t parts = as_size(length / kSecondsOfStretch) + 1;
  stretches_.assign(parts * as_size(tracks_.num_points()), Eigen::VectorXd::Zero(num_unknowns()));
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    for (const Row& row : pairs_[p].rows) {
      const Residual here = residual(p, row, state);
      if (here.valid) add(p, row, here);
    }
    const Eigen::Index first = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(p);
    const double weight = prior_weight(pairs_[p]);
    hessian_.diagonal().segment<kBiasTerms>(first).array() += weight;
    gradient_.segment<kBiasTerms>(first) += weight * state.segment<kBiasTerms>(first);
  }
  return found;
}

bool OffsetProblem::solve(double damping, Eigen::VectorXd& step) {
  Eigen::MatrixXd damped = hessian_;
  for (Eigen::Index i = 0; i < damped.rows(); ++i)
    damped(i, i) = damped(i, i) > 0.0 ? damped(i, i) * (1.0 + damping) : 1.0;
  const auto solution = solve_positive_definite(damped, Eigen::VectorXd(-gradient_));
  if (!solution) return false;
  step = *solution;
  return step.allFinite();
}

std::vector<long> OffsetProblem::samples() const {
  std::vector<long> counts(tracks_.cameras.size(), 0);
  for (const Pair& pair : pairs_)
    for (const int camera : {pair.a, pair.b}) counts[camera] += static_cast<long>(pair.rows.size());
  return counts;
}

Eigen::MatrixXd OffsetProblem::curvature(const Eigen::VectorXd& state) {
  linearise(state);
  Eigen::MatrixXd result = hessian_;
  const double length = times_.empty() ? 1.0 : std::max(1.0, times_.back() - times_.front());
  const int per_camera = options_.drift ? 2 : 1;
  for (Eigen::Index i = 0; i < num_camera_unknowns_; ++i) {
    const bool is_rate = i % per_camera == 1;
    const double step = kStepOfCurvature * options_.width / (is_rate ? 0.5 * length : 1.0);
    Eigen::VectorXd moved = state;
    moved[i] = state[i] + step;
    linearise(moved);
    const Eigen::VectorXd after = gradient_;
    moved[i] = state[i] - step;
    linearise(moved);
    result.col(i) = (after - gradient_) / (2.0 * step);
  }
  result.topRightCorner(num_camera_unknowns_, num_unknowns() - num_camera_unknowns_) =
      result.bottomLeftCorner(num_unknowns() - num_camera_unknowns_, num_camera_unknowns_).transpose();
  const Eigen::MatrixXd top = result.topLeftCorner(num_camera_unknowns_, num_camera_unknowns_);
  result.topLeftCorner(num_camera_unknowns_, num_camera_unknowns_) = 0.5 * (top + top.transpose());
  return result;
}

Eigen::MatrixXd OffsetProblem::covariance(const Eigen::VectorXd& state) {
  Eigen::MatrixXd regular = curvature(state);
  for (Eigen::Index i = 0; i < regular.rows(); ++i)  // an unknown without rows
    if (regular(i, i) == 0.0) regular(i, i) = 1e-12;
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(regular.rows(), regular.cols());
  const auto inverted = solve_positive_definite(regular, unit);
  const double infinite = std::numeric_limits<double>::infinity();
  if (!inverted) return Eigen::MatrixXd::Constant(regular.rows(), regular.cols(), infinite);
  const Eigen::MatrixXd& inverse = *inverted;
  linearise(state);
  double count = 0.0;
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(regular.rows(), regular.cols());
  for (const Eigen::VectorXd& stretch : stretches_) {
    if (stretch.isZero(0.0)) continue;
    spread += stretch * stretch.transpose();
    count += 1.0;
  }
  // The fit takes up a part of what the stretches scatter: as many of them as there are unknowns which the rows, and
  // not the prior, determine.
  auto unknowns = static_cast<double>(regular.rows());
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const Eigen::Index first = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(p);
    unknowns -= prior_weight(pairs_[p]) * inverse.diagonal().segment<kBiasTerms>(first).sum();
  }
  spread *= count / std::max(count - unknowns, kMinShareOfStretches * count + 1.0);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {  // the bias terms are as uncertain as their prior says
    const Eigen::Index first = num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(p);
    const double weight = prior_weight(pairs_[p]) * allowed_bias_;
    spread.diagonal().segment<kBiasTerms>(first).array() += weight * weight;
  }
  return inverse * spread * inverse;
}

}  // namespace doppel
