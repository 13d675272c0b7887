#include <fmt/format.h>

#include <cstdio>

#include "doppel/actor/export/animation.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "doppel/geometry/mesh.h"

namespace doppel {
namespace {

class NpyWriter : public SequenceWriter {
 public:
  NpyWriter(const std::filesystem::path& folder, int num_vertices)
      : stream_(folder / "vertices.npy", {num_vertices, 3}) {}
  void write(const PosedFrame& frame) override { stream_.append(frame.vertices); }
  void close() override { stream_.close(); }

 private:
  NpyStream stream_;
};

/// The part of an OBJ file after the positions is the same in every frame, so it is formatted once and repeated.
class ObjWriter : public SequenceWriter {
 public:
  ObjWriter(const std::filesystem::path& folder, const Character& character, const FileSpace& space)
      : folder_(folder), space_(space) {
    const TriangleMesh& mesh = character.mesh;
    const bool textured = !mesh.texture.empty() && !mesh.uvs.empty();
    if (textured) {
      write_obj(folder / (character.name + ".obj"), mesh, 1.0);
      std::filesystem::remove(folder / (character.name + ".obj"));
      head_ = "mtllib " + character.name + ".mtl\n";
      tail_ = fmt::format("usemtl {}\n", kObjMaterial);
    }
    for (const Eigen::Vector2d& uv : mesh.uvs) tail_ += fmt::format("vt {:.7g} {:.7g}\n", uv.x(), uv.y());
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      tail_ += 'f';
      for (int corner = 0; corner < 3; ++corner) {
        tail_ += fmt::format(" {}", mesh.faces[f][corner] + 1);
        if (!mesh.face_uvs.empty()) tail_ += fmt::format("/{}", mesh.face_uvs[f][corner] + 1);
      }
      tail_ += '\n';
    }
  }

  void write(const PosedFrame& frame) override {
    std::string text = head_;
    for (std::size_t i = 0; i < frame.vertices.size(); i += 3) {
      const Eigen::Vector3d v = space_.of({frame.vertices[i], frame.vertices[i + 1], frame.vertices[i + 2]});
      fmt::format_to(std::back_inserter(text), "v {:.7g} {:.7g} {:.7g}\n", v.x(), v.y(), v.z());
    }
    write_atomically(folder_ / fmt::format("frame_{:06}.obj", frame_++), text + tail_);
  }
  void close() override {}

 private:
  std::filesystem::path folder_;
  FileSpace space_;
  int frame_ = 0;
  std::string head_, tail_;
};

}  // namespace

std::unique_ptr<SequenceWriter> make_npy_writer(const std::filesystem::path& folder, int num_vertices) {
  return std::make_unique<NpyWriter>(folder, num_vertices);
}

std::unique_ptr<SequenceWriter> make_obj_writer(const std::filesystem::path& folder, const Character& character,
                                                const FileSpace& space) {
  return std::make_unique<ObjWriter>(folder, character, space);
}

}  // namespace doppel
