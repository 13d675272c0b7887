#pragma once

#include <tiny_gltf.h>

#include <span>
#include <string>
#include <vector>

#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/glb_buffer.h"

namespace doppel {

/// Adds the skeleton of a figure to a glTF model without nodes. Node 0 holds the skeleton, nodes 1 ... B are its bones,
/// node B + 1 is mesh 0 with the new skin. The scene holds nodes 0 and B + 1. The inverse bind matrices are those of
/// the rest pose.
/// @param name of the skin and of the node of the mesh
/// @param standing the pose that the bones have without an animation, node to world [B]; of a plain file figure.rest
void add_glb_skeleton(tinygltf::Model& model, GlbBuffer& buffer, const Figure& figure, const std::string& name,
                      const std::vector<Eigen::Affine3d>& standing);

/// Adds JOINTS_0 and WEIGHTS_0 to a primitive: the joints are numbers in the skin of `add_glb_skeleton`.
/// @param vertices for each vertex of the primitive, the vertex of the figure
void add_glb_weights(GlbBuffer& buffer, const Figure& figure, std::span<const int> vertices,
                     tinygltf::Primitive& primitive);

/// Adds an animation of the nodes of `add_glb_skeleton`, and of the weights of the morph targets if there are any:
/// linear interpolation between the keys of the tracks. Time 0 is the first frame of the part.
/// @param tracks whose keys are those of the parts of a clip @param part of at least one frame
void add_glb_animation(tinygltf::Model& model, GlbBuffer& buffer, const FigureTracks& tracks, const ClipPart& part);

}  // namespace doppel
