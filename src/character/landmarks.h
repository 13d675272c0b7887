#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// Landmarks of a character: points that detectors find in images and that ride on joints. A landmark is a `Marker`:
/// its position is in its joint's frame, p(pose) = G_joint(pose) * position.

/// Reads a placement file, a table with the columns `index,name,joint,x_mm,y_mm,z_mm`: the joint each landmark rides on
/// and where it lies in the rest pose, world millimetres. `index` counts the rows from 0.
/// @throws FileError (file:line): another header, a joint the skeleton does not have, a name that stands twice or is
///         empty, numbers that are none, no rows at all
std::vector<Marker> read_landmarks(const std::filesystem::path& csv, const Character& character);

/// Writes them so that `read_landmarks` gives the same back to within a nanometre. @throws Error as landmark_positions
void write_landmarks(const std::filesystem::path& csv, const Character& character,
                     const std::vector<Marker>& landmarks);

/// Where landmarks lie in a pose: [M], world metres. @param dofs [D]
/// @throws Error when a landmark rides on no joint of the skeleton, or `dofs` has another length
std::vector<Eigen::Vector3d> landmark_positions(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                                                const std::vector<double>& dofs);

/// [M] the graph node nearest to each landmark in the rest pose (of equally near ones the first): the node whose
/// transform carries it when the surface deforms (5.12).
/// @throws Error when the graph has no nodes, or as landmark_positions
std::vector<int> nearest_nodes(const Character& character, const std::vector<Marker>& landmarks);

}  // namespace doppel
