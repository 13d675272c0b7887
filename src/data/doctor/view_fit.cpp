#include "doppel/data/doctor/view_fit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "doppel/data/doctor/statistics.h"
#include "doppel/solver/dense_system.h"
#include "doppel/solver/least_squares.h"

namespace doppel {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep = 1e-6;                         ///< of central differences
constexpr double kMinKernel = 0.01, kMaxKernel = 0.5;  ///< shares of the person's size
constexpr int kRounds = 4;
constexpr std::size_t kMaxPoints = 1500;
constexpr double kMinShareLeft = 0.5;  ///< share of the points that a delay must leave

/// One camera and points in space with the pixels that it should show them at.
class ViewProblem : public LeastSquaresProblem {
 public:
  struct Observation {
    Vector3d point;
    Vector2d pixel;
  };
  ViewProblem(SupposedView view, const FreeParts& parts, double size)
      : view_(std::move(view)), parts_(parts), size_(size) {}

  std::vector<Observation> observations;
  double kernel = kMaxKernel;

  SupposedView view_of(const VectorXd& state) const {
    SupposedView view = view_;
    Eigen::Index i = 0;
    if (parts_.rotation) {
      const Vector3d turn = state.segment<3>(i);
      i += 3;
      const double angle = turn.norm();
      if (angle > 0.0) {
        const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
        view.camera.R = R * view.camera.R;
        view.camera.t = R * view.camera.t;
      }
    }
    if (parts_.translation) {
      view.camera.t += state.segment<3>(i);
      i += 3;
    }
    if (parts_.focal) view.camera.K.topLeftCorner<2, 2>() *= std::exp(state[i++]);
    if (parts_.principal_point) {
      view.camera.K.topRightCorner<2, 1>() += state.segment<2>(i) * size_;
      i += 2;
    }
    if (parts_.distortion) {
      view.camera.lens = Lens::opencv;
      view.camera.distortion[0] += state[i];
      view.camera.distortion[1] += state[i + 1];
    }
    return view;
  }

  double cost(const VectorXd& state) override {
    fill(view_of(state), false);
    return rows_.cost();
  }
  double linearise(const VectorXd& state) override {
    fill(view_of(state), true);
    for (Eigen::Index p = 0; p < state.size(); ++p) {
      VectorXd step = state;
      step[p] += kStep;
      const SupposedView ahead = view_of(step);
      step[p] -= 2.0 * kStep;
      const SupposedView behind = view_of(step);
      for (std::size_t i = 0; i < observations.size(); ++i) {
        const Vector2d slope = (residual(ahead, observations[i]) - residual(behind, observations[i])) / (2.0 * kStep);
        for (int axis = 0; axis < 2; ++axis) rows_.jacobian(static_cast<Eigen::Index>(2 * i) + axis)[p] = slope[axis];
      }
    }
    const double cost = rows_.cost();
    system_.reset(state.size());
    system_.add(rows_);
    return cost;
  }
  bool solve(double damping, VectorXd& step) override { return system_.solve(damping, step); }
  std::vector<TermCost> term_costs() const override { return {}; }

 private:
  Vector2d residual(const SupposedView& view, const Observation& seen) const {
    const auto pixel = view.pixel(seen.point);
    if (!pixel || !pixel->allFinite()) return Vector2d::Constant(kMaxShare);
    return (*pixel - seen.pixel) / size_;
  }
  void fill(const SupposedView& view, bool jacobian) {
    rows_.reset(parts_.parameters(), 2, RobustKernel::geman_mcclure_of(kernel), jacobian);
    for (const Observation& seen : observations) {
      const Eigen::Index row = rows_.add_group(1.0);
      const Vector2d value = residual(view, seen);
      rows_.value(row) = value.x();
      rows_.value(row + 1) = value.y();
    }
  }

  SupposedView view_;
  FreeParts parts_;
  double size_;
  Residuals rows_;
  DenseSystem system_;
};

/// The observations behind residuals, at most kMaxPoints of them.
std::vector<ViewProblem::Observation> observations_of(const Sightings& seen, const SupposedView& view,
                                                      const BodyTrack& body, const ViewResiduals& residuals) {
  std::vector<ViewProblem::Observation> found;
  const std::size_t stride = 1 + residuals.shares.size() / kMaxPoints;
  for (std::size_t i = 0; i < residuals.shares.size(); i += stride) {
    const int instant = residuals.instant[i], seen_as = residuals.point[i];
    const int k = view.sides_swapped ? seen.mirrored[seen_as] : seen_as;
    const Vector3d point = body.later(seen, instant, view.delay_at(seen, instant, residuals.window[i]), k);
    if (!point.allFinite()) continue;
    const auto projected = view.pixel(point);
    // The pixel of the nearest detection: residuals hold it relative to the projection.
    if (projected && projected->allFinite()) found.push_back({point, *projected + residuals.offset[i]});
  }
  return found;
}

}  // namespace

