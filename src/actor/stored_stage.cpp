#include "doppel/actor/stored_stage.h"

#include "doppel/actor/run_folder.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"

namespace doppel {

namespace fs = std::filesystem;

std::optional<StoredStage> find_stage(const fs::path& run_path, const std::string& stage) {
  const RunFolder run(stage_folder(run_path, stage));
  if (!fs::exists(run.config())) return std::nullopt;
  auto latest = CheckpointFolder(run.checkpoints()).load_for_use();
  if (!latest) return std::nullopt;
  return StoredStage{ConfigDocument::load(run.config()), latest->first, std::move(latest->second)};
}

void check_character(const StoredStage& stage, const Character& character, const fs::path& run,
                     const fs::path& character_path) {
  const std::string fingerprint = character.fingerprint(), identity = stage.checkpoint.text("identity");
  if (identity.find(fingerprint) == std::string::npos)
    fail("{} was trained for another character: {}; {} has fingerprint {}", run.string(), identity,
         character_path.string(), fingerprint);
}

void load_evaluation_weights(torch::nn::Module& network, const Checkpoint& checkpoint) {
  const auto pick = [&](const std::string& preferred, const std::string& name) {
    return checkpoint.has_tensor(preferred + name) ? preferred + name : "model." + name;
  };
  for (auto& item : network.named_parameters()) {
    checkpoint.copy_tensor(pick("optimizer.mean.", item.key()), item.value());
    item.value().requires_grad_(false);
  }
  for (auto& item : network.named_buffers())
    if (item.value().defined()) checkpoint.copy_tensor(pick("evaluation.", item.key()), item.value());
  network.eval();
}

std::uint32_t weights_checksum(const torch::nn::Module& module) {
  std::uint32_t sum = 0;
  const auto add = [&](const torch::Tensor& tensor) {
    const torch::Tensor bytes = tensor.contiguous();
    sum = crc32c(bytes.data_ptr(), bytes.nbytes(), sum);
  };
  for (const auto& item : module.named_parameters()) add(item.value());
  for (const auto& item : module.named_buffers())
    if (item.value().defined()) add(item.value());
  return sum;
}

}  // namespace doppel
