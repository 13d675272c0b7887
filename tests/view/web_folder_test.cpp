#include "doppel/view/web_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <thread>

#include "actor/export/dressed_actor.h"
#include "doppel/render/splats/splat_rows.h"
#include "doppel/view/view_server.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::web_folder_test {
namespace {

using support::TemporaryFolder;
using ::testing::HasSubstr;

/// All stages of an untrained actor, with a motion of six frames.
ViewSubject dressed_subject(
    const std::shared_ptr<TrainedActor>& actor = std::make_shared<TrainedActor>(support::dressed_actor())) {
  for (torch::nn::Module* network : std::initializer_list<torch::nn::Module*>{
           actor->egnet.get(), actor->deltanet.get(), actor->texnet.get(), actor->gaussians.get()})
    for (torch::Tensor& weight : network->parameters()) weight.requires_grad_(false);
  ViewSubject subject;
  subject.character = actor->character;
  for (int frame = 0; frame < 6; ++frame) {
    std::vector<double> dofs = actor->character.rest_dofs;
    for (double& dof : dofs) dof += 0.05 * frame;
    subject.motion.frames.push_back(dofs);
    subject.motion.ids.push_back(frame);
  }
  const auto skin = [actor](const torch::Tensor& w) { return actor->surface->skinned(w.select(1, w.size(1) - 1)); };
  const auto coarse = [actor](const torch::Tensor& w) { return actor->coarse(w); };
  const auto fine = [actor](const torch::Tensor& w) { return actor->fine(w); };
  const int past = actor->past_frames();
  subject.stages = {{"skinning", 0, skin}, {"egnet", past, coarse}, {"deltanet", past, fine}};
  const auto texture = [actor](const auto& w, const auto& camera, const auto& vertices) {
    return actor->texture(w, camera, vertices);
  };
  subject.stages.push_back(
      {"textured", past, fine, texture, static_cast<int>(actor->texnet->config().texture_size()), {}, 0, "deltanet"});
  const auto gaussians = [actor](const auto& w, const auto& camera, const auto& vertices) {
    return splat_rows(actor->splats(w, camera, vertices), camera);
  };
  const int count = static_cast<int>(actor->gaussians->points().texel.size(0));
  subject.stages.push_back({"gaussians", past, fine, {}, 0, gaussians, count, "deltanet"});
  return subject;
}

// The browser runs the networks of the folder by ONNX Runtime; the server runs ours.
TEST(WebFolderAgrees, WithTheServerInABrowser) {
  if (std::system("command -v chromium >/dev/null") != 0) GTEST_SKIP() << "chromium is not installed";
  if (std::system(WEB_TESTS "/modules.sh") != 0) GTEST_SKIP() << "node or its packages are missing";
  const TemporaryFolder folder;
  const auto actor = std::make_shared<TrainedActor>(support::dressed_actor());
  const ViewSubject subject = dressed_subject(actor);
  // Half of the models with quantized weights. The server gets the weights of the files.
  const QuantizedWeights quantized({{"egnet", actor->egnet.get()}, {"texnet", actor->texnet.get()}}, 16);
  write_web_folder(folder / "page", subject, quantized);
  {
    const torch::NoGradGuard no_grad;
    for (const StoredWeight& weight : quantized.stored(read_web_constants(folder / "page", subject)))
      weight.parameter.copy_(weight.weight);
  }
  ViewServer server(subject, 0);
  std::thread serving([&] { server.serve(); });
  const int code = std::system(
      ("node " WEB_TESTS "/check_page.mjs '" + (folder / "page").string() + "' '" + server.url() + "'").c_str());
  server.stop();
  serving.join();
  EXPECT_EQ(WEXITSTATUS(code), 0);
}

// The networks of the page are traced without modules: their weights are constants of the traces.
TEST(WebFolderBehaves, AllWeightsOfTheNetworksAreQuantized) {
  const torch::NoGradGuard no_grad;
  const auto actor = std::make_shared<TrainedActor>(support::dressed_actor());
  ViewSubject subject = dressed_subject(actor);
  const QuantizedWeights quantized({{"egnet", actor->egnet.get()},
                                    {"deltanet", actor->deltanet.get()},
                                    {"texnet", actor->texnet.get()},
                                    {"surface_gaussians", actor->gaussians.get()}},
                                   8);
  const TemporaryFolder folder;
  write_web_folder(folder / "page", subject, quantized);
  EXPECT_EQ(quantized.stored(read_web_constants(folder / "page", subject)).size(), quantized.all().size());
}

TEST(WebFolderErrors, KeepsWhatIsThere) {
  const TemporaryFolder folder;
  std::ofstream(folder / "letter.txt") << "dear";
  const std::string message = support::message_of([&] { write_web_folder(folder.path(), dressed_subject()); });
  EXPECT_THAT(message, HasSubstr("holds other files"));
  EXPECT_TRUE(std::filesystem::exists(folder / "letter.txt"));
  // A page beside which somebody put a file of their own.
  std::filesystem::create_directories(folder / "double");
  std::ofstream(folder / "double/description.json") << "{}";
  EXPECT_THAT(support::message_of([&] { write_web_folder(folder.path(), dressed_subject()); }),
              HasSubstr("holds other files"));
  EXPECT_TRUE(std::filesystem::exists(folder / "letter.txt"));
}

}  // namespace
}  // namespace doppel::web_folder_test
