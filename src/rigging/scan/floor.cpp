#include "doppel/rigging/scan/floor.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

// Shares of the extent along `up`:
constexpr double kFloorZone = 0.1;        // where a floor is looked for
constexpr double kFloorBin = 0.004;       // of the histogram over the height
constexpr double kFloorThickness = 0.01;  // on either side of the level
constexpr double kAboveFloor = 0.2;       // the body up to here is compared with the sheet
// Shares of the size, and of its square:
constexpr double kFloorArea = 0.04;    // least area
constexpr double kFloorExcess = 0.03;  // mean distance by which the sheet reaches beyond the body
constexpr double kLevelNormal = 0.9;   // cosine of the largest slope
constexpr int kSectors = 24;

struct FaceOnFloor {
  Vector3d middle;
  double height = 0.0;  // share of the extent
  double area = 0.0;
  bool level = false;
};

FaceOnFloor look_at(const TriangleMesh& mesh, const Triangle& face, const Vector3d& up, double low, double extent) {
  const Vector3d &a = mesh.vertices[face[0]], &b = mesh.vertices[face[1]], &c = mesh.vertices[face[2]];
  const Vector3d twice = (b - a).cross(c - a);
  FaceOnFloor out;
  out.middle = (a + b + c) / 3.0;
  out.height = (out.middle.dot(up) - low) / extent;
  out.area = 0.5 * twice.norm();
  out.level = std::abs(twice.dot(up)) >= 2.0 * kLevelNormal * out.area && out.area > 0.0;
  return out;
}

/// The farthest points from a centre, by direction.
class Outline {
 public:
  Outline(const Vector3d& centre, const Vector3d& up)
      : centre_(centre), right_(up.unitOrthogonal()), front_(up.cross(right_)) {}

  void add(const Vector3d& point) {
    const double x = (point - centre_).dot(right_), y = (point - centre_).dot(front_);
    const double turn = 0.5 + 0.5 * std::atan2(y, x) / std::numbers::pi;
    double& radius = radii_[std::clamp(static_cast<int>(turn * kSectors), 0, kSectors - 1)];
    radius = std::max(radius, std::hypot(x, y));
  }

  double mean_excess(const Outline& other) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < radii_.size(); ++k) sum += radii_[k] - other.radii_[k];
    return sum / kSectors;
  }

 private:
  Vector3d centre_, right_, front_;
  std::array<double, kSectors> radii_{};
};

}  // namespace

std::optional<FloorSheet> find_floor(const TriangleMesh& mesh, const Vector3d& up, double low, double high,
                                     double size) {
  const double extent = high - low;
  if (!(extent > 0.0)) return std::nullopt;
  std::array<double, as_size(kFloorZone / kFloorBin) + 2> areas{};
  for (const Triangle& face : mesh.faces) {
    const FaceOnFloor seen = look_at(mesh, face, up, low, extent);
    if (seen.level && seen.height >= -kFloorThickness && seen.height < kFloorZone)
      areas[std::max(0.0, seen.height) / kFloorBin] += seen.area;
  }
  std::size_t best = 0;
  for (std::size_t k = 0; k + 1 < areas.size(); ++k)
    if (areas[k] + areas[k + 1] > areas[best] + areas[best + 1]) best = k;
  if (areas[best] + areas[best + 1] < kFloorArea * size * size) return std::nullopt;

  const double level = (static_cast<double>(best) + (areas[best + 1] > areas[best] ? 1.5 : 0.5)) * kFloorBin;
  FloorSheet sheet;
  sheet.level = low + level * extent;
  sheet.thickness = kFloorThickness * extent;
  Vector3d centre = Vector3d::Zero();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const FaceOnFloor seen = look_at(mesh, mesh.faces[f], up, low, extent);
    if (!seen.level || std::abs(seen.height - level) > kFloorThickness) continue;
    sheet.faces.push_back(static_cast<int>(f));
    sheet.area += seen.area;
    centre += seen.area * seen.middle;
  }
  centre /= sheet.area;
  Outline floor(centre, up), body(centre, up);
  for (const int f : sheet.faces)
    for (const int v : mesh.faces[f]) floor.add(mesh.vertices[v]);
  for (const Triangle& face : mesh.faces)
    for (const int v : face) {
      const double height = (mesh.vertices[v].dot(up) - low) / extent - level;
      if (height > 1.5 * kFloorThickness && height < kAboveFloor) body.add(mesh.vertices[v]);
    }
  if (floor.mean_excess(body) < kFloorExcess * size) return std::nullopt;
  return sheet;
}

}  // namespace doppel
