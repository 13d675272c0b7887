#pragma once

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/trained_actor.h"
#include "support/test_character.h"

namespace doppel::support {

/// An actor with EGNet, DeltaNet, TexNet and Gaussians, untrained, as small as they can be, under light and with
/// details.
inline TrainedActor dressed_actor() {
  TrainedActor actor;
  actor.character = make_test_character();
  actor.surface = CharacterSurface(actor.character);
  actor.mesh = std::make_shared<RenderMesh>(actor.character.mesh);
  actor.egnet = EgNet(actor.character, EgNetConfig::preset("paper"));
  actor.deltanet = DeltaNet(actor.character, DeltaNetConfig());
  TexNetConfig config;
  config.size = 256;
  config.levels = 4;
  config.unet.width = 0.1;
  config.residual = config.lit = config.surface_normals = true;
  config.detail = 2;
  actor.static_texture = torch::full({1, 512, 512, 3}, 0.5);
  actor.lighting = Lighting(1, std::vector<int>{0});
  actor.texnet = make_tex_net(actor, config, at::detail::createCPUGenerator(3));
  actor.texture_space = std::make_shared<TextureSpace>(*actor.mesh, config.size);
  GaussiansConfig gaussians;
  gaussians.size = 64;
  gaussians.lit = gaussians.shadows = gaussians.cull = true;
  gaussians.unet.width = 0.1;
  actor.splat_space = std::make_shared<TextureSpace>(*actor.mesh, gaussians.size);
  actor.gaussians = make_gaussians(actor, *actor.splat_space, gaussians, at::detail::createCPUGenerator(6));
  torch::NoGradGuard no_grad;
  auto generator = at::detail::createCPUGenerator(7);
  for (torch::nn::Module* module : std::initializer_list<torch::nn::Module*>{actor.egnet.get(), actor.deltanet.get()}) {
    for (torch::Tensor& p : module->parameters()) p.copy_(0.1 * torch::randn(p.sizes(), generator));
    module->eval();
  }
  actor.texnet->eval();
  // Not the UNet: with weights of this size, Gaussians would be as large as the room.
  for (torch::Tensor& p : actor.gaussians->parameters(/*recurse=*/false))
    p.copy_(0.03 * torch::randn(p.sizes(), generator));
  actor.gaussians->eval();
  return actor;
}

inline ActorDescription description_of(const TrainedActor& actor) {
  ActorDescription description;
  description.name = "dressed";
  description.past_frames = actor.past_frames();
  for (const Dof& dof : actor.character.skeleton.dofs) description.dof_names.push_back(dof.name);
  description.num_vertices = actor.character.num_vertices();
  description.texture_size = static_cast<int>(actor.texnet->config().texture_size());
  description.num_gaussians = actor.gaussians->count();
  return description;
}

}  // namespace doppel::support
