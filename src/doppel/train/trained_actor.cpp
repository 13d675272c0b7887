#include "doppel/train/trained_actor.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/data/capture.h"
#include "doppel/render/projection.h"
#include "doppel/train/delta_net_stage.h"
#include "doppel/train/egnet_config.h"
#include "doppel/train/hybrid_stage.h"
#include "doppel/train/lighting_stage.h"
#include "doppel/train/nerf_stage.h"
#include "doppel/train/run_folder.h"
#include "doppel/train/stored_stage.h"
#include "doppel/train/tex_net_stage.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

void load_egnet(TrainedActor& actor, const StoredStage& stage, const fs::path& run, const fs::path& capture_path) {
  const EgNetRunConfig config = EgNetRunConfig::read(stage.config);
  actor.subject = config.subject;
  actor.subject.capture = fs::absolute(capture_path);
  actor.trained_on_cameras = config.loader.cameras;
  const Capture capture = read_capture(actor.subject.capture);
  actor.frames_per_second = capture.fps;
  actor.character = load_character(capture.character_path(), actor.subject.character);
  check_character(stage, actor.character, run, capture.character_path());
  actor.surface = CharacterSurface(actor.character);
  actor.mesh = std::make_shared<RenderMesh>(actor.character.mesh);
  if (!actor.character.mesh.texture.empty() && actor.mesh->has_uvs())
    actor.static_texture = texture_tensor(actor.character.mesh);
  actor.egnet = EgNet(actor.character, config.model);
  load_evaluation_weights(*actor.egnet, stage.checkpoint);
}

void load_stage(TrainedActor& actor, StageKind kind, const StoredStage& stage) {
  if (kind == StageKind::lighting) {
    actor.lighting = Lighting(stage.checkpoint.tensor("model.trained").size(0), std::vector<int>{});
    load_evaluation_weights(*actor.lighting, stage.checkpoint);
  }
  if (kind == StageKind::deltanet) {
    actor.deltanet = DeltaNet(actor.character, DeltaNetRunConfig::read(stage.config).model);
    load_evaluation_weights(*actor.deltanet, stage.checkpoint);
  }
  if (kind == StageKind::texnet) {
    const TexNetConfig config = TexNetRunConfig::read(stage.config).model;
    actor.texnet = make_tex_net(actor, config, at::detail::createCPUGenerator(0));
    actor.texture_space = std::make_shared<TextureSpace>(*actor.mesh, config.size);
    load_evaluation_weights(*actor.texnet, stage.checkpoint);
  }
  if (kind == StageKind::radiance) {
    const HybridRunConfig config = HybridRunConfig::read(stage.config);
    actor.hybrid = Hybrid(actor.character, actor.deltanet, config.model);
    load_evaluation_weights(*actor.hybrid, stage.checkpoint);
    actor.field_viewer = std::make_shared<FieldViewer>(actor.character);
    actor.field_image.samples = config.samples;
    actor.field_stencil = config.stencil;
  }
  if (kind == StageKind::nerf) {
    const NerfRunConfig config = NerfRunConfig::read(stage.config);
    actor.nerf = PlainField(torch::zeros({1, 3}), config.model);
    load_evaluation_weights(*actor.nerf, stage.checkpoint);
    actor.nerf_frame = nerf_frame(Dataset::open(actor.subject.capture), config);
  }
}

/// A texture at another size. @param texture [1,Th,Tw,3] @return [size,size,3]
torch::Tensor resized(const torch::Tensor& texture, std::int64_t size) {
  const torch::Tensor planes = texture.permute({0, 3, 1, 2});
  const torch::Tensor out = planes.size(2) >= size && planes.size(3) >= size
                                ? torch::adaptive_avg_pool2d(planes, {size, size})
                                : torch::upsample_bilinear2d(planes, {size, size}, false);
  return out[0].permute({1, 2, 0}).contiguous();
}

}  // namespace

