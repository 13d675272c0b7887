#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// One mesh of a scan with its own material.
struct ScanPart {
  std::string name;   ///< of the mesh or material, for messages
  TriangleMesh mesh;  ///< in the file's coordinates and unit; `mesh.texture` is this part's texture, or empty
  Eigen::Vector3d colour = Eigen::Vector3d::Constant(0.8);  ///< RGB 0..1 where there is no texture and no vertex colour
};

/// A scan as read from a file: several meshes in one coordinate system. Readers of files fill it.
struct ScanParts {
  std::vector<ScanPart> parts;
};

/// The largest scan that this module takes. Reading, repairing and simplifying a scan needs about 0.35 kB of memory per
/// triangle (7 GB for the largest scan) besides its textures.
inline constexpr long kMaxScanTriangles = 20'000'000;

/// @throws UsageError when arrays do not fit each other, an index is out of range, there are no faces, or there are
/// more
///   than kMaxScanTriangles. Positions may be NaN: the repair removes them.
/// @param what for the message: "reading the scan"
void check_scan_mesh(const TriangleMesh& mesh, const std::string& what);

}  // namespace doppel
