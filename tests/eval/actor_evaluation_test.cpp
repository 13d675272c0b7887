#include "doppel/eval/actor_evaluation.h"

#include <gtest/gtest.h>
#include <torch/types.h>

#include <memory>

#include "doppel/render/mesh/render_mesh.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::actor_evaluation_test {
namespace {

using support::TemporaryFolder;

/// The actor that the images of a textured small capture without thickness show: an EGNet that deforms nothing, the
/// template's texture, and the true light.
TrainedActor true_actor(const Dataset& dataset) {
  TrainedActor actor;
  actor.character = load_character(dataset.character_path());
  actor.surface = CharacterSurface(actor.character);
  actor.mesh = std::make_shared<RenderMesh>(actor.character.mesh);
  actor.static_texture = texture_tensor(actor.character.mesh);
  actor.egnet = EgNet(actor.character, EgNetConfig::preset("paper"));
  actor.lighting = Lighting(3, std::vector<int>{0, 1, 2});
  torch::NoGradGuard no_grad;
  for (torch::Tensor& p : actor.egnet->parameters()) p.zero_();
  actor.egnet->eval();
  actor.lighting->coefficients.copy_(small_capture::true_light());
  return actor;
}

TEST(ActorEvaluationReference, TheTrueActorMatchesTheWholeImages) {
  const TemporaryFolder folder;
  SmallCaptureOptions capture;
  capture.textured = true;
  capture.thickness = 0.0;
  capture.mask_size = 64;
  capture.train_frames = 1;
  capture.test_frames = 3;
  const Dataset dataset = Dataset::open(make_small_capture(folder.path(), capture));
  TrainedActor actor = true_actor(dataset);
  const torch::Tensor window = dataset.dof_windows(dataset.samples(Split::test), actor.past_frames());
  const torch::Tensor skinned = actor.surface->skinned_by_nodes(window.select(1, -1).contiguous());
  ASSERT_LT((actor.fine(window) - skinned).abs().max().item<float>(), 1e-5f);
  EvaluationOptions options;
  options.whole_frames = true;
  const ActorEvaluation evaluation{dataset, actor, Split::test, options};
  // The images show the template skinned by vertices, the actor is skinned by nodes: outlines differ by some pixels.
  const auto lit = evaluate_actor_drawing(evaluation, "lit", Drawing::lit);
  EXPECT_LT(lit.at("whole_MSE").get<double>(), 8.0);
  EXPECT_GT(lit.at("whole_SSIM").get<double>(), 0.995);
  const auto unlit = evaluate_actor_drawing(evaluation, "static", Drawing::static_texture);
  EXPECT_GT(unlit.at("whole_MSE").get<double>(), 2.0 * lit.at("whole_MSE").get<double>());
  EXPECT_FALSE(unlit.contains("whole_full_MSE"));
}

}  // namespace
}  // namespace doppel::actor_evaluation_test
