#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/scan/voxel_solid.h"

namespace doppel {

/// The mesh with all vertices in one cell of a grid merged into their mean. Faces without area are dropped, doubled
/// ones stay: the winding number keeps its value away from the surface. Vertices that are not finite lose their faces.
/// @param box faces that reach beyond it are dropped
TriangleMesh clustered(const TriangleMesh& mesh, double cell, const Eigen::AlignedBox3d& box,
                       std::vector<int>& cluster);

/// A coarse image of what stands in a scan, in the scan's own coordinates: free of specks and of a floor.
struct CoarseBody {
  VoxelSolid solid;
  std::vector<Eigen::Vector3d> cells;  ///< centres of the inside cells, file coordinates
  Eigen::AlignedBox3d box;             ///< of the original vertices that belong to the body
  int floor_direction = -1;            ///< 2 axis + (1 if up is negative) of a floor that was found, or -1
  double largest_share = 1.0;          ///< of the largest body in the surface of all large ones
};

/// @throws UsageError when no triangle has finite corners
CoarseBody coarse_body(const TriangleMesh& mesh);

/// The unit vector of direction 0..5: +x -x +y -y +z -z.
Eigen::Vector3d axis_direction(int direction);

/// What tells up from down, for one direction taken as up.
struct UpCues {
  double balance = 0.0;    ///< height of the centre of volume, 0..1
  double gap_below = 0.0;  ///< share of the height, from below, where the vertical line through the centre is outside
  double gap_above = 0.0;  ///< the same from above
  double flat_below = 0.0, flat_above = 0.0;  ///< area of the end over the area a little further on
  /// How much more the shape is that of a body standing so than that of one upside down; a logarithm of odds.
  double score() const;
};
UpCues up_cues(const CoarseBody& body, int direction);

/// Which way the person faces.
struct Facing {
  Eigen::Vector3d direction;
  double mirror = 0.0;  ///< share of the body whose mirror image is in the body
};
/// @return nothing when the feet do not tell
std::optional<Facing> find_facing(const CoarseBody& body, int up_direction);

}  // namespace doppel
