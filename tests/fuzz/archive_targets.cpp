// Archives that hold tensors or programs. The readers of `.pth` files and checkpoints get a pickle and one storage as
// an input, which are packed into a sound archive: behind a checksum, damage of a packed archive would not be seen.

#include <torch/types.h>

#include <cstdio>
#include <cstring>
#include <map>

#include "doppel/actor/checkpoint.h"
#include "doppel/actor/export/script_check.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/crc32c.h"
#include "doppel/nets/weights/weights_file.h"
#include "fuzz/fuzz_target.h"
#include "nets/weights_fixture.h"

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;

constexpr std::size_t kMaxUnpackedBytes = std::size_t{256} << 20;

/// Type, sizes and numbers of a tensor as text.
std::string content_of(const torch::Tensor& tensor) {
  promise(tensor.defined() && tensor.device().is_cpu() && !tensor.requires_grad(), "tensors are plain");
  const torch::Tensor dense = tensor.contiguous();
  std::string text = c10::toString(dense.scalar_type());
  for (const std::int64_t size : dense.sizes()) text += "," + std::to_string(size);
  return text + ":" + std::string(static_cast<const char*>(dense.data_ptr()), dense.nbytes());
}

std::map<std::string, std::string> content_of(const NamedWeights& weights) {
  std::map<std::string, std::string> content;
  for (const auto& [name, tensor] : weights)
    promise(content.emplace(name, content_of(tensor)).second, "names of tensors differ");
  return content;
}

/// Weights survive writing and reading.
void check_weights(const NamedWeights& weights, const Path& folder) {
  const auto content = content_of(weights);
  write_safetensors(folder / "again.safetensors", weights);
  promise(content_of(read_weights(folder / "again.safetensors")) == content, "weights survive");
}

void read_safetensors_bytes(std::string_view bytes, const Path& folder) {
  check_weights(read_safetensors(written(bytes, folder, "a.safetensors")), folder);
}

void read_archive_bytes(std::string_view bytes, const Path& folder) {
  const NamedWeights weights = read_torch_weights(written(bytes, folder, "a.pth"));
  for (const auto& [name, tensor] : weights)
    promise(static_cast<std::size_t>(tensor.numel()) <= bytes.size(), "tensors are no larger than the file");
  check_weights(weights, folder);
}

/// The archive of an input: a pickle and the numbers of its storage "0".
Path packed(std::string_view bytes, const Path& folder, const char* name) {
  const std::vector<std::string_view> files = files_of(bytes, 2);
  const torch::Tensor storage = torch::empty({static_cast<std::int64_t>(files[1].size())}, torch::kUInt8);
  if (!files[1].empty()) std::memcpy(storage.data_ptr(), files[1].data(), files[1].size());
  test::write_archive(folder / name, std::string(files[0]), {storage});
  return folder / name;
}

void read_weights_bytes(std::string_view bytes, const Path& folder) {
  check_weights(read_weights(packed(bytes, folder, "a.pth")), folder);
}

/// The archive with the comment that seals a checkpoint.
void read_checkpoint_bytes(std::string_view bytes, const Path& folder) {
  std::string archive = read_file(packed(bytes, folder, "a.pt"));
  constexpr std::size_t kDigits = 8;
  const std::string seal = "doppel crc32c ";
  archive[archive.size() - 2] = static_cast<char>(seal.size() + kDigits);
  char digits[kDigits + 1];
  std::snprintf(digits, sizeof digits, "%08x", crc32c(archive.data(), archive.size()));
  const Checkpoint checkpoint = Checkpoint::load(written(archive + seal + digits, folder, "a.pt"));
  checkpoint.save(folder / "again.pt");
  const Checkpoint again = Checkpoint::load(folder / "again.pt");
  promise(again.tensors().size() == checkpoint.tensors().size(), "tensors survive");
  for (const auto& [name, tensor] : checkpoint.tensors())
    promise(again.has_tensor(name) && content_of(again.tensor(name)) == content_of(tensor), "tensors survive");
}

/// @return nothing for a part that LibTorch lists and then refuses, by torch::jit::load as well
std::string unpacked_part(caffe2::serialize::PyTorchStreamReader& reader, const std::string& name) {
  try {
    const auto [data, size] = reader.getRecord(name);
    return {static_cast<const char*>(data.get()), size};
  } catch (const c10::Error&) {
    return {};
  }
}

