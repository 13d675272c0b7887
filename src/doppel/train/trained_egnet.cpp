#include "doppel/train/trained_egnet.h"

#include "doppel/core/error.h"
#include "doppel/data/capture.h"
#include "doppel/train/checkpoint.h"
#include "doppel/train/run_folder.h"

namespace doppel {

namespace {

void load_evaluation_weights(torch::nn::Module& network, const Checkpoint& checkpoint) {
  const auto pick = [&](const std::string& preferred, const std::string& name) {
    return checkpoint.has_tensor(preferred + name) ? preferred + name : "model." + name;
  };
  for (auto& item : network.named_parameters())
    checkpoint.copy_tensor(pick("optimizer.mean.", item.key()), item.value());
  for (auto& item : network.named_buffers())
    if (item.value().defined()) checkpoint.copy_tensor(pick("evaluation.", item.key()), item.value());
}

}  // namespace

TrainedEgNet TrainedEgNet::load(const std::filesystem::path& run_path,
                                const std::optional<std::filesystem::path>& capture_path) {
  const RunFolder run(run_path);
  if (!std::filesystem::exists(run.config()))
    fail("{} is not a run: it holds no config.yaml; give the --out folder of `doppel train`", run_path.string());
  TrainedEgNet trained;
  trained.config = EgNetRunConfig::read(ConfigDocument::load(run.config()));
  if (capture_path) trained.config.capture = std::filesystem::absolute(*capture_path);
  const auto latest = CheckpointFolder(run.checkpoints()).load_latest();
  if (!latest) fail("{} has no checkpoint yet; train it first", run_path.string());
  const Checkpoint& checkpoint = latest->second;

  const Capture capture = read_capture(trained.config.capture);
  trained.frames_per_second = capture.fps;
  trained.character = load_character(capture.character_path(), trained.config.character);
  const std::string fingerprint = trained.character.fingerprint();
  if (checkpoint.text("identity").find(fingerprint) == std::string::npos)
    fail("{} was trained for another character: {}; {} has fingerprint {}", run_path.string(),
         checkpoint.text("identity"), capture.character_path().string(), fingerprint);
  trained.network = EgNet(trained.character, trained.config.model);
  load_evaluation_weights(*trained.network, checkpoint);
  trained.network->eval();
  trained.surface = CharacterSurface(trained.character);
  trained.step = latest->first;
  return trained;
}

torch::Tensor TrainedEgNet::vertices(const torch::Tensor& dof_window) {
  torch::NoGradGuard no_grad;
  const auto [A, T] = network->forward(dof_window);
  return surface->deformed(dof_window.select(1, -1).contiguous(), A, T);
}

}  // namespace doppel
