#pragma once

/// Gaussians that a skeleton moves by linear blend skinning, without a network: one file for players and engines.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/figure_writer.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/render/splats/splats.h"

namespace doppel {

/// The P Gaussians of an actor that all poses share, on a surface in the rest pose.
struct SplatRig {
  Splats splats;  ///< [1,P,...] float32, world of the rest pose, metres
  Figure figure;  ///< the bones; its vertices are the P Gaussians, with at most four weights each
};

/// A Gaussian has the skinning weights of its texel: those of the three vertices around it, mixed by the barycentrics,
/// of which the four largest stay, with sum 1. With `lit`, the colours are those under the learnt lighting at the
/// normals of the surface, without the shadows of limbs. The changes that a network predicts are left out.
/// @param surface [N] vertices in the rest pose, metres: those of the template, or nearer to the clothed body
/// @param mesh of the character's template @param gaussians of this template
/// @throws UsageError when `names` is not skeletool, and too few names of bones are recognised
SplatRig make_splat_rig(const Character& character, const std::vector<Eigen::Vector3d>& surface, const RenderMesh& mesh,
                        Gaussians& gaussians, BoneNames names);

/// The centres of the Gaussians in a pose, p' = M p with M = sum_j w_j G_j B_j^-1. G: the bones in this pose, B: in the
/// rest pose. @param dofs [D] @return float32 [P,3] world, metres
torch::Tensor posed_centres(const SplatRig& rig, const Skeleton& skeleton, const std::vector<double>& dofs);

/// Writes a binary glTF 2.0: the primitive of `write_splat_glb` with JOINTS_0 and WEIGHTS_0; the bones as nodes, with a
/// skin whose inverse bind matrices are those of the rest pose; the motions as animations. Metres, y up.
/// Left out are the Gaussians that `write_splat_glb` leaves out. glTF says nothing about how a skin turns
/// Gaussians: a player computes their covariances S' = M3 S M3^T itself, with the left 3x3 part of M.
/// @param path its content is replaced; missing folders are created
/// @param name of the mesh and the skin
/// @param tracks of the bones of `rig.figure`, without morph targets @param animations whose keys they hold
/// @param compression with which the file is compressed: the rig's figure and the tracks are those of compress_figure;
/// nothing: it is not compressed
/// @throws Error when no Gaussian is left, or the file cannot be written or would have more than 4 GB. The messages
/// name the file.
void write_splat_rig(const std::filesystem::path& path, const std::string& name, const SplatRig& rig,
                     const FigureTracks& tracks, const std::vector<ClipPart>& animations,
                     const std::optional<GlbSteps>& compression = std::nullopt);

struct SplatRigOptions {
  double frames_per_second = 25.0;
  BoneNames names = BoneNames::skeletool;
  double tolerance = 1e-4;      ///< error of interpolated keys, metres
  std::vector<ClipPart> parts;  ///< as of FigureOptions
  bool compress = false;        ///< by EXT_meshopt_compression
};

struct SplatRigReport {
  std::int64_t gaussians = 0;
  /// The errors are distances of the centres from those of the actor's Gaussians on its finished surface, without the
  /// network of the Gaussians, in at most 200 frames.
  FigureReport figure;
};

/// `folder/splats_rig.glb`: the Gaussians of an actor, and the poses of all frames as its animation. The surface in the
/// rest pose is the one with which the linear blend comes nearest to the vertices of the frames (fitted_rest_vertices):
/// it holds the clothes as they hang on average. Holds all frames in memory until `close`, 12 bytes per vertex and
/// frame.
/// @param actor with Gaussians; must outlive the writer @param report filled by `close`; must outlive the writer
/// @throws UsageError as make_splat_rig, before the first frame
std::unique_ptr<SequenceWriter> make_splat_rig_writer(const std::filesystem::path& folder, TrainedActor& actor,
                                                      const SplatRigOptions& options, SplatRigReport& report);

}  // namespace doppel
