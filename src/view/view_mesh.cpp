#include "doppel/view/view_mesh.h"

#include <map>
#include <utility>

namespace doppel {
namespace {

template <typename T>
void append(std::string& bytes, const std::vector<T>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

}  // namespace

ViewMesh split_at_seams(const TriangleMesh& mesh) {
  ViewMesh result;
  std::map<std::pair<int, int>, std::uint32_t> known;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const int vertex = mesh.faces[f][corner], uv = mesh.uvs.empty() ? -1 : mesh.face_uvs[f][corner];
      const auto [found, is_new] = known.try_emplace({vertex, uv}, static_cast<std::uint32_t>(result.source.size()));
      if (is_new) {
        result.source.push_back(static_cast<std::uint32_t>(vertex));
        result.uvs.push_back(uv < 0 ? 0.0f : static_cast<float>(mesh.uvs[uv].x()));
        result.uvs.push_back(uv < 0 ? 0.0f : static_cast<float>(mesh.uvs[uv].y()));
      }
      result.corners.push_back(found->second);
    }
  return result;
}

std::string view_mesh_bytes(const ViewMesh& mesh) {
  std::string bytes;
  append(bytes, std::vector<std::uint32_t>{static_cast<std::uint32_t>(mesh.corners.size()),
                                           static_cast<std::uint32_t>(mesh.source.size())});
  append(bytes, mesh.corners);
  append(bytes, mesh.source);
  append(bytes, mesh.uvs);
  return bytes;
}

}  // namespace doppel
