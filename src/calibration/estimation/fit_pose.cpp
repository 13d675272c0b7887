#include "doppel/calibration/estimation/fit_pose.h"

#include "doppel/calibration/estimation/camera_jacobian.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/core/statistics.h"
#include "doppel/solver/dense_system.h"
#include "doppel/solver/least_squares.h"
#include "doppel/solver/residuals.h"

namespace doppel {
namespace {

/// The state is a turn of the camera's axes and a shift of its centre, as in moved_by.
class PoseProblem : public LeastSquaresProblem {
 public:
  PoseProblem(const Camera& camera, const std::vector<PointSighting>& points, double kernel)
      : camera_(camera), points_(points), kernel_(kernel) {}

  Camera at(const Eigen::VectorXd& state) const { return moved_by(camera_, state.head<3>(), state.tail<3>()); }

  double cost(const Eigen::VectorXd& state) override { return cost_ = pose_cost(at(state), points_, kernel_); }

  double linearise(const Eigen::VectorXd& state) override {
    const Camera camera = at(state);
    const double unit = rig_reference_pixels(camera);
    Residuals rows;
    rows.reset(6, 2, RobustKernel::geman_mcclure_of(kernel_), true);
    for (const PointSighting& seen : points_) {
      const auto found = camera_jacobian(camera, seen.point);
      if (!found) continue;
      const Eigen::Index first = rows.add_group(1.0);
      for (Eigen::Index i = 0; i < 2; ++i) {
        rows.value(first + i) = unit * (found->pixel - seen.pixel)[i];
        rows.jacobian(first + i).head<3>() = unit * found->by_turn.row(i);
        rows.jacobian(first + i).tail<3>() = -unit * found->by_point.row(i);
      }
    }
    system_.reset(6);
    system_.add(rows);
    return cost(state);
  }

  bool solve(double damping, Eigen::VectorXd& step) override { return system_.solve(damping, step); }

  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override {
    Eigen::VectorXd result = state + step;
    result.head<3>() = turn_of(rotation_of(step.head<3>()) * rotation_of(state.head<3>()));
    return result;
  }

  std::vector<TermCost> term_costs() const override { return {{"reprojection", cost_}}; }

 private:
  const Camera& camera_;
  const std::vector<PointSighting>& points_;
  double kernel_, cost_ = 0.0;
  DenseSystem system_;
};

}  // namespace

double pose_cost(const Camera& camera, const std::vector<PointSighting>& points, double kernel) {
  const RobustKernel robust = RobustKernel::geman_mcclure_of(kernel);
  const double unit = rig_reference_pixels(camera);
  double sum = 0.0;
  for (const PointSighting& seen : points) {
    const auto pixel = safe_pixel(camera, seen.point);
    sum += pixel ? robust.cost((unit * (*pixel - seen.pixel)).squaredNorm()) : kernel * kernel;
  }
  return sum;
}

double median_residual(const Camera& camera, const std::vector<PointSighting>& points) {
  std::vector<double> residuals;
  for (const PointSighting& seen : points) {
    const auto pixel = safe_pixel(camera, seen.point);
    residuals.push_back(pixel ? rig_reference_pixels(camera) * (*pixel - seen.pixel).norm() : kRigReferenceWidth);
  }
  return quantile(residuals, 0.5);
}

Camera fit_pose(const Camera& camera, const std::vector<PointSighting>& points, double kernel) {
  PoseProblem problem(camera, points, kernel);
  Eigen::VectorXd state = Eigen::VectorXd::Zero(6);
  SolverOptions options;
  options.function_tolerance = 1e-7;
  minimise(problem, state, options);
  return problem.at(state);
}

}  // namespace doppel
