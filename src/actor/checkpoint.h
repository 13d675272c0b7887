#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// Everything a run needs to continue, as named tensors and texts in one file.
///
/// The file is a pickled dictionary in a zip archive (Python: `torch.load(path)`); the archive's comment holds a
/// CRC-32C of all bytes before it, which is checked before anything is parsed.
class Checkpoint {
 public:
  static constexpr const char* kFormat = "doppel checkpoint 1";

  void set_tensor(const std::string& name, const torch::Tensor& tensor) { tensors_[name] = tensor.detach(); }
  void set_text(const std::string& name, const std::string& text) { texts_[name] = text; }

  bool has_tensor(const std::string& name) const { return tensors_.count(name) > 0; }
  bool has_text(const std::string& name) const { return texts_.count(name) > 0; }
  /// @throws Error when there is no entry of this name
  const torch::Tensor& tensor(const std::string& name) const;
  const std::string& text(const std::string& name) const;
  std::int64_t integer(const std::string& name) const;
  double number(const std::string& name) const;
  /// The loss on validation frames. Nothing if none was set, or if the loss is not finite.
  void set_validation_loss(double loss);
  std::optional<double> validation_loss() const;
  const std::map<std::string, torch::Tensor>& tensors() const { return tensors_; }

  /// Copies a stored tensor into `target`. @throws Error for another shape or element type, naming both
  void copy_tensor(const std::string& name, const torch::Tensor& target) const;

  /// Writes the file atomically. Tensors with the same elements are stored once.
  void save(const std::filesystem::path& path) const;
  /// @throws FileError for anything that is not a whole, unchanged checkpoint
  static Checkpoint load(const std::filesystem::path& path);

 private:
  std::string where_ = "checkpoint";
  std::map<std::string, torch::Tensor> tensors_;
  std::map<std::string, std::string> texts_;
};

/// Parameters and buffers of a module under `<prefix><name>`.
void save_module(const torch::nn::Module& module, const std::string& prefix, Checkpoint& checkpoint);
/// Copies stored values into the parameters and buffers of a module.
/// @throws Error naming the first missing tensor, or the first of another shape
void load_module(torch::nn::Module& module, const std::string& prefix, const Checkpoint& checkpoint);

/// The checkpoints of a run: `step-000500.pt`, ..., and `latest`, a text file that names the newest. If the run keeps
/// the best, `best` names the checkpoint with the smallest validation loss.
class CheckpointFolder {
 public:
  /// @param keep_last number of the newest checkpoints to keep
  /// @param keep_every also keep steps divisible by this (0: none)
  /// @param keep_best also keep the step with the smallest validation loss
  explicit CheckpointFolder(std::filesystem::path folder, int keep_last = 2, std::int64_t keep_every = 0,
                            bool keep_best = false);

  std::filesystem::path path(std::int64_t step) const;
  /// Steps on disk, ascending.
  std::vector<std::int64_t> steps() const;
  /// The newest complete checkpoint. A checkpoint that cannot be read is skipped with a warning.
  /// @throws Error when there are checkpoints but none of them can be read
  std::optional<std::pair<std::int64_t, Checkpoint>> load_latest() const;
  /// The checkpoint to use: the one that `best` names, or else the newest. @throws as load_latest
  std::optional<std::pair<std::int64_t, Checkpoint>> load_for_use() const;
  /// Writes a saved checkpoint's name into `latest`, and into `best` if its validation loss is the smallest. Removes
  /// the remains of interrupted writes. Repeated calls change nothing.
  void note(std::int64_t step, const Checkpoint& checkpoint) const;
  /// Saves a checkpoint, updates `latest`, and removes checkpoints that need not be kept.
  void save(std::int64_t step, const Checkpoint& checkpoint);
  /// Removes all checkpoints except that of `step`. @throws Error when there is no checkpoint of this step
  void keep_only(std::int64_t step);
  /// Removes all checkpoints and the remains of interrupted writes.
  void clear();

 private:
  void note_best(std::int64_t step, const Checkpoint& checkpoint) const;
  void name_step(const char* file, std::int64_t step) const;
  std::optional<std::int64_t> best() const;
  void prune() const;
  std::filesystem::path folder_;
  int keep_last_;
  std::int64_t keep_every_;
  bool keep_best_;
};

}  // namespace doppel
