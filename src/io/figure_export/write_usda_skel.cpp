#include <ostream>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/io/figure_export/usda_text.h"

namespace doppel {
namespace {

/// The paths by which UsdSkel names joints, `Hips/Spine`. Siblings whose names become equal get numbers.
std::vector<std::string> joint_paths(const Figure& figure) {
  std::vector<std::string> paths;
  std::set<std::string> taken;
  for (const FigureNode& node : figure.nodes) {
    const std::string plain = (node.parent < 0 ? "" : paths[node.parent] + "/") + usda_name(node.name);
    std::string path = plain;
    for (int i = 2; !taken.insert(path).second; ++i) path = plain + "_" + std::to_string(i);
    paths.push_back(path);
  }
  return paths;
}

std::string tokens(const std::vector<std::string>& names) {
  return usda_list(names, [](std::string& out, const std::string& name) { out += '"' + name + '"'; });
}

/// USD multiplies rows with matrices: ours, transposed.
std::string matrices(const std::vector<Eigen::Affine3d>& transforms) {
  return usda_list(transforms, [](std::string& out, const Eigen::Affine3d& transform) {
    const Eigen::Matrix4d m = transform.matrix().transpose();
    out += "( ";
    for (int r = 0; r < 4; ++r)
      fmt::format_to(std::back_inserter(out), "{}({:.9g}, {:.9g}, {:.9g}, {:.9g})", r == 0 ? "" : ", ", m(r, 0),
                     m(r, 1), m(r, 2), m(r, 3));
    out += " )";
  });
}

template <typename Vector>
void write_triple(std::string& out, const Vector& v) {
  fmt::format_to(std::back_inserter(out), "({:.7g}, {:.7g}, {:.7g})", v[0], v[1], v[2]);
}

std::string vectors(const std::vector<Eigen::Vector3d>& values) {
  return usda_list(values, [](std::string& out, const Eigen::Vector3d& v) { write_triple(out, v); });
}

class SkelWriter {
 public:
  SkelWriter(const FigureFile& file, const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks,
             std::string texture)
      : file_(file),
        figure_(figure),
        morphs_(morphs),
        tracks_(tracks),
        texture_(std::move(texture)),
        root_(usda_name(file.name)),
        joints_(joint_paths(figure)) {
    for (int k = 0; k < morphs.count(); ++k)
      shapes_.push_back(morphs.names.empty() ? fmt::format("Shape_{}", k) : usda_name(morphs.names[as_size(k)]));
  }

  void write(std::ostream& out) const {
    out << usda_layer(root_, file_.clip) << usda_root("SkelRoot", root_);
    write_samples(out, "    ", "float3[] extent",
                  [this](int t) { return usda_extent(file_.clip.vertices[as_size(t)]); });
    out << "\n";
    write_skeleton(out);
    write_animation(out);
    write_surface(out);
    out << (texture_.empty() ? "" : usda_material(root_, texture_)) << "}\n";
  }

 private:
  void write_skeleton(std::ostream& out) const {
    std::vector<Eigen::Affine3d> local;
    for (std::size_t i = 0; i < figure_.nodes.size(); ++i) {
      const int parent = figure_.nodes[i].parent;
      local.push_back(parent < 0 ? figure_.rest[i] : figure_.rest[parent].inverse() * figure_.rest[i]);
    }
    out << "    def Skeleton \"Skeleton\" (\n        prepend apiSchemas = [\"SkelBindingAPI\"]\n    )\n    {\n"
        << "        uniform token[] joints = " << tokens(joints_) << "\n"
        << "        uniform matrix4d[] bindTransforms = " << matrices(figure_.rest) << "\n"
        << "        uniform matrix4d[] restTransforms = " << matrices(local) << "\n"
        << "        rel skel:animationSource = </" << root_ << "/Animation>\n    }\n\n";
  }

  /// One line per frame. Readers that take the values without a time find those of the first frame.
  /// @param value the text of frame t
  template <typename Value>
  void write_samples(std::ostream& out, const char* indent, const char* attribute, const Value& value) const {
    if (file_.clip.num_frames() == 0) return;
    out << indent << attribute << " = " << value(0) << "\n" << indent << attribute << ".timeSamples = {\n";
    for (int t = 0; t < file_.clip.num_frames(); ++t) out << indent << "    " << t << ": " << value(t) << ",\n";
    out << indent << "}\n";
  }

