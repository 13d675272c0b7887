#include "doppel/rigging/scan/scan_parts.h"

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

void check_indices(const std::vector<Triangle>& faces, std::size_t count, const char* kind, const std::string& what) {
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const int index : faces[f])
      if (index < 0 || as_size(index) >= count)
        fail<UsageError>("{}: triangle {} names {} {}, but there are {} (counted from 0); export the scan again", what,
                         f, kind, index, count);
}

}  // namespace

void check_scan_mesh(const TriangleMesh& mesh, const std::string& what) {
  if (mesh.faces.empty())
    fail<UsageError>(
        "{}: found {} vertices but no triangles; a surface is needed, so let the scanning program make a mesh of the "
        "points",
        what, mesh.vertices.size());
  if (static_cast<long>(mesh.faces.size()) > kMaxScanTriangles)
    fail<UsageError>(
        "{}: found {} triangles, at most {} are allowed (about 7 GB of memory); reduce the scan in the scanning "
        "program "
        "first (decimate it, for example to 2 million)",
        what, mesh.faces.size(), kMaxScanTriangles);
  check_indices(mesh.faces, mesh.vertices.size(), "vertex", what);
  check_indices(mesh.face_uvs, mesh.uvs.size(), "texture coordinate", what);
  if (!mesh.face_uvs.empty() && mesh.face_uvs.size() != mesh.faces.size())
    fail<UsageError>("{}: found texture coordinates of {} triangles for {} triangles; give all of them or none", what,
                     mesh.face_uvs.size(), mesh.faces.size());
  if (!mesh.colours.empty() && mesh.colours.size() != mesh.vertices.size())
    fail<UsageError>("{}: found {} colours for {} vertices; give all of them or none", what, mesh.colours.size(),
                     mesh.vertices.size());
}

}  // namespace doppel