SupposedView fit_view(const Sightings& seen, int camera, SupposedView view, const BodyTrack& body,
                      const ChosenInstants& chosen, const FreeParts& parts) {
  if (parts.distortion) {
    view.camera.lens = Lens::opencv;
    std::fill(view.camera.distortion.begin() + 2, view.camera.distortion.end(), 0.0);
  }
  for (int round = 0; round < kRounds; ++round) {
    const ViewResiduals residuals = residuals_of(seen, camera, view, body, chosen);
    if (residuals.shares.size() < 6) return view;
    ViewProblem problem(view, parts, seen.size[camera]);
    problem.observations = observations_of(seen, view, body, residuals);
    problem.kernel = std::clamp(3.0 * median(residuals.shares), kMinKernel, kMaxKernel);
    VectorXd state = VectorXd::Zero(parts.parameters());
    minimise(problem, state);
    view = problem.view_of(state);
  }
  return view;
}

std::optional<SupposedView> find_pose(const Sightings& seen, int camera, const SupposedView& start,
                                      const BodyTrack& body, const ChosenInstants& chosen) {
  const Eigen::Matrix2d back = start.turn.inverse();
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> planes;
  for (const int instant : chosen.instants) {
    const auto& people = seen.people[camera][instant];
    if (people.size() != 1) continue;
    for (int k = 0; k < seen.num_points(); ++k) {
      if (!people[0][k].seen || !body.known(instant, k)) continue;
      const auto sight = sight_of(start.camera, back * (people[0][k].pixel - start.shift));
      if (!sight) continue;
      const Vector3d& point = body.at(instant, k);
      points.emplace_back(point.x(), point.y(), point.z());
      planes.emplace_back(sight->plane.x(), sight->plane.y());
    }
  }
  if (points.size() < 6) return std::nullopt;
  const std::size_t stride = 1 + points.size() / kMaxPoints;
  std::vector<cv::Point3d> some_points;
  std::vector<cv::Point2d> some_planes;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    some_points.push_back(points[i]);
    some_planes.push_back(planes[i]);
  }
  cv::Mat rotation, translation;
  const double reach = 0.04 * seen.size[camera] / start.camera.K(0, 0);
  try {
    if (!cv::solvePnPRansac(some_points, some_planes, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false,
                            200, static_cast<float>(reach), 0.99, cv::noArray(), cv::SOLVEPNP_EPNP))
      return std::nullopt;
  } catch (const cv::Exception&) {  // OpenCV refuses degenerate points
    return std::nullopt;
  }
  cv::Mat matrix;
  cv::Rodrigues(rotation, matrix);
  SupposedView view = start;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) view.camera.R(r, c) = matrix.at<double>(r, c);
    view.camera.t[r] = translation.at<double>(r);
  }
  return view;
}

std::optional<double> find_delay(const Sightings& seen, int camera, const SupposedView& start, const BodyTrack& body,
                                 const ChosenInstants& chosen, int longest) {
  const std::size_t windows = seen.windows.size();
  SupposedView view = start;
  const auto all = static_cast<double>(residuals_of(seen, camera, start, body, chosen).shares.size());
  const auto at = [&](double delay) {
    view.delay = start.delay + delay;
    const ViewResiduals residuals = residuals_of(seen, camera, view, body, chosen);
    if (static_cast<double>(residuals.shares.size()) < kMinShareLeft * all) return kMaxShare;
    return residuals.mean_of_windows(windows);
  };
  double best = 0.0, least = kMaxShare;
  for (int delay = -longest; delay <= longest; ++delay)
    if (const double value = at(delay); value < least) {
      least = value;
      best = delay;
    }
  if (least >= kMaxShare) return std::nullopt;
  for (double step = 0.5; step > 0.05; step *= 0.5) {
    const double ahead = at(best + step), behind = at(best - step);
    if (std::min(ahead, behind) >= least) continue;
    best += ahead < behind ? step : -step;
    least = std::min(ahead, behind);
  }
  return best;
}

}  // namespace doppel
