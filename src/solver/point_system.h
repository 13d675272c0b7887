#pragma once

/// Normal equations of thousands of unknown points in space, some of which are linked to neighbours. Each residual
/// depends on one point, or on the difference of two linked points. The matrix is never formed: it is a symmetric 3x3
/// block per point and per link. The product is computed point by point, so threads write to separate memory and the
/// result has the same bits for any number of threads. P points, L links.

#include <Eigen/Core>
#include <array>
#include <vector>

namespace doppel {

/// Up to three residuals of one point, or of the difference of two linked points. Their energy is weight * |values|^2.
struct PointRows {
  int count = 0;  ///< number of `values` and of rows of `jacobian`; 0: none
  double weight = 1.0;
  Eigen::Vector3d values = Eigen::Vector3d::Zero();
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();  ///< row i: d values[i] / d the point, or the difference

  double cost() const { return weight * values.head(count).squaredNorm(); }
};

using Link = std::array<int, 2>;  ///< differences are x[link[0]] - x[link[1]]

class PointSystem {
 public:
  /// @param links between different points, each once
  PointSystem(int num_points, std::vector<Link> links);

  int num_points() const { return static_cast<int>(at_point_.size()); }
  int num_links() const { return static_cast<int>(links_.size()); }
  const std::vector<Link>& links() const { return links_; }

  void reset();
  /// Different threads may add to different points and different links.
  void add_at_point(int point, const PointRows& rows) { at_point_[point].add(rows); }
  void add_at_link(int link, const PointRows& rows) { at_link_[link].add(rows); }

  /// Conjugate gradients for (H + damping diag(H)) step = -gradient, preconditioned with the inverse 3x3 blocks of the
  /// diagonal. A point on which no row depends keeps its position.
  /// @return false when a number is not finite
  bool solve(double damping, int iterations, Eigen::VectorXd& step);

  Eigen::VectorXd gradient() const;                                       ///< [3P] J^T W r
  void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& image) const;  ///< (H + damping diag(H)) x
  void precondition(const Eigen::VectorXd& x, Eigen::VectorXd& result) const;
  double dot(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;

 private:
  /// J^T W J and J^T W r of one point or one link.
  struct Block {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    void add(const PointRows& rows);
  };
  /// The other end of a point's link.
  struct Neighbour {
    int point, link;
    double sign;  ///< sign of the point in the difference of the link
  };
  void prepare(double damping);

  std::vector<Link> links_;
  std::vector<int> first_neighbour_;  ///< [P+1] into neighbours_
  std::vector<Neighbour> neighbours_;
  std::vector<Block> at_point_, at_link_;
  std::vector<Eigen::Matrix3d> own_;      ///< [P] damped diagonal block of each point
  std::vector<Eigen::Matrix3d> inverse_;  ///< [P] inverse of own_
};

}  // namespace doppel
