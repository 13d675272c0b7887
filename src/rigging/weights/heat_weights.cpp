#include "doppel/rigging/weights/heat_weights.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/rigging/joints/same_positions.h"
#include "doppel/rigging/weights/heat_domain.h"

namespace doppel {
namespace {

constexpr double kSharpness = 2.0;  // power of the weights; above 1 the transition at a joint becomes shorter
constexpr int kSmoothing = 3;       // rounds of averaging over the edges of the mesh

/// The different positions of a mesh. Vertices along seams share one.
struct Seams {
  std::vector<int> position_of;            ///< [N] the vertex's position
  std::vector<Eigen::Vector3d> positions;  ///< [P]
  std::vector<Eigen::Vector3d> normals;    ///< [P] of unit length, or zero
};

Seams find_seams(const TriangleMesh& mesh) {
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
    if (!mesh.vertices[v].allFinite()) fail("skinning weights: vertex {} has no finite position", v);
  Seams seams;
  seams.position_of = same_positions(mesh.vertices);
  const int count =
      seams.position_of.empty() ? 0 : 1 + *std::max_element(seams.position_of.begin(), seams.position_of.end());
  seams.positions.resize(count);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) seams.positions[seams.position_of[v]] = mesh.vertices[v];
  seams.normals.assign(seams.positions.size(), Eigen::Vector3d::Zero());
  for (const Triangle& face : mesh.faces) {
    const Eigen::Vector3d& a = mesh.vertices[face[0]];
    const Eigen::Vector3d normal = (mesh.vertices[face[1]] - a).cross(mesh.vertices[face[2]] - a);
    for (const int v : face) seams.normals[seams.position_of[v]] += normal;
  }
  for (Eigen::Vector3d& normal : seams.normals) normal = normal.stableNormalized();
  return seams;
}

/// The centre of the inside cell that is nearest to a point, at most two cells away along each axis; else the point.
Eigen::Vector3d nearest_inside(const SolidGrid& solid, const Eigen::Vector3d& point) {
  const Eigen::Vector3i middle = solid.cell_of(point);
  Eigen::Vector3d best = point;
  double nearest = std::numeric_limits<double>::infinity();
  for (int z = middle.z() - 2; z <= middle.z() + 2; ++z)
    for (int y = middle.y() - 2; y <= middle.y() + 2; ++y)
      for (int x = middle.x() - 2; x <= middle.x() + 2; ++x) {
        const double away = (solid.centre(x, y, z) - point).squaredNorm();
        if (away >= nearest || !solid.is_inside(x, y, z)) continue;
        nearest = away;
        best = solid.centre(x, y, z);
      }
  return best;
}

/// Where the temperature of a position is read: a little below the surface, so that the stencil does not reach across a
/// gap, and inside of the body if that is near. The air between two limbs has the temperature of both.
std::vector<Eigen::Vector3d> reading_points(const Seams& seams, const SolidGrid& solid) {
  constexpr double kBelow = 0.75;  // of a cell
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < seams.positions.size(); ++i) {
    const Eigen::Vector3d below = seams.positions[i] - kBelow * solid.cell * seams.normals[i];
    points.push_back(solid.is_inside(below) ? below : nearest_inside(solid, below));
  }
  return points;
}

/// The temperatures at the points [P, Bn].
WeightField read_field(const HeatDomain& domain, const std::vector<float>& heat, int num_bones,
                       const std::vector<Eigen::Vector3d>& points) {
  WeightField field = WeightField::Zero(static_cast<Eigen::Index>(points.size()), num_bones);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const HeatDomain::Stencil stencil = domain.stencil(points[i]);
    for (std::size_t k = 0; k < 8; ++k) {
      // Air counts only where nothing of the body is near: between two limbs it has the temperature of both.
      const double inside = domain.grid.inside[stencil.cell[k]] != 0 ? 1.0 : 1e-9;
      const auto share = static_cast<float>(inside * (stencil.weight[k] + 1e-6));
      const float* values = &heat[as_size(domain.cell_number[stencil.cell[k]]) * as_size(num_bones)];
      field.row(static_cast<Eigen::Index>(i)) += share * Eigen::Map<const Eigen::RowVectorXf>(values, num_bones);
    }
  }
  return field;
}

void scale_rows(WeightField& field, double power) {
  for (Eigen::Index i = 0; i < field.rows(); ++i) {
    const float largest = field.row(i).maxCoeff();
    if (!(largest > 0)) fail("skinning weights: no heat reaches a vertex");
    field.row(i) /= largest;
    if (power != 1.0) field.row(i) = field.row(i).array().pow(static_cast<float>(power));
    field.row(i) /= field.row(i).sum();
  }
}

/// Averages the rows over the edges of the mesh, `rounds` times. A short edge counts more: the two sides of a hem must
/// not part. An edge of two cells counts as much as the vertex itself counts against six of them.
void smooth_rows(WeightField& field, const TriangleMesh& mesh, const Seams& seams, double cell, int rounds) {
  std::vector<std::array<int, 2>> edges;
  for (const Triangle& face : mesh.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = seams.position_of[face[k]], b = seams.position_of[face[(k + 1) % 3]];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  for (int round = 0; round < rounds; ++round) {
    WeightField sum = field;
    Eigen::VectorXf total = Eigen::VectorXf::Ones(field.rows());
    for (const auto& [a, b] : edges) {
      const double length = (seams.positions[a] - seams.positions[b]).norm();
      const auto share = static_cast<float>(0.33 * cell / (length + 0.05 * cell));
      sum.row(a) += share * field.row(b);
      sum.row(b) += share * field.row(a);
      total[a] += share;
      total[b] += share;
    }
    field = total.cwiseInverse().asDiagonal() * sum;
  }
}

void check_input(const std::vector<HeatBone>& bones, const SolidGrid& solid) {
  if (bones.empty()) fail("skinning weights: there are no bones");
  for (const HeatBone& bone : bones) {
    if (bone.segments.empty()) fail("skinning weights: the bone '{}' has no segments", bone.name);
    for (const auto& segment : bone.segments)
      if (!segment[0].allFinite() || !segment[1].allFinite())
        fail("skinning weights: the bone '{}' has an end that is not finite", bone.name);
  }
  if (std::none_of(solid.inside.begin(), solid.inside.end(), [](std::uint8_t c) { return c != 0; }))
    fail("skinning weights: the solid is empty");
}

}  // namespace

WeightField heat_field(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid) {
  check_input(bones, solid);
  const Seams seams = find_seams(mesh);
  const std::vector<Eigen::Vector3d> points = reading_points(seams, solid);
  const HeatDomain domain = make_heat_domain(mesh, bones, solid, points);
  const int num_bones = static_cast<int>(bones.size());
  WeightField field = read_field(domain, solve_heat(domain, num_bones), num_bones, points);
  scale_rows(field, kSharpness);
  smooth_rows(field, mesh, seams, solid.cell, kSmoothing);
  return field(seams.position_of, Eigen::all);
}

}  // namespace doppel
