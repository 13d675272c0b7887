#include "doppel/actor/trained_actor.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/stored_stage.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/projection.h"
#include "doppel/render/splats/splat_rows.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

/// The frames per second of EGNet's training. Another capture may have another rate.
double training_rate(const StoredStage& stage, const fs::path& run, const Capture& capture, const fs::path& folder) {
  const double rate = stage.checkpoint.has_text("frames_per_second") ? stage.checkpoint.number("frames_per_second") : 0;
  if (!(rate > 0.0)) return capture.fps;
  if (std::abs(rate - capture.fps) > 1e-3 * rate)
    log::warn(
        "{} was trained at {:g} frames a second, and {} has {:g}: in its motion windows the networks see movements of "
        "{:.3g} times their speed",
        run.string(), rate, folder.string(), capture.fps, rate / capture.fps);
  return rate;
}

void load_egnet(TrainedActor& actor, const StoredStage& stage, const fs::path& run, const fs::path& capture_path) {
  const ConfigReader root = stage.config.root();
  actor.subject = RunSubject::read(stage.config, root, "egnet");
  actor.subject.capture = fs::absolute(capture_path);
  actor.trained_on_cameras = root.section("data").list<std::string>("cameras");
  const Capture capture = read_capture(actor.subject.capture);
  actor.frames_per_second = training_rate(stage, run, capture, actor.subject.capture);
  actor.character = load_character(capture.character_path(), actor.subject.character);
  check_character(stage, actor.character, run, capture.character_path());
  actor.surface = CharacterSurface(actor.character);
  actor.mesh = std::make_shared<RenderMesh>(actor.character.mesh);
  if (!actor.character.mesh.texture.empty() && actor.mesh->has_uvs())
    actor.static_texture = texture_tensor(actor.character.mesh);
  actor.egnet = EgNet(actor.character, read_options<EgNetConfig>(root.section("model")));
  load_evaluation_weights(*actor.egnet, stage.checkpoint);
}

/// Each camera has the light that was learnt for the camera of its name. Another capture may have fewer cameras, or
/// others; a prepared capture lists them.
void load_lighting(TrainedActor& actor, const StoredStage& stage) {
  actor.lighting = Lighting(stage.checkpoint.tensor("model.trained").size(0), std::vector<int>{});
  load_evaluation_weights(*actor.lighting, stage.checkpoint);
  if (!stage.checkpoint.has_text("cameras")) return;
  std::map<std::string, std::int64_t> row_of;
  std::istringstream names(stage.checkpoint.text("cameras"));
  for (std::string name; std::getline(names, name);) row_of.emplace(name, static_cast<std::int64_t>(row_of.size()));
  std::vector<std::int64_t> rows;
  for (const std::string& name : read_capture(actor.subject.capture).cameras)
    rows.push_back(row_of.contains(name) ? row_of.at(name) : -1);
  if (!rows.empty()) actor.lighting->set_rows(rows);
}

void load_delta_net(TrainedActor& actor, const StoredStage& stage) {
  actor.deltanet = DeltaNet(actor.character, read_options<DeltaNetConfig>(stage.config.root().section("model")));
  load_evaluation_weights(*actor.deltanet, stage.checkpoint);
}

void load_tex_net(TrainedActor& actor, const StoredStage& stage) {
  const TexNetConfig config = read_options<TexNetConfig>(stage.config.root().section("model"));
  actor.texnet = make_tex_net(actor, config, at::detail::createCPUGenerator(0));
  actor.texture_space = std::make_shared<TextureSpace>(*actor.mesh, config.size);
  load_evaluation_weights(*actor.texnet, stage.checkpoint);
}

void load_gaussians(TrainedActor& actor, const StoredStage& stage) {
  const GaussiansConfig config = read_options<GaussiansConfig>(stage.config.root().section("model"));
  actor.splat_space = std::make_shared<TextureSpace>(*actor.mesh, config.size);
  actor.gaussians = make_gaussians(actor, *actor.splat_space, config, at::detail::createCPUGenerator(0));
  load_evaluation_weights(*actor.gaussians, stage.checkpoint);
}

void load_radiance(TrainedActor& actor, const StoredStage& stage) {
  const ConfigReader root = stage.config.root();
  actor.hybrid = Hybrid(actor.character, actor.deltanet, read_options<HybridConfig>(root.section("model")));
  load_evaluation_weights(*actor.hybrid, stage.checkpoint);
  actor.field_viewer = std::make_shared<FieldViewer>(actor.character);
  const FieldRays rays = read_options<FieldRays>(root.section("rays"));
  actor.field_image.samples = rays.samples;
  actor.field_stencil = rays.stencil;
}

