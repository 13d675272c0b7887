#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/body/body_warp.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// A point on an edge of a mesh: (1 - share) * vertex a + share * vertex b.
struct EdgePoint {
  int a = 0, b = 0;
  double share = 0;

  Eigen::Vector3d on(std::span<const Eigen::Vector3d> vertices) const {
    return (1 - share) * vertices[a] + share * vertices[b];
  }
};
/// A closed line on a mesh.
using SurfaceLoop = std::vector<EdgePoint>;

/// The closed lines in which a plane cuts a closed mesh.
/// @param normal of the plane, any length
std::vector<SurfaceLoop> plane_section(const TriangleMesh& mesh, const Eigen::Vector3d& origin,
                                       const Eigen::Vector3d& normal);
/// The loop of the section whose mean lies nearest to `origin`. @throws Error when the plane misses the mesh
SurfaceLoop nearest_section(const TriangleMesh& mesh, const Eigen::Vector3d& origin, const Eigen::Vector3d& normal);
double loop_length(const SurfaceLoop& loop, std::span<const Eigen::Vector3d> vertices);
/// Extent of the loop in a direction of unit length.
double loop_extent(const SurfaceLoop& loop, std::span<const Eigen::Vector3d> vertices,
                   const Eigen::Vector3d& direction);

/// Where a girth, breadth or depth is taken: in the plane across a bone.
struct GirthLevel {
  int measure;                ///< index into body_measures()
  Eigen::Vector3d origin;     ///< on the axis of the bone, metres
  Eigen::Vector3d normal;     ///< of the plane, unit
  Eigen::Vector3d direction;  ///< zero: the length of the loop; else its extent in this direction, unit
};
/// The levels of all girths, depths and breadths across limbs and trunk; of the limbs, those on the left.
/// @param joints of a body in the rest pose
std::vector<GirthLevel> girth_levels(const BodyJoints& joints);

/// The measures of a body in the rest pose [P], metres, from its surface and joints. The loops of the girths are cut
/// anew. Hair and looseness cannot be seen and are 0; girths include loose clothes.
/// @param joints the 21 joints, head_top, fingertips, toe ends and heels
/// @throws Error when a plane misses the mesh
std::vector<double> measure_body(const TriangleMesh& mesh, const BodyJoints& joints);

}  // namespace doppel
