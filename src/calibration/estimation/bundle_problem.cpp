#include "doppel/calibration/estimation/bundle_problem.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "doppel/calibration/estimation/camera_jacobian.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/core/as_size.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSigmasOfKernel = 3.0;  // the kernel's scale in standard deviations of a residual
constexpr double kMinFreedoms = 0.1;     // of the weighted residuals less the unknowns, per residual

}  // namespace

BundleProblem::BundleProblem(Bundle bundle, const BundleOptions& options)
    : bundle_(std::move(bundle)), options_(options), kernel_(RobustKernel::geman_mcclure_of(options.kernel)) {
  options_.fixed.resize(bundle_.cameras.size(), false);
  for (std::size_t c = 0; c < bundle_.cameras.size(); ++c) {
    index_.push_back(options_.fixed[c] ? -1 : num_camera_unknowns_);
    if (!options_.fixed[c]) num_camera_unknowns_ += camera_unknowns();
  }
  for (const Bundle::Point& point : bundle_.points) {
    if (as_size(point.group) >= group_sizes_.size()) group_sizes_.resize(as_size(point.group) + 1, 0);
    in_group_.push_back(group_sizes_[point.group]);
    group_sizes_[point.group] += 3;
  }
  std::vector<Eigen::Index> begins;
  Eigen::Index begin = num_shared();
  for (const int size : group_sizes_) {
    begins.push_back(begin);
    begin += size;
  }
  for (std::size_t p = 0; p < bundle_.points.size(); ++p)
    in_state_.push_back(begins[bundle_.points[p].group] + in_group_[p]);
}

Eigen::Index BundleProblem::num_shared() const {
  return num_camera_unknowns_ + static_cast<Eigen::Index>(bundle_.lengths.size());
}

Eigen::Index BundleProblem::state_size() const {
  return num_shared() + 3 * static_cast<Eigen::Index>(bundle_.points.size());
}

Camera BundleProblem::camera_at(const Eigen::VectorXd& state, int index) const {
  Camera camera = bundle_.cameras[index];
  int at = index_[index];
  if (at < 0) return camera;
  camera = moved_by(camera, state.segment<3>(at), state.segment<3>(at + 3));
  at += 6;
  if (options_.focal) camera.K.topLeftCorner<2, 2>() *= std::exp(state[at++]);
  if (options_.principal_point) camera.K.topRightCorner<2, 1>() += state.segment<2>(at);
  return camera;
}

Vector3d BundleProblem::point_at(const Eigen::VectorXd& state, int point) const {
  return bundle_.points[point].position + state.segment<3>(in_state_[point]);
}

Bundle BundleProblem::bundle(const Eigen::VectorXd& state) const {
  Bundle result = bundle_;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) result.cameras[c] = camera_at(state, static_cast<int>(c));
  for (std::size_t p = 0; p < result.points.size(); ++p)
    result.points[p].position = point_at(state, static_cast<int>(p));
  for (std::size_t l = 0; l < result.lengths.size(); ++l)
    result.lengths[l] += state[num_camera_unknowns_ + static_cast<Eigen::Index>(l)];
  return result;
}

Eigen::VectorXd BundleProblem::moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const {
  Eigen::VectorXd result = state + step;
  for (const int at : index_)
    if (at >= 0) result.segment<3>(at) = turn_of(rotation_of(step.segment<3>(at)) * rotation_of(state.segment<3>(at)));
  return result;
}

BundleProblem::Projected BundleProblem::projected(const Camera& camera, const Bundle::Observation& seen,
                                                  const Vector3d& point, bool jacobian) const {
  Projected result;
  const double unit = seen.scale * rig_reference_pixels(camera);
  if (!jacobian) {
    const auto pixel = safe_pixel(camera, point);
    result.valid = pixel.has_value();
    if (pixel) result.residual = unit * (*pixel - seen.pixel);
    return result;
  }
  const auto found = camera_jacobian(camera, point);
  result.valid = found.has_value();
  if (!found) return result;
  result.residual = unit * (found->pixel - seen.pixel);
  result.by_point = unit * found->by_point;
  result.by_camera.resize(2, camera_unknowns());
  result.by_camera.leftCols<3>() = unit * found->by_turn;
  result.by_camera.middleCols<3>(3) = -result.by_point;
  int at = 6;
  if (options_.focal) result.by_camera.col(at++) = unit * found->by_focal;
  if (options_.principal_point) result.by_camera.middleCols<2>(at) = unit * Eigen::Matrix2d::Identity();
  return result;
}

/// The residual of a link: how far the distance is off, relative to the length, times as many pixels as a reprojection
/// error that is as many standard deviations long. A relative error does not favour a smaller world.
double BundleProblem::link_residual(const Bundle::Link& link, double distance, double length) const {
  return link_scale(link) * (distance / length - 1.0);
}

