#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// Landmarks of a character: points that detectors find in images, each fixed to a joint. A landmark is a `Marker`: its
/// position is in its joint's frame, p(pose) = G_joint(pose) * position.

/// Reads a placement file, a table with the columns `index,name,joint,x_mm,y_mm,z_mm`: the joint of each landmark and
/// its position in the rest pose, world millimetres. `index` counts the rows from 0.
/// @throws FileError (file:line): another header, a joint that the skeleton does not have, a repeated or empty name, a
///         value that is not a number, no rows
std::vector<Marker> read_landmarks(const std::filesystem::path& csv, const Character& character);

/// Writes a placement file. `read_landmarks` restores the landmarks to within a nanometre.
/// @throws Error as landmark_positions
void write_landmarks(const std::filesystem::path& csv, const Character& character,
                     const std::vector<Marker>& landmarks);

std::vector<std::string> landmark_names(const std::vector<Marker>& landmarks);

/// The markers of a skeleton with these names, in the order of the names. @throws Error for a name that no marker has
std::vector<Marker> markers_named(const Skeleton& skeleton, const std::vector<std::string>& names);

/// The character with landmarks as markers, which replace markers of the same names.
Character with_markers(Character character, const std::vector<Marker>& landmarks);

/// Positions of landmarks in a pose: [M], world metres. @param dofs [D]
/// @throws Error when the joint of a landmark is not in the skeleton, or `dofs` has another length
std::vector<Eigen::Vector3d> landmark_positions(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                                                const std::vector<double>& dofs);

/// [M] the graph node nearest to each landmark in the rest pose, the first among equally near nodes. When the surface
/// deforms, the landmark follows the transform of this node (5.12).
/// @throws Error when the graph has no nodes, or as landmark_positions
std::vector<int> nearest_nodes(const Character& character, const std::vector<Marker>& landmarks);

}  // namespace doppel
