// A playing character: motion window -> EGNet -> DeltaNet -> posed vertices at batch 1, by the library and by the
// exported file, part by part, against 25 frames a second.
//
//   actor_bench [threads=2] [file.character|-] [inertia=0]        without a file, or -: a tube of 5,514 vertices and
//                                                                852 nodes
//
// Weights are random: what a frame costs does not depend on them.

#include <ATen/Parallel.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "doppel/actor/export/actor_file.h"
#include "doppel/actor/export/script_file.h"
#include "doppel/core/as_size.h"
#include "doppel/core/process.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/delta_net.h"
#include "doppel/nets/egnet.h"
#include "support/ratio.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace {

using torch::Tensor;

constexpr double kWantedFrames = 25.0;

doppel::EgNetConfig egnet_config(int inertia) {
  doppel::EgNetConfig config = doppel::EgNetConfig::preset("paper");
  config.inertia = inertia;
  return config;
}

/// The networks of the paper preset on a character; inertia: how many past frames EGNet's nodes may trail behind.
struct Actor {
  doppel::Character character;
  doppel::EgNet egnet;
  doppel::DeltaNet deltanet;
  doppel::CharacterSurface surface;
  doppel::ActorDescription description;

  Actor(doppel::Character given, int inertia)
      : character(std::move(given)),
        egnet(character, egnet_config(inertia)),
        deltanet(character, doppel::DeltaNetConfig()),
        surface(character) {
    egnet->eval();
    deltanet->eval();
    doppel::freeze_graph_networks(*egnet, doppel::inference_weights());
    doppel::freeze_graph_networks(*deltanet, doppel::inference_weights());
    description.name = character.name;
    description.past_frames = std::max(egnet->config().history(), deltanet->config().past_frames);
    for (const doppel::Dof& dof : character.skeleton.dofs) description.dof_names.push_back(dof.name);
    for (const doppel::Joint& joint : character.skeleton.joints) description.joint_names.push_back(joint.name);
    description.num_vertices = character.num_vertices();
  }

  /// What DeltaNet takes of a window.
  Tensor fine_window(const Tensor& window) { return doppel::last_rows(window, deltanet->config().past_frames); }

  Tensor frame(const Tensor& window) {
    const auto [A, T] = egnet->forward(window);
    const Tensor last = fine_window(window);
    return deltanet->displaced(surface, last, A, T, deltanet->forward(last));
  }
};

/// One part of a frame, from the window to what it makes.
struct Part {
  const char* name;
  doppel::ActorFunction function;
};

/// Each network with and without what it is fed with, then the frame. What is left of the frame when the networks are
/// taken away is deformation and skinning.
std::vector<Part> parts_of(Actor& actor) {
  return {{"motion window, node features",
           [&](const Tensor& window) {
             return actor.egnet->network_input(doppel::last_rows(window, actor.egnet->config().past_frames));
           }},
          {"  + EGNet",
           [&](const Tensor& window) {
             const auto [A, T] = actor.egnet->forward(window);
             return at::cat({A, T}, -1);
           }},
          {"motion window, posed template",
           [&](const Tensor& window) { return actor.deltanet->network_input(actor.fine_window(window)); }},
          {"  + DeltaNet", [&](const Tensor& window) { return actor.deltanet->forward(actor.fine_window(window)); }},
          {"frame", [&](const Tensor& window) { return actor.frame(window); }}};
}

void print_shares(const std::vector<doppel::bench::Timing>& times) {
  const auto ms = [&](int i) { return times[doppel::as_size(i)].median_ms; };
  std::printf("  EGNet %.2f, DeltaNet %.2f, deformation and skinning %.2f ms\n", ms(1) - ms(0), ms(3) - ms(2),
              ms(4) - ms(3) - ms(1));
  std::printf("  %.0f frames/s, %.1f x %.0f frames/s\n\n", 1000.0 / ms(4), 1000.0 / ms(4) / kWantedFrames,
              kWantedFrames);
}

double largest_difference(const Tensor& a, const Tensor& b) { return (a - b).abs().max().item<double>(); }

void run(Actor& actor) {
  const torch::NoGradGuard no_grad;
  const Tensor rest = torch::tensor(at::ArrayRef<double>(actor.character.rest_dofs), torch::kFloat32);
  const Tensor window = rest + 0.1 * torch::randn({1, actor.description.past_frames + 1, actor.character.num_dofs()},
                                                  at::detail::createCPUGenerator(1));
  const doppel::support::TemporaryFolder folder;
  std::vector<doppel::bench::Candidate> ours, exported;
  for (const Part& part : parts_of(actor)) {
    const auto path = folder / "part.pt";
    doppel::write_actor(path, actor.character, actor.description, {part.function, nullptr},
                        {{"egnet", actor.egnet.get()}, {"deltanet", actor.deltanet.get()}});
    // Not an ActorFile, which takes vertices only: most parts return something else.
    const auto file = std::make_shared<doppel::ScriptFile>(doppel::load_script_file(path, doppel::ScriptKind::actor));
    const auto forward = [=] { return file->fastest().forward({window}).toTensor(); };
    std::printf("%-32s the file differs by at most %.1e\n", part.name,
                largest_difference(forward(), part.function(window)));
    ours.push_back({part.name, [=] { part.function(window); }});
    exported.push_back({part.name, [=] { forward(); }});
  }
  const std::string size = std::to_string(at::get_num_threads()) + " threads";
  print_shares(doppel::bench::compare("the library, " + size, ours));
  print_shares(doppel::bench::compare("the exported file, " + size, exported));
  doppel::bench::compare("a frame", {{"exported file", exported.back().run}, {"library", ours.back().run}});
}

}  // namespace

int main(int argc, char** argv) {
  doppel::setup_process();
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const std::string file = argc > 2 ? argv[2] : "-";
  const int inertia = argc > 3 ? std::atoi(argv[3]) : 0;
  doppel::Character character = file != "-" ? doppel::load_character(file) : doppel::make_test_character(20, 53, 104);
  if (file == "-") {
    character.graph = doppel::build_graph(character.mesh, 852, character.options.graph);
    doppel::complete_character(character);
  }
  Actor actor(std::move(character), inertia);
  std::printf("%d vertices, %d nodes, %d DoFs, window of %d\n", actor.character.num_vertices(),
              actor.character.num_nodes(), actor.character.num_dofs(), actor.description.past_frames + 1);
  run(actor);
  return 0;
}
