#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.h"
#include "doppel/export/actor_file.h"
#include "doppel/train/trained_egnet.h"

namespace doppel::tools {
namespace {

struct Arguments {
  std::string run, capture, out;
};

ActorDescription describe(const TrainedEgNet& trained) {
  ActorDescription description;
  description.name = trained.character.name;
  description.window = trained.config.model.window + 1;
  for (const Dof& dof : trained.character.skeleton.dofs) description.dof_names.push_back(dof.name);
  for (const Joint& joint : trained.character.skeleton.joints) description.joint_names.push_back(joint.name);
  description.num_vertices = trained.character.num_vertices();
  description.frames_per_second = trained.frames_per_second;
  description.fingerprint = trained.character.fingerprint();
  return description;
}

int run(const Arguments& arguments, const CommonOptions& common) {
  const auto other =
      arguments.capture.empty() ? std::nullopt : std::make_optional<std::filesystem::path>(arguments.capture);
  TrainedEgNet trained = TrainedEgNet::load(arguments.run, other);
  const std::filesystem::path out =
      arguments.out.empty() ? std::filesystem::path(arguments.run) / "actor.pt" : std::filesystem::path(arguments.out);
  write_actor(out, trained.character, describe(trained),
              [&](const torch::Tensor& window) { return trained.vertices(window); },
              {{"egnet", trained.network.get()}, {"surface", trained.surface.get()}});
  const auto bytes = std::filesystem::file_size(out);
  if (common.json)
    std::cout << nlohmann::ordered_json{{"actor", out.string()}, {"bytes", bytes}, {"step", trained.step}} << "\n";
  else
    std::cout << "actor " << out.string() << ": " << trained.character.num_vertices() << " vertices from windows of "
              << trained.config.model.window + 1 << " poses, " << bytes / 1000 << " kB, step " << trained.step << "\n";
  return 0;
}

}  // namespace

Command add_export(CLI::App& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app = program.add_subcommand("export", "Write a trained actor as one TorchScript file");
  app->add_option("--run", arguments->run, "Folder of a run")->required();
  app->add_option("--capture", arguments->capture, "Prepared capture, if it has moved since the training");
  app->add_option("--out", arguments->out, "The file to write (default: RUN/actor.pt)");
  app->footer("Example: doppel export --run runs/anna --out anna.pt");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
