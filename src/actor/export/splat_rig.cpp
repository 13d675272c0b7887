#include "doppel/actor/export/splat_rig.h"

#include <algorithm>

#include "doppel/actor/export/splat_primitive.h"
#include "doppel/core/as_size.h"
#include "doppel/io/figure_export/compressed_figure.h"
#include "doppel/io/figure_export/glb_skeleton.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr int kMeasuredFrames = 200;

/// Vertices as a batch of one. @return float32 [1,N,3]
Tensor batch_of_one(const std::vector<Eigen::Vector3d>& vertices) {
  const Tensor batch = torch::empty({1, static_cast<std::int64_t>(vertices.size()), 3});
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const Eigen::Vector3f vertex = vertices[v].cast<float>();
    std::copy_n(vertex.data(), 3, batch.data_ptr<float>() + 3 * v);
  }
  return batch;
}

/// The centres of Gaussians as points of their texels. @param centres [P,3]
std::vector<FigurePoint> texel_points(const TexelPoints& texels, const Tensor& centres) {
  const Tensor corners = texels.corners.contiguous(), weights = texels.weights.to(torch::kFloat64).contiguous(),
               rest = centres.to(torch::kFloat64).contiguous();
  std::vector<FigurePoint> points(as_size(corners.size(0)));
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].rest = Eigen::Vector3d(rest.data_ptr<double>() + 3 * i);
    std::copy_n(corners.data_ptr<std::int64_t>() + 3 * i, 3, points[i].corners.begin());
    std::copy_n(weights.data_ptr<double>() + 3 * i, 3, points[i].barycentrics.begin());
  }
  return points;
}

/// The Gaussians without the changes of a network on a surface. @param vertices [1,N,3] world, metres
Splats shared_splats(const RenderMesh& mesh, Gaussians& gaussians, const Tensor& vertices) {
  return gaussians->forward(surface_frames(vertices, mesh, gaussians->points()), std::nullopt);
}

class SplatRigWriter : public SequenceWriter {
 public:
  SplatRigWriter(const std::filesystem::path& folder, TrainedActor& actor, const SplatRigOptions& options,
                 SplatRigReport& report)
      : path_(folder / "splats_rig.glb"),
        actor_(actor),
        options_(options),
        report_(report),
        body_(make_figure(actor.character, options.names)) {  // refuses names that do not fit before the first frame
    clip_.frames_per_second = options.frames_per_second;
    clip_.parts = options.parts;
  }

  void write(const PosedFrame& frame) override { append_frame(clip_, frame); }

  void close() override {
    const Skeleton& skeleton = actor_.character.skeleton;
    const SplatRig rig = make_splat_rig(actor_.character, fitted_rest_vertices(body_, skeleton, clip_), *actor_.mesh,
                                        actor_.gaussians, options_.names);
    const FigureTracks tracks = thin_tracks(rig.figure, skeleton, clip_, {}, options_.tolerance);
    if (options_.compress)
      write_compressed(rig, compress_figure(rig.figure, {}, tracks));
    else
      write_splat_rig(path_, actor_.character.name, rig, tracks, clip_.animations(actor_.character.name));
    report_.gaussians = rig.splats.positions.size(1);
    report_.figure.nodes = static_cast<int>(rig.figure.nodes.size());
    report_.figure.keys = tracks.num_keys();
    report_.figure.largest_dropped_weight = rig.figure.largest_dropped_weight;
    measure(rig);
  }

 private:
  void write_compressed(const SplatRig& rig, const CompressedFigure& packed) {
    report_.figure.compression = packed.error;
    write_splat_rig(path_, actor_.character.name, {rig.splats, packed.figure}, packed.tracks,
                    clip_.animations(actor_.character.name), packed.steps);
  }

  void measure(const SplatRig& rig) {
    const torch::NoGradGuard no_gradient;
    const int frames = clip_.num_frames(), used = std::min(frames, kMeasuredFrames);
    for (int i = 0; i < used; ++i) {
      const int t = static_cast<int>(static_cast<long>(i) * frames / used);
      const Tensor vertices = torch::from_blob(clip_.vertices[t].data(), {1, actor_.character.num_vertices(), 3}),
                   wanted = shared_splats(*actor_.mesh, actor_.gaussians, vertices).positions[0],
                   found = posed_centres(rig, actor_.character.skeleton, clip_.dofs[t]),
                   distance = 1000.0 * (found - wanted).norm(2, 1);
      report_.figure.mean_error_mm += distance.mean().item<double>() / used;
      report_.figure.worst_error_mm = std::max(report_.figure.worst_error_mm, distance.max().item<double>());
    }
  }

  std::filesystem::path path_;
  TrainedActor& actor_;
  SplatRigOptions options_;
  SplatRigReport& report_;
  Figure body_;  ///< the bones with the vertices of the template
  FigureClip clip_;
};

}  // namespace

SplatRig make_splat_rig(const Character& character, const std::vector<Eigen::Vector3d>& surface, const RenderMesh& mesh,
                        Gaussians& gaussians, BoneNames names) {
  const torch::NoGradGuard no_gradient;
  Figure figure = make_figure(character, names);
  Splats splats = shared_splats(mesh, gaussians, batch_of_one(surface));
  const std::vector<FigurePoint> points = texel_points(gaussians->points(), splats.positions[0]);
  return {std::move(splats), figure_of_points(std::move(figure), character, points)};
}

Tensor posed_centres(const SplatRig& rig, const Skeleton& skeleton, const std::vector<double>& dofs) {
  const std::vector<Eigen::Affine3d> blended = blend_transforms(rig.figure, pose_nodes(rig.figure, skeleton, dofs));
  const Tensor centres = torch::empty({static_cast<std::int64_t>(blended.size()), 3});
  for (std::size_t i = 0; i < blended.size(); ++i) {
    const Eigen::Vector3f centre = (blended[i] * rig.figure.rest_vertices[i]).cast<float>();
    std::copy_n(centre.data(), 3, centres.data_ptr<float>() + 3 * i);
  }
  return centres;
}

void write_splat_rig(const std::filesystem::path& path, const std::string& name, const SplatRig& rig,
                     const FigureTracks& tracks, const std::vector<ClipPart>& animations,
                     const std::optional<GlbSteps>& compression) {
  const torch::NoGradGuard no_gradient;
  const WrittenSplats written = written_splats("writing " + path.string(), rig.splats, 0);
  const auto* index = written.index.data_ptr<std::int64_t>();
  const std::vector<int> points(index, index + written.index.numel());
  tinygltf::Model model = empty_glb_model();
  GlbBuffer buffer(model);
  model.extensionsUsed.emplace_back(kSplatExtension);
  tinygltf::Mesh mesh;
  mesh.name = name;
  mesh.primitives.push_back(splat_primitive(buffer, written));
  add_glb_weights(buffer, rig.figure, points, mesh.primitives[0]);
  model.meshes.push_back(mesh);
  add_glb_skeleton(model, buffer, rig.figure, name, rig.figure.rest);
  for (const ClipPart& part : animations) add_glb_animation(model, buffer, tracks, part);
  write_glb_model(path, model, compression);
}

std::unique_ptr<SequenceWriter> make_splat_rig_writer(const std::filesystem::path& folder, TrainedActor& actor,
                                                      const SplatRigOptions& options, SplatRigReport& report) {
  return std::make_unique<SplatRigWriter>(folder, actor, options, report);
}

}  // namespace doppel