/// What the check accepts, LibTorch's own reader unpacks into bounded memory and without methods that run by
/// themselves.
void check_script_bytes(std::string_view bytes, const Path& folder) {
  const Path path = written(bytes, folder, "actor.pt");
  check_script_archive(path, "actor.pt");
  caffe2::serialize::PyTorchStreamReader reader(path.string());
  std::size_t unpacked = 0;
  for (const std::string& name : reader.getAllRecords()) {
    const std::string content = unpacked_part(reader, name);
    unpacked += content.size();
    promise(!name.starts_with("code/") || content.find("__setstate__") == std::string::npos,
            "no code runs while a file is loaded");
  }
  promise(unpacked <= kMaxUnpackedBytes + bytes.size(), "parts unpack into bounded memory");
}

NamedWeights small_weights() {
  return {{"layer.weight", torch::arange(6, torch::kFloat32).view({2, 3})},
          {"layer.bias", torch::zeros({2}, torch::kFloat16)},
          {"count", torch::full({}, 7, torch::kInt64)},
          {"none", torch::empty({0, 3})}};
}

/// {"layer.weight": a tensor [2, 3], "again": the same numbers transposed} and its storage.
std::string packed_weights() {
  test::Pickle pickle;
  pickle.ordered_dict().raw("(");
  pickle.text("layer.weight").tensor("FloatStorage", "0", 6, 0, {2, 3}, {3, 1});
  pickle.text("again").tensor("FloatStorage", "0", 6, 0, {3, 2}, {1, 3});
  return joined({pickle.raw("u.").bytes(), std::string(24, '\1')});
}

std::string packed_checkpoint() {
  test::Pickle pickle;
  pickle.raw("}(").text("format").text(Checkpoint::kFormat).text("texts").raw("}(").text("step").text("500").raw("u");
  pickle.text("tensors").raw("}(").text("layer.weight").tensor("DoubleStorage", "0", 4, 1, {2}, {1}).raw("uu.");
  return joined({pickle.bytes(), std::string(32, '\2')});
}

/// The parts that the check of a TorchScript file looks at.
std::string script_archive(const std::string& code, bool compressed) {
  return bytes_of("actor.pt", [&](const Path& path) {
    caffe2::serialize::PyTorchStreamWriter writer(path.string());
    writer.writeRecord("code/__torch__/doppel/actor.py", code.data(), code.size(), compressed);
    const std::string pickle = "\x80\x02}.";
    writer.writeRecord("data.pkl", pickle.data(), pickle.size(), compressed);
    writer.writeEndOfFile();
  });
}

}  // namespace

std::vector<FuzzTarget> archive_targets() {
  const std::string code = "class Actor(Module):\n  def forward(self, x: Tensor) -> Tensor:\n    return torch.neg(x)\n";
  const std::vector<std::string> pickle_words{
      "FloatStorage", "HalfStorage", "BoolStorage", "q\x01h\x01",
      "(t",           "R",           "Q",           "u",
      "K\xff",        "\x8a\x08",    kNextFile,     "ctorch._utils\n_rebuild_parameter\n",
      "tensors",      "texts"};
  return {{"safetensors",
           read_safetensors_bytes,
           {bytes_of("a",
                     [](const Path& path) {
                       write_safetensors(path, small_weights(), {{"format", "pt"}});
                     })},
           {"__metadata__", "\"dtype\":\"BF16\"", "\"shape\":[]", "\"shape\":[0]", "\"data_offsets\":[0,0]", "[[[[",
            "{\"a\":", "I64", "BOOL", "U8", "18446744073709551615", "-1", "1e300", "\\u0000"},
           unwrap_safetensors},
          {"torch_archive",
           read_archive_bytes,
           {bytes_of("a", [](const Path& path) { test::write_torch_weights(path, small_weights()); })},
           {"PK\x01\x02", "PK\x03\x04", "PK\x05\x06", "PK\x06\x06", "PK\x06\x07", "data.pkl", "data/0", "byteorder"},
           unwrap_zip},
          {"torch_weights", read_weights_bytes, {packed_weights()}, pickle_words},
          {"checkpoint", read_checkpoint_bytes, {packed_checkpoint()}, pickle_words},
          {"script_archive",
           check_script_bytes,
           {script_archive(code, false), script_archive(code, true)},
           {"PK\x01\x02", "PK\x03\x04", "PK\x05\x06", "PK\x06\x06", "PK\x06\x07", "code/", "data.pkl", "__setstate__",
            "torch.classes."},
           unwrap_zip}};
}

}  // namespace doppel::fuzz
