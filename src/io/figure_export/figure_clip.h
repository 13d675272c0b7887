#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/io/figure_export/figure.h"

namespace doppel {

/// Frames of a clip that a file holds as an animation of its own.
struct ClipPart {
  std::string name;
  int first = 0, frames = 0;
  double frames_per_second = 25.0;
};

/// An animated surface: the poses, and the vertices that an actor gave them. Memory: 12 bytes per vertex and frame.
struct FigureClip {
  double frames_per_second = 25.0;
  std::vector<std::vector<double>> dofs;     ///< [T][D]
  std::vector<std::vector<float>> vertices;  ///< [T][3N] world metres
  std::vector<ClipPart> parts;               ///< several animations, one after the other; empty: one

  int num_frames() const { return static_cast<int>(dofs.size()); }
  /// The animations: its parts; without parts all frames, if there are any, by the given name.
  std::vector<ClipPart> animations(const std::string& name) const;
};

/// The rest vertices with which the linear blend comes nearest to the clip: for each vertex the b with the least
/// sum_t |M_t b - v_t|^2, where M_t is its blended matrix in frame t. A small damping pulls b to the figure's own rest
/// vertex. Without frames, these are the result. @return [N] metres
std::vector<Eigen::Vector3d> fitted_rest_vertices(const Figure& figure, const Skeleton& skeleton,
                                                  const FigureClip& clip);

/// Displacements of the rest vertices. The surface of a frame is the linear blend of rest vertices + sum_k weights(t,
/// k) targets[k]. The targets hold the motion of the clothes, and what dual quaternions do better than a linear blend.
struct MorphTargets {
  std::vector<Eigen::MatrixX3f> targets;  ///< [K] of [N, 3], metres
  Eigen::MatrixXd weights;                ///< [T, K], 0 to 1
  int at_once = 0;                        ///< largest number of targets that a frame may use
  bool exhausted = false;                 ///< vertices are more than 5 mm off, because more targets are not allowed
  /// [K] unique: `Frames2_Way1`, `Frames2_Way2`, ... are the components of the second group of frames, largest first,
  /// and `Frames2_Base` is what all of them start from.
  std::vector<std::string> names;

  int count() const { return static_cast<int>(targets.size()); }
};

/// The mean and the principal components of the frames' displacements in the rest pose, largest first, and for each
/// frame the weights with the least squared distance from its vertices. Where a vertex would be more than 5 mm off, the
/// frames are divided into groups of similar surfaces, wherever in the clip these are, and each group gets targets of
/// its own; up to 256 targets are made in all. The components are those of at most 512 frames of a group, spread
/// evenly.
/// @param count largest number of targets with a weight in any frame; fewer are made where fewer components are there.
/// Nothing: 8. If 256 targets do not suffice then, 16, 32, ... 256 are tried. The first number that suffices is taken,
/// else the one with the nearest surface.
MorphTargets fit_morphs(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip,
                        std::optional<int> count);

/// One value of each node and morph target per frame, as a file states them.
struct FigureTracks {
  std::vector<std::vector<Eigen::Quaterniond>> rotation;  ///< [B][T] node to parent
  std::vector<std::vector<Eigen::Vector3d>> translation;  ///< [B][T] node to parent, metres
  Eigen::MatrixXd weights;                                ///< [T, K]
  std::vector<std::vector<int>> rotation_keys;            ///< [B] frames that a file needs
  std::vector<std::vector<int>> translation_keys;         ///< [B]
  std::vector<int> weight_keys;

  std::size_t num_keys() const;  ///< of all nodes and of the weights
};

/// The tracks with as few keys as keep linear interpolation (spherical for rotations) within `tolerance`. The values
/// between keys are replaced by the interpolated ones. Each part of the clip has keys of its own, from its first frame.
/// @param tolerance metres, of a point one metre from the joint
FigureTracks thin_tracks(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip,
                         const MorphTargets& morphs, double tolerance);

/// The same of nodes that the skeleton does not pose. @param posed [T][B] node to world
FigureTracks thin_tracks(const Figure& figure, const std::vector<std::vector<Eigen::Affine3d>>& posed,
                         const FigureClip& clip, const MorphTargets& morphs, double tolerance);

/// Replaces the values of the frames between keys by what a viewer interpolates. Tracks with one key stay.
void interpolate_between_keys(FigureTracks& tracks);

/// [N] the vertices that tracks and targets give in frame t, world metres.
std::vector<Eigen::Vector3d> figure_surface(const Figure& figure, const MorphTargets& morphs,
                                            const FigureTracks& tracks, std::size_t t);

/// Distance of the vertices that tracks and targets give from those of the clip, over all frames: millimetres.
struct FigureError {
  double mean = 0.0, worst = 0.0;
};
FigureError figure_error(const Figure& figure, const FigureClip& clip, const MorphTargets& morphs,
                         const FigureTracks& tracks);

}  // namespace doppel
