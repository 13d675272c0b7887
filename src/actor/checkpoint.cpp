#include "doppel/actor/checkpoint.h"

#include <torch/serialize.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <regex>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/log.h"
#include "doppel/core/temporary_name.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/text_reader.h"
#include "doppel/nets/weights/torch_archive.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

using TensorDict = c10::Dict<std::string, torch::Tensor>;
using TextDict = c10::Dict<std::string, std::string>;

/// The zip archive's comment: a checksum of all bytes before it.
constexpr const char* kSeal = "doppel crc32c ";
constexpr std::size_t kSealSize = 14 + 8;

std::string seal(const char* data, std::size_t size) { return fmt::format("{}{:08x}", kSeal, crc32c(data, size)); }

void append_seal(std::vector<char>& archive) {
  // A zip file ends in the length of its comment, which was 0.
  archive[archive.size() - 2] = static_cast<char>(kSealSize);
  const std::string comment = seal(archive.data(), archive.size());
  archive.insert(archive.end(), comment.begin(), comment.end());
}

/// The system cannot read a checkpoint. It may be whole, so an older one must not stand in for it.
struct UnreadableCheckpoint : FileError {
  explicit UnreadableCheckpoint(const FileError& reason) : FileError(reason) {}
};

std::string read_bytes(const fs::path& path) {
  try {
    return read_file(path);
  } catch (const FileError& e) {
    throw UnreadableCheckpoint(e);
  }
}

TorchArchive open_archive(const fs::path& path) {
  std::string bytes = read_bytes(path);
  const FileLocation where{path.string(), 0};
  const std::size_t size = bytes.size() < kSealSize ? 0 : bytes.size() - kSealSize;
  if (size == 0 || bytes.compare(0, 2, "PK") != 0)
    fail_at(where, "not a checkpoint: it holds {} bytes and is not a zip archive", bytes.size());
  if (bytes.compare(size, std::string::npos, seal(bytes.data(), size)) != 0)
    fail_at(where,
            "the checkpoint is damaged or not one of Doppel's: its checksum does not match. Remove it; training "
            "resumes from an older one");
  return TorchArchive(path, std::move(bytes));
}

/// The tensors as they are stored: each alone and contiguous, because a view would save its whole storage. Tensors of
/// the same bits share a storage, which the file holds once.
class StoredTensors {
 public:
  torch::Tensor add(const torch::Tensor& tensor) {
    const bool whole = tensor.is_contiguous() && tensor.storage().nbytes() == tensor.nbytes();
    const torch::Tensor alone = whole ? tensor : tensor.clone(torch::MemoryFormat::Contiguous);
    if (alone.numel() == 0) return alone;
    std::vector<torch::Tensor>& alike = kinds_[{tensor.scalar_type(), tensor.numel()}];
    for (const torch::Tensor& stored : alike)
      if (std::memcmp(stored.data_ptr(), alone.data_ptr(), alone.nbytes()) == 0) return stored.view(alone.sizes());
    alike.push_back(alone);
    return alone;
  }

 private:
  std::map<std::pair<torch::ScalarType, std::int64_t>, std::vector<torch::Tensor>> kinds_;
};

}  // namespace

const torch::Tensor& Checkpoint::tensor(const std::string& name) const {
  const auto found = tensors_.find(name);
  if (found == tensors_.end()) fail("{}: no tensor `{}`; the checkpoint belongs to another model", where_, name);
  return found->second;
}

const std::string& Checkpoint::text(const std::string& name) const {
  const auto found = texts_.find(name);
  if (found == texts_.end()) fail("{}: no entry `{}`; the checkpoint belongs to another version", where_, name);
  return found->second;
}

double Checkpoint::number(const std::string& name) const {
  const auto value = parse_number(text(name));
  if (!value) fail("{}: entry `{}` should be a number, found `{}`", where_, name, text(name));
  return *value;
}

std::int64_t Checkpoint::integer(const std::string& name) const {
  const double value = number(name);
  if (!(value >= 0.0 && value < 9e15 && value == std::floor(value)))
    fail("{}: entry `{}` should be a count, found `{}`", where_, name, text(name));
  return static_cast<std::int64_t>(value);
}

