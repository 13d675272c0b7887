#include "doppel/io/figure_export/usda_text.h"

#include <array>
#include <cctype>
#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/geometry/image_file.h"
#include "doppel/io/scene/srgb.h"

namespace doppel {

std::string usda_name(const std::string& name) {
  std::string result;
  for (const char c : name) result += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return result.empty() || std::isdigit(static_cast<unsigned char>(result[0])) != 0 ? "_" + result : result;
}

std::string usda_layer(const std::string& root, const FigureClip& clip) {
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
)",
                     root, clip.num_frames() - 1, clip.frames_per_second);
}

std::string usda_root(const char* type, const std::string& root) {
  return fmt::format("\ndef {} \"{}\" (\n    kind = \"component\"\n)\n{{\n", type, root);
}

std::string usda_normals(const TriangleMesh& mesh, const std::vector<float>& vertices) {
  TriangleMesh moved;
  moved.faces = mesh.faces;
  for (std::size_t i = 0; i + 3 <= vertices.size(); i += 3)
    moved.vertices.emplace_back(vertices[i], vertices[i + 1], vertices[i + 2]);
  return usda_list(vertex_normals(moved), [](std::string& out, const Eigen::Vector3d& normal) {
    const Eigen::Vector3d n = normal.squaredNorm() < 0.5 ? Eigen::Vector3d(0.0, 1.0, 0.0) : normal;
    fmt::format_to(std::back_inserter(out), "({:.4f}, {:.4f}, {:.4f})", n.x(), n.y(), n.z());
  });
}

std::string usda_extent(const std::vector<float>& vertices) {
  const Eigen::Map<const Eigen::Matrix3Xf> points(vertices.data(), 3, static_cast<Eigen::Index>(vertices.size() / 3));
  const std::array<Eigen::Vector3f, 2> corners{points.rowwise().minCoeff(), points.rowwise().maxCoeff()};
  return usda_list(corners, [](std::string& out, const Eigen::Vector3f& corner) {
    fmt::format_to(std::back_inserter(out), "({:.7g}, {:.7g}, {:.7g})", corner.x(), corner.y(), corner.z());
  });
}

std::vector<float> flat_vertices(const std::vector<Eigen::Vector3d>& positions) {
  std::vector<float> values;
  for (const Eigen::Vector3d& position : positions)
    for (int axis = 0; axis < 3; ++axis) values.push_back(static_cast<float>(position[axis]));
  return values;
}

std::string usda_surface_schemas(bool textured, const std::string& schemas) {
  const std::string material = textured ? "\"MaterialBindingAPI\"" : "";
  const std::string all = schemas + (schemas.empty() || material.empty() ? "" : ", ") + material;
  return all.empty() ? "" : " (\n        prepend apiSchemas = [" + all + "]\n    )";
}

std::string usda_topology(const std::string& root, const TriangleMesh& mesh, bool textured) {
  const auto triple = [](std::string& text, const Triangle& t) {
    fmt::format_to(std::back_inserter(text), "{}, {}, {}", t[0], t[1], t[2]);
  };
  const auto pair = [](std::string& text, const Eigen::Vector2d& uv) {
    fmt::format_to(std::back_inserter(text), "({:.7g}, {:.7g})", uv.x(), uv.y());
  };
  std::string text = "        uniform token subdivisionScheme = \"none\"\n        uniform bool doubleSided = 1\n";
  if (textured) text += fmt::format("        rel material:binding = </{}/Material>\n", root);
  text += "        int[] faceVertexCounts = " +
          usda_list(mesh.faces, [](std::string& out, const Triangle&) { out += '3'; }) + "\n" +
          "        int[] faceVertexIndices = " + usda_list(mesh.faces, triple) + "\n";
  if (!textured && !mesh.colours.empty()) {
    const auto linear = [](std::string& out, const Eigen::Vector3d& c) {
      fmt::format_to(std::back_inserter(out), "({:.5g}, {:.5g}, {:.5g})", linear_of_srgb(c.x()), linear_of_srgb(c.y()),
                     linear_of_srgb(c.z()));
    };
    text += "        color3f[] primvars:displayColor = " + usda_list(mesh.colours, linear) +
            " (\n            interpolation = \"vertex\"\n        )\n";
  }
  if (mesh.uvs.empty() || mesh.face_uvs.empty()) return text;
  return text + "        texCoord2f[] primvars:st = " + usda_list(mesh.uvs, pair) +
         " (\n            interpolation = \"faceVarying\"\n        )\n" +
         "        int[] primvars:st:indices = " + usda_list(mesh.face_uvs, triple) + "\n";
}

std::string usda_material(const std::string& root, const std::string& texture) {
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

bool write_usda_texture(const std::filesystem::path& path, const TriangleMesh& mesh, const std::string& name) {
  if (mesh.texture.empty() || mesh.face_uvs.empty()) return false;
  write_image(path.parent_path() / name, mesh.texture);
  return true;
}

void write_usda_text(const std::filesystem::path& path, const std::function<void(std::ostream&)>& write) {
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    write(out);
    out.close();
    if (!out) fail("{}: writing failed; is the disk full?", path.string());
  });
}

}  // namespace doppel
