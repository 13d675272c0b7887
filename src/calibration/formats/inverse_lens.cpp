#include "doppel/calibration/formats/inverse_lens.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

using LensMap = std::function<Eigen::Vector2d(const Eigen::Vector2d&)>;
using LensVector = Eigen::Matrix<double, 12, 1>;

constexpr int kFitPoints = 33, kCheckPoints = 101;  // per side of the image
constexpr int kMaxFitSteps = 200;
constexpr int kWithoutPrism = 8, kWithPrism = 12;  // coefficients
constexpr double kGoodFit = 0.01;                  // pixels; worse fits also get the coefficients of a prism
constexpr double kFitDamping = 1e-3, kMaxDamping = 1e12, kFitStep = 1e-6, kFitProgress = 1e-9;
// Squared pixels per squared coefficient: without it, numerator and denominator grow together.
constexpr double kFitRidge = 1e-4;

/// A point of the image and what the lens must do with it, at depth 1.
struct LensPair {
  Eigen::Vector2d without, with;
};

/// Points on a grid over the image, its borders included.
std::optional<std::vector<LensPair>> pairs_on_grid(const LensMap& undistorted, const Camera& camera, int points) {
  const Eigen::Matrix3d from_pixels = camera.K.inverse();
  std::vector<LensPair> pairs;
  for (int row = 0; row < points; ++row)
    for (int column = 0; column < points; ++column) {
      const Eigen::Vector3d pixel(camera.width * static_cast<double>(column) / (points - 1),
                                  camera.height * static_cast<double>(row) / (points - 1), 1.0);
      const Eigen::Vector2d with = (from_pixels * pixel).head<2>();
      pairs.push_back({undistorted(with), with});
      if (!pairs.back().without.allFinite()) return std::nullopt;
    }
  return pairs;
}

/// Whether the map keeps the sense of rotation everywhere in the image, without which it has no inverse.
bool has_inverse(const LensMap& undistorted, const std::vector<LensPair>& pairs) {
  return std::all_of(pairs.begin(), pairs.end(), [&](const LensPair& pair) {
    Eigen::Matrix2d jacobian;
    for (int axis = 0; axis < 2; ++axis) {
      const Eigen::Vector2d step = kFitStep * Eigen::Vector2d::Unit(axis);
      jacobian.col(axis) = (undistorted(pair.with + step) - undistorted(pair.with - step)) / (2.0 * kFitStep);
    }
    return jacobian.determinant() > 0.0;
  });
}

/// Residuals in pixels, two per point.
Eigen::VectorXd lens_residuals(const std::vector<LensPair>& pairs, const LensVector& lens, const Camera& camera) {
  Camera fitted;
  std::copy(lens.begin(), lens.end(), fitted.distortion.begin());
  Eigen::VectorXd residuals(2 * std::ssize(pairs));
  Eigen::Index row = 0;
  for (const LensPair& pair : pairs) {
    const Eigen::Vector2d off = fitted.distorted(pair.without) - pair.with;
    residuals[row++] = camera.K(0, 0) * off.x();
    residuals[row++] = camera.K(1, 1) * off.y();
  }
  return residuals;
}

/// By differences. @return one column for each of the first `count` coefficients
Eigen::MatrixXd lens_jacobian(const std::vector<LensPair>& pairs, const LensVector& at, int count,
                              const Camera& camera) {
  Eigen::MatrixXd jacobian(2 * std::ssize(pairs), count);
  for (int i = 0; i < count; ++i) {
    const LensVector step = kFitStep * LensVector::Unit(i);
    jacobian.col(i) =
        (lens_residuals(pairs, at + step, camera) - lens_residuals(pairs, at - step, camera)) / (2.0 * kFitStep);
  }
  return jacobian;
}

/// The first `count` coefficients by Levenberg-Marquardt steps, from a lens without distortion.
LensVector fit_lens(const std::vector<LensPair>& pairs, int count, const Camera& camera) {
  const auto cost = [](const Eigen::VectorXd& residuals, const LensVector& lens) {
    return residuals.squaredNorm() + kFitRidge * lens.squaredNorm();
  };
  LensVector lens = LensVector::Zero();
  Eigen::VectorXd residuals = lens_residuals(pairs, lens, camera);
  double damping = kFitDamping;
  for (int step = 0; step < kMaxFitSteps && damping < kMaxDamping; ++step) {
    const Eigen::MatrixXd jacobian = lens_jacobian(pairs, lens, count, camera);
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    normal.diagonal().array() += kFitRidge;
    normal.diagonal() *= 1.0 + damping;
    LensVector next = lens;
    const Eigen::VectorXd gradient = jacobian.transpose() * residuals + kFitRidge * lens.head(count);
    next.head(count) -= solve_symmetric(normal, gradient);
    const Eigen::VectorXd next_residuals = lens_residuals(pairs, next, camera);
    const double before = cost(residuals, lens), after = cost(next_residuals, next);
    damping *= after < before ? 0.1 : 10.0;
    if (!(after < before)) continue;
    lens = next;
    residuals = next_residuals;
    if (before - after < kFitProgress * before) break;
  }
  return lens;
}

/// In pixels; infinite for a lens that yields no finite points.
double largest_residual(const std::vector<LensPair>& pairs, const LensVector& lens, const Camera& camera) {
  const Eigen::VectorXd residuals = lens_residuals(pairs, lens, camera);
  if (!residuals.allFinite()) return std::numeric_limits<double>::infinity();
  double largest = 0.0;
  for (Eigen::Index i = 0; i < residuals.size(); i += 2) largest = std::max(largest, residuals.segment<2>(i).norm());
  return largest;
}

}  // namespace

std::optional<InverseLens> fit_inverse_lens(const LensMap& undistorted, const Camera& camera) {
  if (!camera.K.allFinite() || !(camera.K(0, 0) > 0.0) || !(camera.K(1, 1) > 0.0)) return std::nullopt;
  const auto pairs = pairs_on_grid(undistorted, camera, kFitPoints);
  const auto checked = pairs_on_grid(undistorted, camera, kCheckPoints);
  if (!pairs || !checked || !has_inverse(undistorted, *checked)) return std::nullopt;
  InverseLens fitted;
  for (const int count : {kWithoutPrism, kWithPrism}) {
    const LensVector lens = fit_lens(*pairs, count, camera);
    std::copy(lens.begin(), lens.end(), fitted.coefficients.begin());
    fitted.largest_residual_px = largest_residual(*checked, lens, camera);
    if (fitted.largest_residual_px <= kGoodFit) break;
  }
  return fitted;
}

}  // namespace doppel
