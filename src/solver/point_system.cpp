#include "doppel/solver/point_system.h"

#include <Eigen/LU>

#include "doppel/core/as_size.h"
#include "doppel/solver/conjugate_gradients.h"
#include "doppel/solver/parallel.h"

namespace doppel {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

auto point_of(const VectorXd& x, std::size_t p) { return x.segment<3>(3 * static_cast<Eigen::Index>(p)); }
auto point_of(VectorXd& x, std::size_t p) { return x.segment<3>(3 * static_cast<Eigen::Index>(p)); }

/// The inverse of a block, regularised if its rows leave a direction undetermined.
Matrix3d inverse_of(const Matrix3d& block) {
  constexpr double kFloor = 1e-9;
  const double trace = block.trace();
  if (!(trace > 0.0)) return Matrix3d::Identity();
  return (block + kFloor * trace * Matrix3d::Identity()).inverse();
}

}  // namespace

PointSystem::PointSystem(int num_points, std::vector<Link> links)
    : links_(std::move(links)),
      first_neighbour_(as_size(num_points) + 1, 0),
      at_point_(as_size(num_points)),
      at_link_(links_.size()),
      own_(at_point_.size()),
      inverse_(at_point_.size()) {
  for (const Link& link : links_)
    for (const int point : link) ++first_neighbour_[as_size(point) + 1];
  for (std::size_t p = 0; p < at_point_.size(); ++p) first_neighbour_[p + 1] += first_neighbour_[p];
  std::vector<int> next(first_neighbour_.begin(), first_neighbour_.end() - 1);
  neighbours_.resize(2 * links_.size());
  for (std::size_t l = 0; l < links_.size(); ++l)
    for (const int end : {0, 1}) {
      const auto slot = as_size(next[links_[l][end]]++);
      neighbours_[slot] = {links_[l][1 - end], static_cast<int>(l), end == 0 ? 1.0 : -1.0};
    }
}

void PointSystem::reset() {
  std::fill(at_point_.begin(), at_point_.end(), Block{});
  std::fill(at_link_.begin(), at_link_.end(), Block{});
}

void PointSystem::Block::add(const PointRows& rows) {
  for (int i = 0; i < rows.count; ++i) {
    const Vector3d jacobian = rows.jacobian.row(i).transpose(), weighted = rows.weight * jacobian;
    hessian.noalias() += weighted * jacobian.transpose();
    gradient += rows.values[i] * weighted;
  }
}

VectorXd PointSystem::gradient() const {
  VectorXd result(3 * num_points());
  for_parts(at_point_.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t p = first; p < last; ++p) {
      Vector3d sum = at_point_[p].gradient;
      for (int n = first_neighbour_[p]; n < first_neighbour_[p + 1]; ++n) {
        const Neighbour& neighbour = neighbours_[n];
        sum += neighbour.sign * at_link_[neighbour.link].gradient;
      }
      point_of(result, p) = sum;
    }
  });
  return result;
}

void PointSystem::prepare(double damping) {
  for_parts(at_point_.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t p = first; p < last; ++p) {
      Matrix3d sum = at_point_[p].hessian;
      for (int n = first_neighbour_[p]; n < first_neighbour_[p + 1]; ++n) sum += at_link_[neighbours_[n].link].hessian;
      sum.diagonal() *= 1.0 + damping;
      own_[p] = sum;
      inverse_[p] = inverse_of(sum);
    }
  });
}

void PointSystem::multiply(const VectorXd& x, VectorXd& image) const {
  image.resize(x.size());
  for_parts(at_point_.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t p = first; p < last; ++p) {
      Vector3d sum = own_[p] * point_of(x, p);
      for (int n = first_neighbour_[p]; n < first_neighbour_[p + 1]; ++n) {
        const Neighbour& neighbour = neighbours_[n];
        sum.noalias() -= at_link_[neighbour.link].hessian * point_of(x, as_size(neighbour.point));
      }
      point_of(image, p) = sum;
    }
  });
}

void PointSystem::precondition(const VectorXd& x, VectorXd& result) const {
  result.resize(x.size());
  for_parts(inverse_.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t p = first; p < last; ++p) point_of(result, p).noalias() = inverse_[p] * point_of(x, p);
  });
}

double PointSystem::dot(const VectorXd& a, const VectorXd& b) const {
  return sum_in_order(as_size(a.size()), [&](std::size_t first, std::size_t last) {
    const auto begin = static_cast<Eigen::Index>(first), count = static_cast<Eigen::Index>(last - first);
    return a.segment(begin, count).dot(b.segment(begin, count));
  });
}

bool PointSystem::solve(double damping, int iterations, VectorXd& step) {
  prepare(damping);
  conjugate_gradients(*this, VectorXd(-gradient()), iterations, 0.0, step);
  return step.allFinite();
}

}  // namespace doppel
