#include <fmt/format.h>

#include <cctype>
#include <fstream>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/figure_export/write_figure.h"
#include "doppel/geometry/image_file.h"

namespace doppel {
namespace {

/// A name that USD takes: letters, digits and underscores, no digit first.
std::string prim_name(const std::string& name) {
  std::string result;
  for (const char c : name) result += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return result.empty() || std::isdigit(static_cast<unsigned char>(result[0])) != 0 ? "_" + result : result;
}

template <typename Items, typename Format>
std::string joined(const Items& items, const Format& format) {
  std::string text;
  for (const auto& item : items) {
    if (!text.empty()) text += ", ";
    format(text, item);
  }
  return text;
}

std::string points_of(const std::vector<float>& vertices) {
  std::string text = "[";
  for (std::size_t i = 0; i < vertices.size(); i += 3)
    fmt::format_to(std::back_inserter(text), "{}({:.7g}, {:.7g}, {:.7g})", i == 0 ? "" : ", ", vertices[i],
                   vertices[i + 1], vertices[i + 2]);
  return text + "]";
}

std::string topology_of(const TriangleMesh& mesh) {
  const auto triple = [](std::string& text, const Triangle& t) {
    fmt::format_to(std::back_inserter(text), "{}, {}, {}", t[0], t[1], t[2]);
  };
  std::string text = "        int[] faceVertexCounts = [" +
                     joined(mesh.faces, [](std::string& out, const Triangle&) { out += '3'; }) + "]\n" +
                     "        int[] faceVertexIndices = [" + joined(mesh.faces, triple) + "]\n";
  if (mesh.uvs.empty() || mesh.face_uvs.empty()) return text;
  text += "        texCoord2f[] primvars:st = [" +
          joined(mesh.uvs,
                 [](std::string& out, const Eigen::Vector2d& uv) {
                   fmt::format_to(std::back_inserter(out), "({:.7g}, {:.7g})", uv.x(), uv.y());
                 }) +
          "] (\n            interpolation = \"faceVarying\"\n        )\n" + "        int[] primvars:st:indices = [" +
          joined(mesh.face_uvs, triple) + "]\n";
  return text;
}

std::string material_of(const std::string& root, const std::string& texture) {
  const std::string path = "/" + root + "/Material";
  return fmt::format(R"(
    def Material "Material"
    {{
        token outputs:surface.connect = <{0}/Surface.outputs:surface>

        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = <{0}/Texture.outputs:rgb>
            float inputs:metallic = 0
            float inputs:roughness = 0.9
            token outputs:surface
        }}

        def Shader "Texture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./{1}@
            token inputs:sourceColorSpace = "sRGB"
            float2 inputs:st.connect = <{0}/Reader.outputs:result>
            float3 outputs:rgb
        }}

        def Shader "Reader"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
)",
                     path, texture);
}

std::string head_of(const FigureFile& file, const std::string& root, bool textured) {
  return fmt::format(R"(#usda 1.0
(
    defaultPrim = "{0}"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 0
    endTimeCode = {1}
    timeCodesPerSecond = {2:g}
    framesPerSecond = {2:g}
)

def Xform "{0}"
{{
    def Mesh "Surface"{3}
    {{
        uniform token subdivisionScheme = "none"
{4}{5})",
                     root, file.clip.num_frames() - 1, file.clip.frames_per_second,
                     textured ? " (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )" : "",
                     textured ? fmt::format("        rel material:binding = </{}/Material>\n", root) : "",
                     topology_of(file.mesh));
}

}  // namespace

void write_usda(const std::filesystem::path& path, const FigureFile& file) {
  const std::string root = prim_name(file.name), texture = path.stem().string() + ".png";
  const bool textured = !file.mesh.texture.empty() && !file.mesh.face_uvs.empty();
  if (textured) write_image(path.parent_path() / texture, file.mesh.texture);
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    out << head_of(file, root, textured) << "        point3f[] points.timeSamples = {\n";
    for (int t = 0; t < file.clip.num_frames(); ++t)
      out << "            " << t << ": " << points_of(file.clip.vertices[as_size(t)]) << ",\n";
    out << "        }\n    }\n" << (textured ? material_of(root, texture) : "") << "}\n";
    out.close();
    if (!out) fail("{}: writing failed; is the disk full?", path.string());
  });
}

}  // namespace doppel