void Checkpoint::copy_tensor(const std::string& name, const torch::Tensor& target) const {
  const torch::Tensor& source = tensor(name);
  if (source.sizes() != target.sizes() || source.scalar_type() != target.scalar_type())
    fail("{}: `{}` is {}, the model needs {}; the checkpoint belongs to another character or configuration", where_,
         name, describe(source), describe(target));
  torch::NoGradGuard no_grad;
  target.copy_(source);
}

void Checkpoint::save(const fs::path& path) const {
  TensorDict tensors;
  StoredTensors stored;
  for (const auto& [name, tensor] : tensors_) tensors.insert(name, stored.add(tensor));
  TextDict texts;
  for (const auto& [name, text] : texts_) texts.insert(name, text);
  c10::impl::GenericDict root(c10::StringType::get(), c10::AnyType::get());
  root.insert("format", std::string(kFormat));
  root.insert("texts", texts);
  root.insert("tensors", tensors);
  std::vector<char> bytes = torch::pickle_save(root);
  append_seal(bytes);
  write_atomically(path, [&bytes](const fs::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) fail("cannot write {}: is the disk full?", temporary.string());
  });
}

Checkpoint Checkpoint::load(const fs::path& path) {
  TorchArchive archive = open_archive(path);
  const FileLocation where{path.string(), 0};
  PickledDictionary root = archive.dictionary();
  const auto format = root.texts.find("format");
  if (format == root.texts.end()) fail_at(where, "not a checkpoint of Doppel: it names no format");
  if (format->second != kFormat)
    fail_at(where, "the format is `{}`; this program reads `{}`", excerpt(format->second), kFormat);
  Checkpoint checkpoint;
  checkpoint.where_ = path.string();
  checkpoint.texts_ = std::move(root.dictionaries["texts"].texts);
  for (const PickledTensor& tensor : root.dictionaries["tensors"].tensors)
    checkpoint.tensors_[tensor.name] = archive.tensor(tensor);
  return checkpoint;
}

void save_module(const torch::nn::Module& module, const std::string& prefix, Checkpoint& checkpoint) {
  for (const auto& item : module.named_parameters()) checkpoint.set_tensor(prefix + item.key(), item.value());
  for (const auto& item : module.named_buffers())
    if (item.value().defined()) checkpoint.set_tensor(prefix + item.key(), item.value());
}

void load_module(torch::nn::Module& module, const std::string& prefix, const Checkpoint& checkpoint) {
  for (auto& item : module.named_parameters()) checkpoint.copy_tensor(prefix + item.key(), item.value());
  for (auto& item : module.named_buffers())
    if (item.value().defined()) checkpoint.copy_tensor(prefix + item.key(), item.value());
}

void Checkpoint::set_validation_loss(double loss) { set_text("validation_loss", fmt::format("{:.17g}", loss)); }

std::optional<double> Checkpoint::validation_loss() const {
  if (!has_text("validation_loss")) return std::nullopt;
  const double loss = number("validation_loss");
  return std::isfinite(loss) ? std::optional<double>(loss) : std::nullopt;
}

CheckpointFolder::CheckpointFolder(fs::path folder, int keep_last, std::int64_t keep_every, bool keep_best)
    : folder_(std::move(folder)), keep_last_(std::max(1, keep_last)), keep_every_(keep_every), keep_best_(keep_best) {}

fs::path CheckpointFolder::path(std::int64_t step) const { return folder_ / fmt::format("step-{:06}.pt", step); }

std::vector<std::int64_t> CheckpointFolder::steps() const {
  static const std::regex pattern("step-([0-9]{6,12})\\.pt");
  std::vector<std::int64_t> steps;
  if (!fs::is_directory(folder_)) return steps;
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename().string();
    std::smatch match;
    if (std::regex_match(name, match, pattern)) steps.push_back(std::stoll(match[1]));
  }
  std::sort(steps.begin(), steps.end());
  return steps;
}

