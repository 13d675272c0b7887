#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.h"
#include "doppel/export/actor_file.h"
#include "doppel/train/trained_actor.h"

namespace doppel::tools {
namespace {

struct Arguments {
  std::string run, capture, out;
  bool geometry_only = false;
};

ActorDescription describe(const TrainedActor& trained) {
  ActorDescription description;
  description.name = trained.character.name;
  description.window = trained.window() + 1;
  for (const Dof& dof : trained.character.skeleton.dofs) description.dof_names.push_back(dof.name);
  for (const Joint& joint : trained.character.skeleton.joints) description.joint_names.push_back(joint.name);
  description.num_vertices = trained.character.num_vertices();
  description.frames_per_second = trained.frames_per_second;
  description.fingerprint = trained.character.fingerprint();
  if (trained.texnet) description.texture_size = trained.texnet->config().size;
  return description;
}

std::vector<std::pair<std::string, torch::nn::Module*>> modules_of(TrainedActor& trained) {
  std::vector<std::pair<std::string, torch::nn::Module*>> modules = {{"egnet", trained.egnet.get()},
                                                                     {"surface", trained.surface.get()}};
  if (trained.deltanet) modules.emplace_back("deltanet", trained.deltanet.get());
  if (trained.texnet) modules.emplace_back("texnet", trained.texnet.get());
  return modules;
}

int run(const Arguments& arguments, const CommonOptions& common) {
  const auto other =
      arguments.capture.empty() ? std::nullopt : std::make_optional<std::filesystem::path>(arguments.capture);
  TrainedActor trained = TrainedActor::load(arguments.run, other);
  const std::filesystem::path out =
      arguments.out.empty() ? std::filesystem::path(arguments.run) / "actor.pt" : std::filesystem::path(arguments.out);
  if (arguments.geometry_only) trained.texnet = nullptr;
  ActorFunctions functions{[&](const torch::Tensor& window) { return trained.fine(window); }, nullptr};
  if (trained.texnet)
    functions.texture = [&](const torch::Tensor& window, const torch::Tensor& projection) {
      return trained.texture(window, projection);
    };
  write_actor(out, trained.character, describe(trained), functions, modules_of(trained));
  const auto bytes = std::filesystem::file_size(out);
  if (common.json)
    std::cout << nlohmann::ordered_json{{"actor", out.string()}, {"bytes", bytes}, {"steps", trained.steps}} << "\n";
  else
    std::cout << "actor " << out.string() << ": " << trained.character.num_vertices() << " vertices from windows of "
              << trained.window() + 1 << " poses, " << bytes / 1000 << " kB, up to "
              << (trained.texnet ? "texnet" : trained.geometry_name()) << "\n";
  return 0;
}

}  // namespace

Command add_export(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app = program.add_subcommand("export", "Write a trained actor as one TorchScript file");
  app->add_option("--run", arguments->run, "Folder of a run")->required();
  app->add_option("--capture", arguments->capture, "Prepared capture, if it has moved since the training");
  app->add_option("--out", arguments->out, "The file to write (default: RUN/actor.pt)");
  app->add_flag("--geometry-only", arguments->geometry_only, "Leave TexNet out: smaller, vertices only");
  app->footer("Example: doppel export --run runs/anna --out anna.pt");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