void load_nerf(TrainedActor& actor, const StoredStage& stage) {
  const ConfigReader root = stage.config.root();
  actor.nerf = PlainField(torch::zeros({1, 3}), read_options<PlainFieldConfig>(root.section("model")));
  load_evaluation_weights(*actor.nerf, stage.checkpoint);
  const ConfigReader data = root.section("data");
  actor.nerf_frame = nerf_frame(actor.subject.open_dataset(), parse_split(data.choice("split", split_words(), "train")),
                                data.list<long>("frames"));
}

/// The loaders of the stages, in the order of training. EGNet is the first stage of every actor and is loaded before
/// these.
struct ActorPart {
  const char* stage;
  void (*load)(TrainedActor& actor, const StoredStage& stage);
};
constexpr ActorPart kActorParts[] = {{"lighting", load_lighting}, {"deltanet", load_delta_net},
                                     {"texnet", load_tex_net},    {"gaussians", load_gaussians},
                                     {"radiance", load_radiance}, {"nerf", load_nerf}};

/// Compares the EGNet and the DeltaNet of an actor with those that its later stages were trained on. The checksum of
/// each is computed once.
class EarlierNetworks {
 public:
  EarlierNetworks(const TrainedActor& actor, const fs::path& run) : actor_(actor), run_(run) {}

  /// Warns where a stage was trained on another network than that of the actor.
  void compare(const std::string& name, const StoredStage& stage) {
    const std::string identity = stage.checkpoint.text("identity");
    compare(name, identity, "egnet", *actor_.egnet);
    if (actor_.deltanet) compare(name, identity, "deltanet", *actor_.deltanet);
  }

 private:
  void compare(const std::string& name, const std::string& identity, const std::string& network,
               const torch::nn::Module& module) {
    const std::size_t at = identity.find(network + " ", std::min(identity.find(", on "), identity.size()));
    if (at == std::string::npos) return;
    const auto [entry, is_new] = sums_.try_emplace(network);
    if (is_new) entry->second = fmt::format("{:08x}", weights_checksum(module));
    if (identity.compare(at + network.size() + 1, entry->second.size(), entry->second) == 0) return;
    log::warn(
        "{}: {} was trained on another {} than the run has now (trained again, or of another run); train {} again",
        run_.string(), name, network, name);
  }

  const TrainedActor& actor_;
  const fs::path& run_;
  std::map<std::string, std::string> sums_;  ///< by network
};

/// For frames one by one. The weights of a loaded actor do not change.
void freeze_networks(TrainedActor& actor) {
  const WeightFormat format = inference_weights();
  freeze_graph_networks(*actor.egnet, format);
  if (actor.deltanet) freeze_graph_networks(*actor.deltanet, format);
  if (actor.hybrid) freeze_graph_networks(*actor.hybrid, format);
}

/// The bone with the largest weight of each vertex. @return int64 [N]
torch::Tensor main_bones(const SkinningWeights& skin) {
  std::vector<std::int64_t> bones;
  for (int v = 0; v < skin.num_vertices(); ++v)
    bones.push_back(
        skin.vertex_bones.items[static_cast<std::size_t>(skin.vertex_bones.offsets[static_cast<std::size_t>(v)])]);
  return torch::tensor(bones);
}

/// A texture resized to another resolution. @param texture [1,Th,Tw,3] @return [size,size,3]
torch::Tensor resized(const torch::Tensor& texture, std::int64_t size) {
  const torch::Tensor planes = texture.permute({0, 3, 1, 2});
  const torch::Tensor out = planes.size(2) >= size && planes.size(3) >= size
                                ? torch::adaptive_avg_pool2d(planes, {size, size})
                                : torch::upsample_bilinear2d(planes, {size, size}, false);
  return out[0].permute({1, 2, 0}).contiguous();
}

}  // namespace

TrainedActor TrainedActor::load(const fs::path& run, const std::optional<fs::path>& capture,
                                const std::optional<std::string>& before) {
  if (!fs::exists(RunFolder(run).config()))
    fail("{} is not a run: it holds no config.yaml; give the --out folder of `doppel train`", run.string());
  const auto egnet_stage = find_stage(run, "egnet");
  if (!egnet_stage) fail("{} has no checkpoint of egnet yet; train it first", run.string());
  TrainedActor actor;
  // The subject of this run. An EGNet from another run may have been trained on another capture.
  RunSubject subject = run_subject(run);
  if (capture) subject.use_capture(*capture);
  load_egnet(actor, *egnet_stage, run, subject.capture);
  actor.subject.validation = subject.validation;
  actor.steps["egnet"] = egnet_stage->step;
  EarlierNetworks earlier(actor, run);
  for (const ActorPart& part : kActorParts) {
    if (before == part.stage) break;
    const auto stage = find_stage(run, part.stage);
    if (!stage) continue;
    earlier.compare(part.stage, *stage);
    part.load(actor, *stage);
    actor.steps[part.stage] = stage->step;
  }
  freeze_networks(actor);
  return actor;
}

