#include <ostream>

#include "doppel/io/figure_export/usda_text.h"

namespace doppel {
namespace {

std::string points_of(const std::vector<float>& vertices) {
  std::string text = "[";
  for (std::size_t i = 0; i < vertices.size(); i += 3)
    fmt::format_to(std::back_inserter(text), "{}({:.7g}, {:.7g}, {:.7g})", i == 0 ? "" : ", ", vertices[i],
                   vertices[i + 1], vertices[i + 2]);
  return text + "]";
}

}  // namespace

void write_usda(const std::filesystem::path& path, const FigureFile& file) {
  const std::string root = usda_name(file.name), texture = path.stem().string() + ".png";
  const bool textured = write_usda_texture(path, file.mesh, texture);
  write_usda_text(path, [&](std::ostream& out) {
    out << usda_layer(root, file.clip) << usda_root("Xform", root) << "    def Mesh \"Surface\""
        << usda_surface_schemas(textured, "") << "\n    {\n"
        << usda_topology(root, file.mesh, textured);
    const auto samples = [&](const char* attribute, const auto& value) {
      out << "        " << attribute << ".timeSamples = {\n";
      for (int t = 0; t < file.clip.num_frames(); ++t)
        out << "            " << t << ": " << value(file.clip.vertices[t]) << ",\n";
      out << "        }\n";
    };
    samples("point3f[] points", points_of);
    out << "        normal3f[] normals (\n            interpolation = \"vertex\"\n        )\n";
    samples("normal3f[] normals", [&](const auto& vertices) { return usda_normals(file.mesh, vertices); });
    samples("float3[] extent", usda_extent);
    out << "    }\n" << (textured ? usda_material(root, texture) : "") << "}\n";
  });
}

}  // namespace doppel
