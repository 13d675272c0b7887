#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/calibration/estimation/smooth_track.h"
#include "doppel/geometry/camera.h"
#include "doppel/solver/least_squares.h"
#include "doppel/solver/residuals.h"

namespace doppel {

/// A constant, four coordinates and their ten products.
constexpr int kBiasTerms = 15;

struct OffsetProblemOptions {
  int reference = 0;
  bool drift = false;
  double width = 0.04;             ///< seconds; of smooth_sample
  double calibration_error = 0.5;  ///< pixels of an image 1024 wide: smallest standard deviation of bias terms
  int first_tangent = std::numeric_limits<int>::max();  ///< from here on, the points are frontier points of one pair
};

/// Fractions of frames of all cameras at once, by least squares on Sampson distances. The error of a calibration also
/// moves points off their epipolar lines, and a camera's motion would be taken for time. Each pair therefore has bias
/// terms: a polynomial of second degree in the coordinates of the two pixels.
///
/// The state: per camera but the reference the change of its offset in seconds, and with drift the relative change of
/// its frame rate; then kBiasTerms per pair, pixels.
class OffsetProblem : public LeastSquaresProblem {
 public:
  /// @param tracks without lens distortion; their offsets are right to about a frame
  /// @param times seconds at which the cameras are compared
  OffsetProblem(const std::vector<Camera>& cameras, const PointTracks& tracks,
                const std::vector<std::pair<int, int>>& pairs, std::vector<double> times,
                const OffsetProblemOptions& options);

  /// Chooses the rows, and for each pair the scale of its robust kernel: `factor` times the median residual, at least
  /// `kernel`. Frontier points have a kernel of their own, and weigh more as it is narrower. The bias terms that the
  /// state has so far say how large the error of the calibration is. Until the next call, a row without a sample counts
  /// as an outlier.
  void begin_round(const Eigen::VectorXd& state, double kernel, double factor);

  double cost(const Eigen::VectorXd& state) override;
  double linearise(const Eigen::VectorXd& state) override;
  bool solve(double damping, Eigen::VectorXd& step) override;
  std::vector<TermCost> term_costs() const override { return {{"epipolar", last_cost_}}; }

  Eigen::Index num_unknowns() const {
    return num_camera_unknowns_ + kBiasTerms * static_cast<Eigen::Index>(pairs_.size());
  }
  /// Index of a camera's offset in the state, -1 for the reference. Its rate comes next.
  int offset_index(int camera) const { return index_[static_cast<std::size_t>(camera)]; }
  /// The middle of the times: rates turn about it.
  double middle() const { return middle_; }
  /// [C] rows that depend on a camera.
  std::vector<long> samples() const;
  /// The covariance of the state. The curvature for the offsets comes from differences of the gradient: J^T J would
  /// take the noise of the velocities for motion of the person. Errors of keypoints last for several frames and concern
  /// all pairs of a camera; the gradients of each point are therefore summed over stretches of time (a cluster-robust
  /// covariance). Infinite where the cost has no minimum.
  Eigen::MatrixXd covariance(const Eigen::VectorXd& state);

 private:
  struct Row {
    int time, point;
  };
  struct Pair {
    int a, b;
    EpipolarPair geometry;
    double scale;  ///< pixels of an image 1024 wide per pixel
    std::vector<Row> rows;
    std::array<RobustKernel, 2> kernels;  ///< of points, of frontier points
    double weight_of_tangents = 1.0;
  };
  using Terms = Eigen::Matrix<double, kBiasTerms, 1>;
  struct Residual {
    bool valid = false;
    double value = 0.0;
    double by_a = 0.0, by_b = 0.0;  ///< d value / d the frame of the camera
    Terms terms = Terms::Zero();    ///< d value / d the bias terms
  };

  double frame_at(const Eigen::VectorXd& state, std::size_t camera, double seconds) const;
  void sample(const Eigen::VectorXd& state);
  std::vector<bool> lasting_samples(const Eigen::VectorXd& state) const;
  const MovingPoint& sampled(int camera, int time, int point) const;
  Residual residual(std::size_t pair, const Row& row, const Eigen::VectorXd& state) const;
  bool is_tangent(const Row& row) const { return row.point >= options_.first_tangent; }
  const RobustKernel& kernel_of(const Pair& pair, const Row& row) const {
    return pair.kernels[is_tangent(row) ? 1 : 0];
  }
  double weight_of(const Pair& pair, const Row& row) const { return is_tangent(row) ? pair.weight_of_tangents : 1.0; }
  std::size_t stretch_of(const Row& row) const;
  double prior_weight(const Pair& pair) const;
  Eigen::MatrixXd curvature(const Eigen::VectorXd& state);
  void add(std::size_t pair, const Row& row, const Residual& residual);

  const std::vector<Camera>& cameras_;
  PointTracks tracks_;
  std::vector<double> times_;
  OffsetProblemOptions options_;
  double middle_ = 0.0, last_cost_ = 0.0, allowed_bias_ = 0.0;
  std::vector<int> index_;
  Eigen::Index num_camera_unknowns_ = 0;
  std::vector<Pair> pairs_;
  std::vector<MovingPoint> samples_;  ///< [C, T, K]
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd gradient_;
  std::vector<Eigen::VectorXd> stretches_;  ///< gradients of each point in stretches of time
};

}  // namespace doppel
