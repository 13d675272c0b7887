#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/solver/least_squares.h"
#include "doppel/solver/residuals.h"
#include "doppel/solver/schur_system.h"

namespace doppel {

/// What bundle adjustment works on: cameras, points in space, and where the cameras saw the points.
struct Bundle {
  struct Point {
    Eigen::Vector3d position;  ///< world, metres
    int group = 0;             ///< points of one group may be linked; groups are numbered from 0 without gaps
    int stretch = 0;           ///< of time, numbered from 0; errors within a stretch depend on each other
  };
  struct Observation {
    int camera = 0, point = 0;
    Eigen::Vector2d pixel;    ///< as filmed
    double confidence = 1.0;  ///< of the detector
    double scale = 1.0;       ///< of the residual, inside of the robust kernel: less for less certain observations
  };
  /// A distance of two points of one group that is the same for all links of a length.
  struct Link {
    std::array<int, 2> points{};
    int length = 0;  ///< index into `lengths`
  };
  std::vector<Camera> cameras;
  std::vector<Point> points;
  std::vector<Observation> observations;
  std::vector<Link> links;
  std::vector<double> lengths;  ///< metres
};

struct BundleOptions {
  bool focal = false, principal_point = false;
  std::vector<bool> fixed;   ///< [C] cameras that keep everything
  double kernel = 2.5;       ///< pixels of an image 1024 wide; Geman-McClure
  double link_sigma = 0.02;  ///< metres
};

/// Least squares on the reprojection errors of a bundle, in pixels of an image 1024 wide. A camera's unknowns are a
/// small turn w of its axes (R' = exp(w) R), its centre in metres, then the logarithm of a factor of its focal lengths
/// and the shift of its principal point in pixels, as the options say. The points are eliminated group by group.
class BundleProblem : public LeastSquaresProblem {
 public:
  BundleProblem(Bundle bundle, const BundleOptions& options);

  /// The state that stands for the bundle as it was given.
  Eigen::VectorXd initial_state() const { return Eigen::VectorXd::Zero(state_size()); }
  /// The bundle at a state.
  Bundle bundle(const Eigen::VectorXd& state) const;

  double cost(const Eigen::VectorXd& state) override;
  double linearise(const Eigen::VectorXd& state) override;
  bool solve(double damping, Eigen::VectorXd& step) override;
  Eigen::VectorXd moved(const Eigen::VectorXd& state, const Eigen::VectorXd& step) const override;
  std::vector<TermCost> term_costs() const override { return {{"reprojection", last_cost_}}; }

  int camera_unknowns() const { return 6 + (options_.focal ? 1 : 0) + (options_.principal_point ? 2 : 0); }
  /// Index of a camera's first unknown, -1 for a fixed camera.
  int camera_index(int camera) const { return index_[static_cast<std::size_t>(camera)]; }
  /// The covariance of the shared unknowns (cameras, then lengths) at the last linearisation, with the world held by
  /// inner constraints: neither the cameras' mean position and turn nor their size vary. Gradients are summed over the
  /// points of a stretch of time, because their errors are not independent. Never less than with independent errors.
  Eigen::MatrixXd covariance();
  /// Of one coordinate of an observation at the last linearisation, by the weighted residuals and the number of
  /// unknowns.
  double residual_variance();

 private:
  struct Projected {
    bool valid = false;
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 9> by_camera;
    Eigen::Matrix<double, 2, 3> by_point;
  };
  Eigen::Index state_size() const;
  Eigen::Index num_shared() const;
  Camera camera_at(const Eigen::VectorXd& state, int camera) const;
  Eigen::Vector3d point_at(const Eigen::VectorXd& state, int point) const;
  Projected projected(const Camera& camera, const Bundle::Observation& seen, const Eigen::Vector3d& point,
                      bool jacobian) const;
  double link_residual(const Bundle::Link& link, double distance, double length) const;
  double link_scale(const Bundle::Link& link) const;
  void add(const Bundle::Observation& seen, const Projected& projected);
  void add_link(const Bundle::Link& link, const Eigen::VectorXd& state);
  Eigen::MatrixXd gauge_directions() const;

  Bundle bundle_;
  BundleOptions options_;
  RobustKernel kernel_;
  std::vector<int> index_;  ///< [C]
  int num_camera_unknowns_ = 0;
  std::vector<int> group_sizes_;        ///< [G] unknowns
  std::vector<int> in_group_;           ///< [P] first unknown of a point in its group
  std::vector<Eigen::Index> in_state_;  ///< [P] first unknown of a point in the state
  SchurSystem system_;
  double last_cost_ = 0.0;
  Eigen::VectorXd linearised_at_;
};

}  // namespace doppel
