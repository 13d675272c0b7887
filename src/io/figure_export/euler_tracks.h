#pragma once

#include <vector>

#include "doppel/io/figure_export/figure_clip.h"

namespace doppel {

/// The rotation of a node as Euler angles, relative to its rest pose: keys, and straight lines between them.
struct EulerTrack {
  std::vector<double> frames;  ///< [K] times of the keys, ascending; between two frames where angles turn fast
  std::vector<Eigen::Vector3d> degrees;  ///< [K] about x, y, z, of which x is applied first; without jumps

  /// The angles at a time; those of the first and last key outside. @param frame not always whole
  Eigen::Vector3d at(double frame) const;
};

/// Euler angles of a rotation, degrees about x, y, z, of which x is applied first.
Eigen::Vector3d euler_angles(const Eigen::Quaterniond& rotation);

/// [B] transforms of the nodes in the rest pose, node to parent.
std::vector<Eigen::Affine3d> rest_to_parent(const Figure& figure);

/// The rotations of the tracks as Euler angles [B]. They have the keys of the tracks, and more where straight lines
/// between Euler angles, or between the quaternions that some programs make of the keys, leave the tracks' spherical
/// interpolation by more than the tolerance. Near the pole of the angles there are keys between frames too. Tracks
/// without frames give no list.
/// @param tolerance radians
std::vector<EulerTrack> euler_tracks(const Figure& figure, const FigureTracks& tracks, double tolerance);

/// The tracks as a program shows them that interpolates Euler angles: the rotations of all frames are replaced. The
/// lists of keys stay.
FigureTracks with_euler_rotations(const Figure& figure, FigureTracks tracks, const std::vector<EulerTrack>& turns);

}  // namespace doppel