double BundleProblem::link_scale(const Bundle::Link& link) const {
  return options_.kernel / kSigmasOfKernel * bundle_.lengths[link.length] / options_.link_sigma;
}

double BundleProblem::cost(const Eigen::VectorXd& state) {
  std::vector<Camera> cameras;
  for (std::size_t c = 0; c < bundle_.cameras.size(); ++c) cameras.push_back(camera_at(state, static_cast<int>(c)));
  last_cost_ = 0.0;
  for (const Bundle::Observation& seen : bundle_.observations) {
    const Projected found = projected(cameras[seen.camera], seen, point_at(state, seen.point), false);
    const double worst = options_.kernel * options_.kernel;
    last_cost_ += found.valid ? kernel_.cost(found.residual.squaredNorm()) : worst;
  }
  for (const Bundle::Link& link : bundle_.links) {
    const double length = bundle_.lengths[link.length] + state[num_camera_unknowns_ + link.length];
    const double distance = (point_at(state, link.points[0]) - point_at(state, link.points[1])).norm();
    last_cost_ += kernel_.cost(std::pow(link_residual(link, distance, length), 2));
  }
  return last_cost_;
}

void BundleProblem::add(const Bundle::Observation& seen, const Projected& found) {
  const double weight = kernel_.weight(found.residual.squaredNorm());
  const Bundle::Point& point = bundle_.points[seen.point];
  SchurSystem::Group& group = system_.group(as_size(point.group));
  const int own = in_group_[seen.point], shared = index_[seen.camera];
  const Eigen::Matrix<double, 3, 2> pull = weight * found.by_point.transpose();
  group.hessian.block<3, 3>(own, own) += pull * found.by_point;
  group.gradient.segment<3>(own) += pull * found.residual;
  if (shared < 0) return;
  const int size = camera_unknowns();
  group.cross.block(own, shared, 3, size) += pull * found.by_camera;
  system_.hessian().block(shared, shared, size, size) += weight * found.by_camera.transpose() * found.by_camera;
  system_.gradient().segment(shared, size) += weight * found.by_camera.transpose() * found.residual;
}

void BundleProblem::add_link(const Bundle::Link& link, const Eigen::VectorXd& state) {
  const Vector3d apart = point_at(state, link.points[0]) - point_at(state, link.points[1]);
  const double distance = apart.norm();
  if (!(distance > 1e-9)) return;
  const Eigen::Index shared = num_camera_unknowns_ + link.length;
  const double length = bundle_.lengths[link.length] + state[shared];
  const double residual = link_residual(link, distance, length);
  const double weight = kernel_.weight(residual * residual);
  const Vector3d by_first = link_scale(link) / (length * distance) * apart;
  const double by_length = -link_scale(link) * distance / (length * length);
  SchurSystem::Group& group = system_.group(as_size(bundle_.points[link.points[0]].group));
  for (int i = 0; i < 2; ++i) {
    const int row = in_group_[link.points[i]];
    const double sign = i == 0 ? 1.0 : -1.0;
    for (int j = 0; j < 2; ++j)
      group.hessian.block<3, 3>(row, in_group_[link.points[j]]) +=
          (i == j ? weight : -weight) * by_first * by_first.transpose();
    group.gradient.segment<3>(row) += sign * weight * residual * by_first;
    group.cross.block<3, 1>(row, shared) += sign * weight * by_length * by_first;
  }
  system_.hessian()(shared, shared) += weight * by_length * by_length;
  system_.gradient()[shared] += weight * by_length * residual;
}

double BundleProblem::linearise(const Eigen::VectorXd& state) {
  const double found = cost(state);
  linearised_at_ = state;
  system_.reset(num_shared(), group_sizes_);
  std::vector<Camera> cameras;
  for (std::size_t c = 0; c < bundle_.cameras.size(); ++c) cameras.push_back(camera_at(state, static_cast<int>(c)));
  for (const Bundle::Observation& seen : bundle_.observations) {
    const Projected here = projected(cameras[seen.camera], seen, point_at(state, seen.point), true);
    if (here.valid) add(seen, here);
  }
  for (const Bundle::Link& link : bundle_.links) add_link(link, state);
  return found;
}

bool BundleProblem::solve(double damping, Eigen::VectorXd& step) { return system_.solve(damping, step); }