int TrainedActor::past_frames() const {
  int longest = egnet->config().history();
  if (deltanet) longest = std::max(longest, deltanet->config().past_frames);
  if (texnet) longest = std::max(longest, texnet->config().past_frames);
  if (gaussians) longest = std::max(longest, gaussians->config().past_frames);
  if (hybrid) longest = std::max(longest, hybrid->config().motion.past_frames);
  return longest;
}

std::pair<torch::Tensor, torch::Tensor> TrainedActor::deformation(const torch::Tensor& seen_window,
                                                                  const torch::Tensor& dof_window) {
  torch::NoGradGuard no_grad;
  return egnet->forward(seen_window, dof_window);
}

torch::Tensor TrainedActor::coarse(const torch::Tensor& dof_window) {
  torch::NoGradGuard no_grad;
  const auto [A, T] = deformation(dof_window);
  return surface->deformed(dof_window.select(1, -1).contiguous(), A, T);
}

torch::Tensor TrainedActor::fine(const torch::Tensor& dof_window) {
  if (!deltanet) return coarse(dof_window);
  torch::NoGradGuard no_grad;
  return displaced(deltanet, dof_window);
}

torch::Tensor TrainedActor::displaced(DeltaNet& network, const torch::Tensor& dof_window) {
  const auto [A, T] = deformation(dof_window);
  const torch::Tensor window = last_rows(dof_window, network->config().past_frames);
  return network->displaced(surface, window, A, T, network->forward(window));
}

torch::Tensor TrainedActor::refined(const torch::Tensor& dof_window) {
  if (!hybrid) return fine(dof_window);
  torch::NoGradGuard no_grad;
  return displaced(hybrid->refined, dof_window);
}

FieldImage TrainedActor::radiance(const torch::Tensor& dof_window, const torch::Tensor& projection, int64_t height,
                                  int64_t width) {
  torch::NoGradGuard no_grad;
  const FieldSurface around{displaced(hybrid->around, dof_window)[0], hybrid->vertex_values(dof_window)};
  return field_viewer->draw(hybrid->field, around, projection, height, width, field_stencil, field_image);
}

torch::Tensor TrainedActor::texture(const torch::Tensor& dof_window, const torch::Tensor& projection) {
  return texture(dof_window, projection, texnet->config().surface_normals ? fine(dof_window) : torch::Tensor());
}

torch::Tensor TrainedActor::texture(const torch::Tensor& dof_window, const torch::Tensor& projection,
                                    const torch::Tensor& vertices) {
  torch::NoGradGuard no_grad;
  return texnet->forward(texture_input(*this, *texture_space, texnet->config(), dof_window, projection, vertices));
}

Splats TrainedActor::splats(const torch::Tensor& dof_window, const torch::Tensor& projection,
                            const torch::Tensor& vertices) {
  torch::NoGradGuard no_grad;
  return posed_splats(*this, gaussians, *splat_space, dof_window, projection, vertices);
}

torch::Tensor TrainedActor::gaussian_rows(const torch::Tensor& dof_window, const torch::Tensor& projection,
                                          const torch::Tensor& vertices) {
  return splat_rows(splats(dof_window, projection, vertices), projection);
}

std::string TrainedActor::digest() const {
  std::string text = fmt::format("egnet {:08x}", weights_checksum(*egnet));
  if (lighting) text += fmt::format(" lighting {:08x}", weights_checksum(*lighting));
  if (deltanet) text += fmt::format(" deltanet {:08x}", weights_checksum(*deltanet));
  return text;
}

void TrainedActor::require_texture(const std::string& what) const {
  if (!mesh->has_uvs())
    fail<UsageError>("{} needs texture coordinates, and the template of {} has none", what, character.name);
  if (!static_texture.defined())
    fail<UsageError>("{} needs a texture, and the template of {} has none; name one in its MTL file (map_Kd)", what,
                     character.name);
}