std::optional<std::pair<std::int64_t, Checkpoint>> CheckpointFolder::load_latest() const {
  std::vector<std::int64_t> candidates = steps();
  if (candidates.empty()) return std::nullopt;
  // A checkpoint newer than `latest` is complete too (it was renamed after writing), so the newest readable checkpoint
  // is used.
  std::string first_error;
  for (auto step = candidates.rbegin(); step != candidates.rend(); ++step) {
    try {
      return std::make_pair(*step, Checkpoint::load(path(*step)));
    } catch (const UnreadableCheckpoint&) {
      throw;
    } catch (const Error& e) {
      log::warn("{}", e.what());
      if (first_error.empty()) first_error = e.what();
    }
  }
  fail("no checkpoint in {} can be read; use --overwrite to start again. {}", folder_.string(), first_error);
}

/// Writes the name of a step's checkpoint into the file `latest` or `best`.
void CheckpointFolder::name_step(const char* file, std::int64_t step) const {
  write_atomically(folder_ / file, path(step).filename().string() + "\n");
}

std::optional<std::int64_t> CheckpointFolder::best() const {
  const fs::path file = folder_ / "best";
  if (!fs::exists(file)) return std::nullopt;
  const std::string name = read_file(file);
  for (const std::int64_t step : steps())
    if (path(step).filename().string() + "\n" == name) return step;
  return std::nullopt;
}

std::optional<std::pair<std::int64_t, Checkpoint>> CheckpointFolder::load_for_use() const {
  if (const auto step = best()) {
    try {
      return std::make_pair(*step, Checkpoint::load(path(*step)));
    } catch (const UnreadableCheckpoint&) {
      throw;
    } catch (const Error& e) {
      log::warn("{}; the newest checkpoint is used instead", e.what());
    }
  }
  return load_latest();
}

void CheckpointFolder::note(std::int64_t step, const Checkpoint& checkpoint) const {
  const fs::path latest = folder_ / "latest";
  if (!fs::exists(latest) || read_file(latest) != path(step).filename().string() + "\n") name_step("latest", step);
  note_best(step, checkpoint);
  remove_temporaries(folder_);
}

/// Among equal losses, the earlier step stays the best.
void CheckpointFolder::note_best(std::int64_t step, const Checkpoint& checkpoint) const {
  const auto loss = checkpoint.validation_loss();
  if (!keep_best_ || !loss) return;
  const auto so_far = best();
  if (so_far && *so_far < step) {
    try {
      const auto least = Checkpoint::load(path(*so_far)).validation_loss();
      if (least && *least <= *loss) return;
    } catch (const UnreadableCheckpoint&) {
      throw;
    } catch (const Error& e) {
      log::warn("{}; step {} takes its place as the best", e.what(), step);
    }
  }
  name_step("best", step);
}

void CheckpointFolder::save(std::int64_t step, const Checkpoint& checkpoint) {
  fs::create_directories(folder_);
  checkpoint.save(path(step));
  note(step, checkpoint);
  prune();
}

void CheckpointFolder::prune() const {
  std::vector<std::int64_t> all = steps();
  const auto chosen = best();
  const std::size_t kept = std::min(all.size(), as_size(keep_last_));
  for (std::size_t i = 0; i + kept < all.size(); ++i) {
    const bool milestone = keep_every_ > 0 && all[i] % keep_every_ == 0;
    std::error_code ignored;
    if (!milestone && all[i] != chosen) fs::remove(path(all[i]), ignored);
  }
}

void CheckpointFolder::keep_only(std::int64_t step) {
  if (!fs::exists(path(step))) fail("{}: there is no checkpoint of step {}", folder_.string(), step);
  name_step("latest", step);
  std::error_code ignored;
  fs::remove(folder_ / "best", ignored);
  for (const std::int64_t other : steps()) {
    if (other != step) fs::remove(path(other), ignored);
  }
}

void CheckpointFolder::clear() {
  std::error_code ignored;
  if (!fs::is_directory(folder_)) return;
  remove_temporaries(folder_);
  for (std::int64_t step : steps()) fs::remove(path(step), ignored);
  for (const char* name : {"latest", "best"}) fs::remove(folder_ / name, ignored);
}

}  // namespace doppel
