#pragma once

#include <string>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// Lengths are shares of the height of the mesh, so that a child's scan is treated as an adult's.
struct RepairOptions {
  double weld_distance = 1e-5;   ///< border vertices closer than this are one vertex
  double speck_size = 0.06;      ///< largest diagonal of a component that may be a speck
  double speck_distance = 0.01;  ///< a component nearer to the body than this belongs to it (hair, eyes, buttons)
  /// Holes with a shorter border are filled. In a scan of one surface every opening is a hole; in a body of several
  /// parts the larger ones are cuffs and hems.
  double hole_length_one_surface = 0.6, hole_length_parts = 0.06;
  int hole_edges = 400;      ///< holes with more edges stay open
  bool remove_floor = true;  ///< a horizontal sheet under the feet (y is up)
};

/// What a repair found. Counts are of the mesh as it came.
struct RepairReport {
  int lost_vertices = 0;            ///< positions that are not finite
  std::vector<int> lost_named;      ///< the first of them, counted from 0
  int lost_faces = 0;               ///< faces that used them
  int welded_vertices = 0;          ///< vertices merged into others
  int degenerate_faces = 0;         ///< dropped: without area
  int duplicate_faces = 0;          ///< dropped: the same three vertices as another face
  int non_manifold_edges = 0;       ///< edges of more than two faces: the faces were parted there
  int split_vertices = 0;           ///< vertices added where faces were parted or touched in a vertex only
  int turned_faces = 0;             ///< faces whose winding was reversed
  int specks = 0, speck_faces = 0;  ///< components removed
  int floor_faces = 0;              ///< removed
  int holes = 0, hole_faces = 0;    ///< filled holes, triangles added
  int open_borders = 0;             ///< closed border lines that stay
  int components = 0;               ///< of the mesh that results
  /// Plain sentences, the most important first; empty when nothing was mended.
  std::vector<std::string> sentences() const;
};

struct RepairedMesh {
  TriangleMesh mesh;
  RepairReport report;
};

/// Mends a scan: loses vertices that are not finite, welds doubled vertices along borders (UVs are per corner, so seams
/// stay), drops degenerate and duplicate faces, removes specks and a floor, parts faces at non-manifold edges and
/// vertices, winds all faces of a component alike and outwards, and fills small holes. The triangles of a hole take the
/// colours and UVs of its border. Components near the body stay, open borders too. Deterministic.
/// @param mesh in the character frame: y up (the unit does not matter)
/// @throws UsageError for a mesh without faces or with wrong indices, or when nothing is left
RepairedMesh repair(const TriangleMesh& mesh, const RepairOptions& options = {});

}  // namespace doppel
