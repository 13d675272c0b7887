#include "calibration/estimation/ceres_bundle.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Geometry>
#include <array>

namespace doppel::support {
namespace {

constexpr double kWidth = 1024.0;            // of the image in whose pixels residuals count
constexpr double kSigmasOfKernel = 3.0;      // the kernel's scale in standard deviations of a residual
constexpr double kUnreachableCost = 1e-300;  // no cost is smaller

/// Geman-McClure: k^2 s / (k^2 + s).
class GemanMcClure : public ceres::LossFunction {
 public:
  explicit GemanMcClure(double scale) : square_(scale * scale) {}
  void Evaluate(double s, double* rho) const override {
    const double share = square_ / (square_ + s);
    rho[0] = share * s;
    rho[1] = share * share;
    rho[2] = -2.0 * share * share / (square_ + s);
  }

 private:
  double square_;
};

/// Unknowns of a camera: the turn of its axes, the shift of its centre and, of seven, the logarithm of a factor of its
/// focal lengths.
template <int kUnknowns>
class Reprojection {
 public:
  Reprojection(const Camera& camera, const Bundle::Observation& seen)
      : camera_(camera), seen_(seen), unit_(seen.scale * kWidth / camera.width) {}

  template <typename T>
  bool operator()(const T* unknowns, const T* position, T* residual) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Vector shift(unknowns[3], unknowns[4], unknowns[5]), point(position[0], position[1], position[2]);
    const Vector before = camera_.R.cast<T>() * (point - camera_.centre().cast<T>() - shift);
    T local[3];
    ceres::AngleAxisRotatePoint(unknowns, before.data(), local);
    T x = local[0] / local[2], y = local[1] / local[2];
    distort(x, y);
    T zoom(1.0);
    if constexpr (kUnknowns > 6) zoom = exp(unknowns[6]);
    const Eigen::Matrix3d& K = camera_.K;
    residual[0] = unit_ * (zoom * (K(0, 0) * x + K(0, 1) * y) + K(0, 2) - seen_.pixel.x());
    residual[1] = unit_ * (zoom * K(1, 1) * y + K(1, 2) - seen_.pixel.y());
    return true;
  }

  static ceres::CostFunction* make(const Camera& camera, const Bundle::Observation& seen) {
    return new ceres::AutoDiffCostFunction<Reprojection, 2, kUnknowns, 3>(new Reprojection(camera, seen));
  }

 private:
  template <typename T>
  void distort(T& x, T& y) const {
    const auto& [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tx, ty] = camera_.distortion;
    const T r2 = x * x + y * y, radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), xy = x * y;
    const T bent = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x * x);
    y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * xy;
    x = bent;
  }

  Camera camera_;
  Bundle::Observation seen_;
  double unit_;
};

/// How far a distance is from its length, relative.
struct Distance {
  template <typename T>
  bool operator()(const T* a, const T* b, const T* length, T* residual) const {
    T square(0.0);
    for (int i = 0; i < 3; ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
    residual[0] = scale * (sqrt(square) / length[0] - 1.0);
    return true;
  }
  double scale;
};

/// Ceres halves the sum of squares.
class StopAt : public ceres::IterationCallback {
 public:
  explicit StopAt(double wanted) : wanted_(wanted) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    return 2.0 * summary.cost <= wanted_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double wanted_;
};

class Peer {
 public:
  Peer(const Bundle& bundle, const BundleOptions& options)
      : result_(bundle), options_(options), unknowns_(bundle.cameras.size()), loss_(options.kernel) {
    for (std::array<double, 7>& camera : unknowns_) camera.fill(0.0);
    for (const Bundle::Observation& seen : bundle.observations) add(seen);
    for (const Bundle::Link& link : bundle.links) add(link);
    for (std::size_t c = 0; c < unknowns_.size(); ++c)
      if (c < options.fixed.size() && options.fixed[c] && problem_.HasParameterBlock(unknowns_[c].data()))
        problem_.SetParameterBlockConstant(unknowns_[c].data());
  }

  CeresBundle solve(int most_steps, double wanted) {
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_SCHUR;
    solver.max_num_iterations = most_steps;
    solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-14;
    solver.num_threads = 1;
    solver.logging_type = ceres::SILENT;
    StopAt stop(std::max(wanted, kUnreachableCost));
    solver.callbacks.push_back(&stop);
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem_, &summary);
    CeresBundle found{result_, 2.0 * summary.initial_cost, 2.0 * summary.final_cost, summary.num_successful_steps - 1};
    for (std::size_t c = 0; c < unknowns_.size(); ++c) move(found.bundle.cameras[c], unknowns_[c]);
    return found;
  }

 private:
  static ceres::Problem::Options borrowed_loss() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  void add(const Bundle::Observation& seen) {
    const Camera& camera = result_.cameras[seen.camera];
    ceres::CostFunction* cost =
        options_.focal ? Reprojection<7>::make(camera, seen) : Reprojection<6>::make(camera, seen);
    problem_.AddResidualBlock(cost, &loss_, unknowns_[seen.camera].data(), result_.points[seen.point].position.data());
  }

  void add(const Bundle::Link& link) {
    double& length = result_.lengths[link.length];
    const double scale = options_.kernel / kSigmasOfKernel * length / options_.link_sigma;
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<Distance, 1, 3, 3, 1>(new Distance{scale}), &loss_,
                              result_.points[link.points[0]].position.data(),
                              result_.points[link.points[1]].position.data(), &length);
  }

  static void move(Camera& camera, const std::array<double, 7>& unknowns) {
    const Eigen::Vector3d turn(unknowns[0], unknowns[1], unknowns[2]), shift(unknowns[3], unknowns[4], unknowns[5]);
    const Eigen::Vector3d centre = camera.centre() + shift;
    if (turn.norm() > 0.0) camera.R = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * camera.R;
    camera.t = -camera.R * centre;
    camera.K.topLeftCorner<2, 2>() *= std::exp(unknowns[6]);
  }

  Bundle result_;
  const BundleOptions& options_;
  std::vector<std::array<double, 7>> unknowns_;  ///< [C]
  GemanMcClure loss_;
  ceres::Problem problem_{borrowed_loss()};
};

}  // namespace

CeresBundle solve_with_ceres(const Bundle& bundle, const BundleOptions& options, int most_steps, double wanted) {
  return Peer(bundle, options).solve(most_steps, wanted);
}

}  // namespace doppel::support
