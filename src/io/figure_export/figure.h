#pragma once

#include <Eigen/Geometry>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/io/figure_export/bone_names.h"

namespace doppel {

/// A bone as other programs know it: a rigid transform with a name. It unites the single axes of a joint.
struct FigureNode {
  std::string name;
  int parent = -1;  ///< FigureNode (always smaller than this one's), -1 for the root
  int joint = 0;    ///< Joint of the skeleton that has the node's transform; of a helper joint, that of its parent
};

/// A character in the form of file formats for rigged figures: nodes, and at most four weights per vertex for linear
/// blend skinning.
struct Figure {
  std::vector<FigureNode> nodes;               ///< [B] parents first
  std::vector<Eigen::Affine3d> rest;           ///< [B] transforms in the rest pose, node to world, metres
  std::vector<std::array<int, 4>> node;        ///< [N] nodes of a vertex; 0 where the weight is 0
  std::vector<std::array<float, 4>> weight;    ///< [N] largest first; the sum is 1
  std::vector<Eigen::Vector3d> rest_vertices;  ///< [N] metres
  double largest_dropped_weight = 0.0;         ///< sum of the weights that a vertex with more than four bones lost
};

/// The nodes are the joints that carry bones. Names are unique. With a convention, bones whose names are recognised
/// (guess_joint_map) are renamed; those between hips and neck, or head, become the spine. The other names stay; one
/// that the convention has for another bone gets a number (`Spine_2`). Hips without such a name are the node above both
/// thighs and the neck.
/// @throws UsageError when `names` is not skeletool, and too few names are recognised, or bones are missing that the
/// convention requires
Figure make_figure(const Character& character, BoneNames names);

/// The new name of each bone that `make_figure` renames. Empty for skeletool. @throws UsageError as make_figure
std::map<std::string, std::string> renamed_bones(const Character& character, BoneNames names);

/// A point that moves with the surface.
struct FigurePoint {
  Eigen::Vector3d rest;                  ///< in the rest pose, metres; on the surface or near it
  std::array<int, 3> corners{};          ///< vertices of its face
  std::array<double, 3> barycentrics{};  ///< of sum 1
};
/// A figure with points [N] in the place of its vertices. A point has the skinning weights of the corners of its face,
/// mixed by the barycentrics, of which the four largest stay.
/// @param figure of this character
Figure figure_of_points(Figure figure, const Character& character, const std::vector<FigurePoint>& points);

/// [B] transforms of the nodes in a pose, node to world. @param dofs [D]
std::vector<Eigen::Affine3d> pose_nodes(const Figure& figure, const Skeleton& skeleton,
                                        const std::vector<double>& dofs);

/// [N] the blended matrices sum_b w_b G_b R_b^-1 that move the rest vertices. G: `posed`, R: the rest pose.
std::vector<Eigen::Affine3d> blend_transforms(const Figure& figure, const std::vector<Eigen::Affine3d>& posed);

}  // namespace doppel