TexNetInput texture_input(TrainedActor& actor, const TextureSpace& space, const TexNetConfig& config,
                          const torch::Tensor& dof_window, const torch::Tensor& projection,
                          const torch::Tensor& surface) {
  const torch::Tensor window = last_rows(dof_window, config.past_frames);
  const auto frames = window.size(1);
  // Normals do not depend on the position of the root, so the window's translation need not be removed.
  torch::Tensor posed =
      actor.surface->skinned(window.flatten(0, 1)).view({-1, frames, actor.character.num_vertices(), 3});
  if (config.surface_normals) posed = at::cat({posed.narrow(1, 0, frames - 1), surface.unsqueeze(1)}, 1);
  const torch::Tensor points = posed.flatten(0, 1);
  const bool kernel = !torch::GradMode::is_enabled() && takes_kernel(points);
  const torch::Tensor normals = (kernel ? space.normals_without_gradient(points) : space.normals(points))
                                    .view({-1, 3 * frames, space.size(), space.size()});
  const CameraPlacement camera = camera_placement(projection);
  const torch::Tensor centre = texnet_camera_centre(config, MotionWindow(actor.character.skeleton), camera.centre,
                                                    window.select(1, -1).contiguous());
  return texnet_input(normals, centre, camera.forward);
}

namespace {

/// How the limbs shade the texels of the Gaussians. @param normal_sums [B,N,3] of the vertices
Occlusion texel_occlusion(const BodySpheres& spheres, const TexelPoints& points, const torch::Tensor& vertices,
                          const torch::Tensor& normal_sums) {
  const Occlusion found = spheres.at(vertices, unit_vectors(normal_sums));
  return {at_points(found.amount.unsqueeze(2), points).squeeze(2), unit_vectors(at_points(found.direction, points))};
}

}  // namespace

Splats posed_splats(TrainedActor& actor, Gaussians& gaussians, const TextureSpace& space,
                    const torch::Tensor& dof_window, const torch::Tensor& projection, const torch::Tensor& vertices,
                    const std::optional<at::Generator>& generator, const BatchShare& share) {
  SurfaceFrames frames;
  Occlusion occlusion;
  std::optional<TexNetInput> maps;
  {
    const torch::NoGradGuard no_grad;
    const GaussiansConfig& config = gaussians->config();
    const torch::Tensor normal_sums = vertex_normal_sums(vertices, *actor.mesh);
    frames = surface_frames(vertices, normal_sums, gaussians->points());
    if (config.shadows) occlusion = texel_occlusion(*actor.body_spheres, gaussians->points(), vertices, normal_sums);
    if (config.network) maps = texture_input(actor, space, config.maps(), dof_window, projection, vertices);
  }
  return gaussians->forward(frames, maps, generator, share, occlusion);
}

SampleId nerf_frame(const Dataset& dataset, Split split, const std::vector<long>& frames) {
  const std::vector<SampleId> samples = chosen_samples(dataset, split, frames);
  if (samples.size() != 1)
    fail<UsageError>(
        "nerf: a field without a mesh needs exactly one frame, found {}; name it: --set nerf.data.frames=[{}]",
        samples.size(), samples.front().frame);
  return samples.front();
}

namespace {

/// The lighting that the trained cameras share, [3,9]. @param stage that needs it, for the message
torch::Tensor shared_lighting(const TrainedActor& actor, const char* stage) {
  if (!actor.lighting)
    fail<UsageError>(
        "{}: model.lit is true and the stage `lighting` has not been trained; train it first, or set model.lit to "
        "false",
        stage);
  return actor.lighting->mean().squeeze(0);
}

}  // namespace

TexNet make_tex_net(const TrainedActor& actor, const TexNetConfig& config, at::Generator generator) {
  if (!actor.mesh->has_uvs()) actor.require_texture("texnet");
  torch::Tensor base, light;
  if (config.residual) {
    actor.require_texture("texnet with model.residual");
    base = resized(actor.static_texture, config.texture_size());
  }
  if (config.lit) light = shared_lighting(actor, "texnet");
  return TexNet(config, base, light, generator);
}

Gaussians make_gaussians(TrainedActor& actor, const TextureSpace& space, const GaussiansConfig& config,
                         at::Generator generator) {
  actor.require_texture("gaussians");
  const torch::Tensor vertices = vertex_tensor(actor.character.mesh.vertices).view({-1, 3});
  if (config.shadows)
    actor.body_spheres = std::make_shared<BodySpheres>(vertices.to(torch::kFloat32), main_bones(actor.character.skin));
  return Gaussians(config, gaussian_texels(vertices, space, resized(actor.static_texture, config.size)),
                   config.lit ? shared_lighting(actor, "gaussians") : torch::Tensor(), generator);
}

}  // namespace doppel
