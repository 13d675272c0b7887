#include "doppel/rigging/joints/limb_slice.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <vector>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

/// A square of samples of the solid in a plane.
class SlicePlane {
 public:
  SlicePlane(const SolidGrid& solid, const Eigen::Vector3d& point, const Eigen::Vector3d& along, double window)
      : point_(point), step_(0.7 * solid.cell), half_(static_cast<int>(std::ceil(window / step_))) {
    u_ = along.unitOrthogonal();
    v_ = along.cross(u_);
    inside_.resize(width() * width());
    for (int j = -half_; j <= half_; ++j)
      for (int i = -half_; i <= half_; ++i) inside_[index(i, j)] = solid.is_inside(position(i, j)) ? 1 : 0;
  }

  /// The sample inside of the solid that is nearest to the middle.
  std::optional<std::array<int, 2>> start() const {
    std::optional<std::array<int, 2>> best;
    int nearest = half_ * half_ / 4;
    for (int j = -half_; j <= half_; ++j)
      for (int i = -half_; i <= half_; ++i)
        if (inside_[index(i, j)] != 0 && i * i + j * j <= nearest) {
          nearest = i * i + j * j - 1;
          best = {i, j};
        }
    return best;
  }

  /// Measures the samples that are connected with `from`.
  LimbSlice measure(const std::array<int, 2>& from) {
    LimbSlice slice;
    std::vector<std::array<int, 2>> stack{from};
    inside_[index(from[0], from[1])] = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
    double count = 0;
    while (!stack.empty()) {
      const auto [i, j] = stack.back();
      stack.pop_back();
      const Eigen::Vector2d p(i, j);
      sum += p;
      square += p * p.transpose();
      ++count;
      slice.open = slice.open || std::abs(i) == half_ || std::abs(j) == half_;
      for (const auto& [di, dj] : {std::array{1, 0}, std::array{-1, 0}, std::array{0, 1}, std::array{0, -1}}) {
        const int a = i + di, b = j + dj;
        if (std::abs(a) > half_ || std::abs(b) > half_ || inside_[index(a, b)] == 0) continue;
        inside_[index(a, b)] = 0;
        stack.push_back({a, b});
      }
    }
    const Eigen::Vector2d mean = sum / count;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(square / count - mean * mean.transpose());
    slice.centre = point_ + step_ * (mean.x() * u_ + mean.y() * v_);
    slice.radius = step_ * std::sqrt(count / M_PI);
    slice.longest = 2 * step_ * std::sqrt(std::max(axes.eigenvalues()[1], 0.0));
    return slice;
  }

 private:
  int width() const { return 2 * half_ + 1; }
  std::size_t index(int i, int j) const { return as_size((j + half_) * width() + i + half_); }
  Eigen::Vector3d position(int i, int j) const { return point_ + step_ * (i * u_ + j * v_); }

  Eigen::Vector3d point_, u_, v_;
  double step_;
  int half_;
  std::vector<std::uint8_t> inside_;
};

}  // namespace

std::optional<LimbSlice> slice_limb(const SolidGrid& solid, const Eigen::Vector3d& point, const Eigen::Vector3d& along,
                                    double window) {
  SlicePlane plane(solid, point, along, window);
  const auto start = plane.start();
  if (!start) return std::nullopt;
  return plane.measure(*start);
}

}  // namespace doppel
