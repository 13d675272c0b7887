#pragma once

#include <functional>

#include "doppel/geometry/mesh.h"
#include "doppel/synth/body_field.h"

namespace doppel::synth {

/// Meshes the zero level of the field by surface nets: one vertex per grid cell and one quad per grid edge that the
/// surface crosses.
/// @param cell edge of a grid cell, metres
/// @return closed triangle mesh, counter-clockwise from outside
/// @throws Error when the grid is too coarse to give a manifold
TriangleMesh mesh_body(const BodyField& field, double cell);

/// Collapses edges, shortest first, until `target_vertices` are left, and distributes the vertices evenly over the
/// surface. The mesh stays a manifold of the same genus.
/// @param relative_size relative edge length at a point (0.5: twice as dense)
TriangleMesh coarsen(const TriangleMesh& mesh, const BodyField& field, int target_vertices,
                     const std::function<double(const Eigen::Vector3d&)>& relative_size);

}  // namespace doppel::synth