/// The directions of the shared unknowns that no point can see, orthonormal columns: shift, turn and scale of the
/// world; with one fixed camera the scale about its centre; with more, none.
Eigen::MatrixXd BundleProblem::gauge_directions() const {
  std::vector<Camera> cameras;
  Vector3d middle = Vector3d::Zero(), held = Vector3d::Zero();
  int free = 0, fixed = 0;
  for (std::size_t c = 0; c < bundle_.cameras.size(); ++c) {
    cameras.push_back(camera_at(linearised_at_, static_cast<int>(c)));
    const bool is_fixed = index_[c] < 0;
    (is_fixed ? held : middle) += cameras.back().centre();
    ++(is_fixed ? fixed : free);
  }
  if (fixed > 1 || free == 0) return Eigen::MatrixXd(num_shared(), 0);
  const Vector3d about = fixed == 1 ? held : Vector3d(middle / free);
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(num_shared(), 7);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const int at = index_[c];
    if (at < 0) continue;
    const Vector3d arm = cameras[c].centre() - about;
    directions.block<3, 1>(at + 3, 0) = arm;
    if (fixed == 1) continue;
    directions.block<3, 3>(at, 1) = -cameras[c].R;
    directions.block<3, 3>(at + 3, 1) = -cross_matrix(arm);
    directions.block<3, 3>(at + 3, 4) = Matrix3d::Identity();
  }
  for (std::size_t l = 0; l < bundle_.lengths.size(); ++l) {
    const Eigen::Index at = num_camera_unknowns_ + static_cast<Eigen::Index>(l);
    directions(at, 0) = bundle_.lengths[l] + linearised_at_[at];
  }
  if (fixed == 1) directions.conservativeResize(Eigen::NoChange, 1);
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(directions);
  return qr.householderQ() * Eigen::MatrixXd::Identity(num_shared(), directions.cols());
}

Eigen::MatrixXd BundleProblem::covariance() {
  Eigen::MatrixXd reduced = system_.reduced_hessian();
  const Eigen::MatrixXd gauge = gauge_directions();
  const double level = std::max(1e-12, reduced.diagonal().mean());
  reduced += level * gauge * gauge.transpose();
  for (Eigen::Index i = 0; i < reduced.rows(); ++i)
    reduced(i, i) = reduced(i, i) > 0.0 ? reduced(i, i) * (1.0 + 1e-9) : 1.0;
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(reduced.rows(), reduced.cols());
  const Eigen::MatrixXd constrained = unit - gauge * gauge.transpose();
  const Eigen::MatrixXd inverse = constrained * solve_symmetric(reduced, unit) * constrained;

  const Eigen::MatrixXd independent = residual_variance() * inverse;

  // The gradients of the stretches: what their rows add to the shared gradient, less what their points take up.
  const std::vector<Eigen::VectorXd> of_groups = system_.reduced_gradients();
  std::vector<int> stretch_of_group(of_groups.size(), 0);
  int last = 0;
  for (const Bundle::Point& point : bundle_.points) {
    stretch_of_group[point.group] = point.stretch;
    last = std::max(last, point.stretch);
  }
  std::vector<Eigen::VectorXd> gradients(as_size(last) + 1, Eigen::VectorXd::Zero(reduced.rows()));
  for (std::size_t g = 0; g < of_groups.size(); ++g) gradients[stretch_of_group[g]] += of_groups[g];
  std::vector<Camera> cameras;
  for (std::size_t c = 0; c < bundle_.cameras.size(); ++c)
    cameras.push_back(camera_at(linearised_at_, static_cast<int>(c)));
  for (const Bundle::Observation& seen : bundle_.observations) {
    const int at = index_[seen.camera];
    if (at < 0) continue;
    const Projected here = projected(cameras[seen.camera], seen, point_at(linearised_at_, seen.point), true);
    if (!here.valid) continue;
    const double weight = kernel_.weight(here.residual.squaredNorm());
    gradients[bundle_.points[seen.point].stretch].segment(at, camera_unknowns()) +=
        weight * here.by_camera.transpose() * here.residual;
  }
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(reduced.rows(), reduced.cols());
  for (const Eigen::VectorXd& gradient : gradients) spread += gradient * gradient.transpose();
  const auto count = static_cast<double>(gradients.size());
  const Eigen::MatrixXd dependent = inverse * spread * inverse * (count / std::max(1.0, count - 1.0));
  // The gradients of a few stretches sum to nearly zero at the minimum, so their spread tells too little.
  return dependent.trace() > independent.trace() ? dependent : independent;
}

double BundleProblem::residual_variance() {
  double squares = 0.0, weights = 0.0;
  for (const Bundle::Observation& seen : bundle_.observations) {
    const Camera camera = camera_at(linearised_at_, seen.camera);
    const Projected here = projected(camera, seen, point_at(linearised_at_, seen.point), false);
    if (!here.valid) continue;
    const double weight = kernel_.weight(here.residual.squaredNorm());
    squares += weight * here.residual.squaredNorm();
    weights += weight;
  }
  const double residuals = 2.0 * weights;
  const auto unknowns = static_cast<double>(state_size());
  return squares / std::max(kMinFreedoms * residuals, residuals - unknowns);
}

}  // namespace doppel
