#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

/// A rig in one test pose.
struct PoseBend {
  std::string pose;                    ///< the name of the TestPose
  int stretched = 0;                   ///< triangles that stretch more than kStretchLimit (triangle_stretches)
  int stretched_alone = 0;             ///< those of them that do so without their neighbours (count_stretched)
  double largest_stretch = 1.0;        ///< of any triangle
  int sticking = 0;                    ///< vertices that another limb drags along (StickingVertices)
  std::optional<double> elbow_volume;  ///< relative to the rest pose (LimbPiece); of left and right the one farther
                                       ///< from 1; nothing where no triangle belongs to the piece
  std::optional<double> knee_volume;   ///< in the same way
};

struct BendReport {
  int triangles = 0, vertices = 0;  ///< of the template
  std::vector<PoseBend> poses;      ///< one for each of test_poses

  /// What exceeds a limit (of volumes: 12 % lost or gained), a sentence for each pose and kind of fault; empty when the
  /// rig bends well.
  std::vector<std::string> faults() const;
  /// The worst figures of all poses in one line.
  std::string summary() const;
};

/// Examines how the template of a character bends in the five test poses, skinned as `character.skinning` says.
/// @throws Error as test_poses, and where the skeleton has no bones of arms and legs: for a character whose skeleton is
///   not of make_body_skeleton
BendReport examine_bending(const Character& character);

}  // namespace doppel