TrainedActor TrainedActor::load(const fs::path& run, const std::optional<fs::path>& capture,
                                std::optional<StageKind> before) {
  if (!fs::exists(RunFolder(run).config()))
    fail("{} is not a run: it holds no config.yaml; give the --out folder of `doppel train`", run.string());
  const auto egnet_stage = find_stage(run, StageKind::egnet);
  if (!egnet_stage) fail("{} has no checkpoint of egnet yet; train it first", run.string());
  TrainedActor actor;
  // The run's own, which need not be the one that a borrowed EGNet was trained on.
  const fs::path own = StageChain::read(ConfigDocument::load(RunFolder(run).config())).capture();
  load_egnet(actor, *egnet_stage, run, capture.value_or(own));
  actor.steps["egnet"] = egnet_stage->step;
  const int end = static_cast<int>(before.value_or(StageKind::posenet));  // what follows is of another chain
  for (int i = static_cast<int>(StageKind::lighting); i < end; ++i) {
    const auto kind = static_cast<StageKind>(i);
    const auto stage = find_stage(run, kind);
    if (!stage) continue;
    load_stage(actor, kind, *stage);
    actor.steps[stage_names()[static_cast<std::size_t>(i)]] = stage->step;
  }
  return actor;
}

int TrainedActor::window() const {
  int longest = egnet->config().past_frames();
  if (deltanet) longest = std::max(longest, deltanet->config().window);
  if (texnet) longest = std::max(longest, texnet->config().window);
  if (hybrid) longest = std::max(longest, hybrid->config().motion.window);
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
  const torch::Tensor window = last_rows(dof_window, network->config().window);
  return network->displaced(surface, window, A, T, network->forward(window));
}

torch::Tensor TrainedActor::refined(const torch::Tensor& dof_window) {
  if (!hybrid) return fine(dof_window);
  torch::NoGradGuard no_grad;
  return displaced(hybrid->refined, dof_window);
}

FieldPicture TrainedActor::radiance(const torch::Tensor& dof_window, const torch::Tensor& projection, int64_t height,
                                    int64_t width) {
  torch::NoGradGuard no_grad;
  const FieldSurface around{displaced(hybrid->around, dof_window)[0], hybrid->vertex_values(dof_window)};
  return field_viewer->draw(hybrid->field, around, projection, height, width, field_stencil, field_image);
}

torch::Tensor TrainedActor::texture(const torch::Tensor& dof_window, const torch::Tensor& projection) {
  torch::NoGradGuard no_grad;
  const torch::Tensor vertices = texnet->config().surface_normals ? fine(dof_window) : torch::Tensor();
  return texnet->forward(texture_input(*this, *texture_space, texnet->config(), dof_window, projection, vertices));
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

torch::Tensor texture_input(TrainedActor& actor, const TextureSpace& space, const TexNetConfig& config,
                            const torch::Tensor& dof_window, const torch::Tensor& projection,
                            const torch::Tensor& surface) {
  const torch::Tensor window = last_rows(dof_window, config.window);
  const auto frames = window.size(1);
  // Normals do not know where the root stands, so the window's translation need not be taken out.
  torch::Tensor posed =
      actor.surface->skinned(window.flatten(0, 1)).view({-1, frames, actor.character.num_vertices(), 3});
  if (config.surface_normals) posed = at::cat({posed.narrow(1, 0, frames - 1), surface.unsqueeze(1)}, 1);
  const torch::Tensor normals = space.normals(posed.flatten(0, 1)).view({-1, 3 * frames, space.size(), space.size()});
  const CameraPlacement camera = camera_placement(projection);
  const torch::Tensor centre = texnet_camera_centre(config, MotionWindow(actor.character.skeleton), camera.centre,
                                                    window.select(1, -1).contiguous());
  return texnet_input(normals, centre, camera.forward);
}

TexNet make_tex_net(const TrainedActor& actor, const TexNetConfig& config, at::Generator generator) {
  if (!actor.mesh->has_uvs()) actor.require_texture("texnet");
  torch::Tensor base, light;
  if (config.residual) {
    actor.require_texture("texnet with model.residual");
    base = resized(actor.static_texture, config.size);
  }
  if (config.lit) {
    if (!actor.lighting)
      fail<UsageError>(
          "texnet: model.lit is true and the stage `lighting` has not been trained; train it first, or set "
          "model.lit to false");
    light = actor.lighting->mean().squeeze(0);
  }
  return TexNet(config, base, light, generator);
}

}  // namespace doppel