  void write_animation(std::ostream& out) const {
    out << "    def SkelAnimation \"Animation\"\n    {\n        uniform token[] joints = " << tokens(joints_) << "\n";
    const char* indent = "        ";
    write_samples(out, indent, "float3[] translations", [&](int t) {
      return usda_list(tracks_.translation,
                       [&](std::string& text, const auto& track) { write_triple(text, track[t]); });
    });
    write_samples(out, indent, "quatf[] rotations", [&](int t) {
      return usda_list(tracks_.rotation, [&](std::string& text, const auto& track) {
        const Eigen::Quaterniond& q = track[t];
        fmt::format_to(std::back_inserter(text), "({:.7g}, {:.7g}, {:.7g}, {:.7g})", q.w(), q.x(), q.y(), q.z());
      });
    });
    out << "        half3[] scales = "
        << usda_list(joints_, [](std::string& text, const auto&) { text += "(1, 1, 1)"; }) << "\n";
    if (!shapes_.empty()) {
      out << "        uniform token[] blendShapes = " << tokens(shapes_) << "\n";
      write_samples(out, indent, "float[] blendShapeWeights", [&](int t) {
        const Eigen::RowVectorXd weights = tracks_.weights.row(t);
        return usda_list(weights,
                         [](std::string& text, double w) { fmt::format_to(std::back_inserter(text), "{:.7g}", w); });
      });
    }
    out << "    }\n\n";
  }

  void write_surface(std::ostream& out) const {
    const bool textured = !texture_.empty();
    const std::vector<float> rest = flat_vertices(figure_.rest_vertices);
    out << "    def Mesh \"Surface\"" << usda_surface_schemas(textured, "\"SkelBindingAPI\"") << "\n    {\n"
        << usda_topology(root_, file_.mesh, textured) << "        point3f[] points = " << vectors(figure_.rest_vertices)
        << "\n        normal3f[] normals = " << usda_normals(file_.mesh, rest)
        << " (\n            interpolation = \"vertex\"\n        )\n        float3[] extent = " << usda_extent(rest)
        << "\n";
    write_weights(out);
    out << "        rel skel:skeleton = </" << root_ << "/Skeleton>\n";
    if (!shapes_.empty()) {
      out << "        uniform token[] skel:blendShapes = " << tokens(shapes_) << "\n"
          << "        rel skel:blendShapeTargets = "
          << usda_list(shapes_, [&](std::string& text,
                                    const std::string& name) { text += "</" + root_ + "/Surface/" + name + ">"; })
          << "\n";
    }
    for (std::size_t k = 0; k < shapes_.size(); ++k)
      out << "\n        def BlendShape \"" << shapes_[k] << "\"\n        {\n            uniform vector3f[] offsets = "
          << usda_list(morphs_.targets[k].rowwise(),
                       [](std::string& text, const auto& row) { write_triple(text, row); })
          << "\n        }\n";
    out << "    }\n";
  }

  void write_weights(std::ostream& out) const {
    const char* kind = " (\n            elementSize = 4\n            interpolation = \"vertex\"\n        )\n";
    out << "        matrix4d primvars:skel:geomBindTransform = "
        << "( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )\n"
        << "        int[] primvars:skel:jointIndices = "
        << usda_list(figure_.node,
                     [](std::string& text, const auto& n) {
                       fmt::format_to(std::back_inserter(text), "{}, {}, {}, {}", n[0], n[1], n[2], n[3]);
                     })
        << kind << "        float[] primvars:skel:jointWeights = "
        << usda_list(figure_.weight,
                     [](std::string& text, const auto& w) {
                       fmt::format_to(std::back_inserter(text), "{:.7g}, {:.7g}, {:.7g}, {:.7g}", w[0], w[1], w[2],
                                      w[3]);
                     })
        << kind;
  }

  const FigureFile& file_;
  const Figure& figure_;
  const MorphTargets& morphs_;
  const FigureTracks& tracks_;
  const std::string texture_, root_;
  const std::vector<std::string> joints_;
  std::vector<std::string> shapes_;
};

}  // namespace

void write_usda_skel(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
                     const MorphTargets& morphs, const FigureTracks& tracks, const std::string& texture) {
  const bool textured = write_usda_texture(path, file.mesh, texture);
  write_usda_text(
      path, [&](std::ostream& out) { SkelWriter(file, figure, morphs, tracks, textured ? texture : "").write(out); });
}

}  // namespace doppel
