#include "doppel/rigging/weights/stretch.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace doppel {
namespace {

using Eigen::Vector3d;
using Edges = Eigen::Matrix<double, 3, 2>;

constexpr double kNearlyALine = 0.01;  // height over longest edge

/// The larger singular value of the map that takes the columns of `a` to those of `b`. With a thin QR decomposition
/// a = Q R the map is b R^-1 on the plane of Q.
double larger_singular_value(const Edges& a, const Edges& b) {
  const double r00 = a.col(0).norm(), r01 = a.col(0).dot(a.col(1)) / r00;
  const double r11 = a.col(0).cross(a.col(1)).norm() / r00;
  const Vector3d first = b.col(0) / r00, second = (b.col(1) - r01 * first) / r11;
  const double p = first.squaredNorm(), q = second.squaredNorm(), c = first.dot(second);
  return std::sqrt(0.5 * (p + q) + std::hypot(0.5 * (p - q), c));
}

double stretch_of(const Edges& a, const Edges& b) {
  const Vector3d opposite_a = a.col(1) - a.col(0), opposite_b = b.col(1) - b.col(0);
  const double lengths[] = {a.col(0).norm(), a.col(1).norm(), opposite_a.norm()};
  const double longest = *std::max_element(std::begin(lengths), std::end(lengths));
  if (longest <= 0.0) return 1.0;
  if (a.col(0).cross(a.col(1)).norm() >= kNearlyALine * longest * longest) return larger_singular_value(a, b);
  const double posed[] = {b.col(0).norm(), b.col(1).norm(), opposite_b.norm()};
  return posed[std::max_element(std::begin(lengths), std::end(lengths)) - std::begin(lengths)] / longest;
}

}  // namespace

std::vector<double> triangle_stretches(const std::vector<Triangle>& faces, const std::vector<Vector3d>& rest,
                                       const std::vector<Vector3d>& posed) {
  const auto edges = [](const Triangle& face, const std::vector<Vector3d>& at) {
    Edges result;
    result << at[face[1]] - at[face[0]], at[face[2]] - at[face[0]];
    return result;
  };
  std::vector<double> result;
  result.reserve(faces.size());
  for (const Triangle& face : faces) result.push_back(stretch_of(edges(face, rest), edges(face, posed)));
  return result;
}

bool stretches_alone(const std::vector<double>& stretches, const IndexRows& neighbours, int face, double limit) {
  const double own = stretches[face];
  if (own <= limit) return false;
  const auto row = neighbours.row(face);
  return row.empty() || std::any_of(row.begin(), row.end(), [&](int other) { return stretches[other] < 0.5 * own; });
}

StretchedTriangles count_stretched(const std::vector<double>& stretches, const IndexRows& neighbours, double limit) {
  StretchedTriangles result;
  for (std::size_t f = 0; f < stretches.size(); ++f) {
    result.largest = std::max(result.largest, stretches[f]);
    if (stretches[f] <= limit) continue;
    ++result.all;
    result.alone += stretches_alone(stretches, neighbours, static_cast<int>(f), limit);
  }
  return result;
}

}  // namespace doppel
