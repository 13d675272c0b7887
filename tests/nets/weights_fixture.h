#pragma once

#include <caffe2/serialize/inline_container.h>
#include <torch/nn/module.h>
#include <torch/serialize.h>
#include <torch/types.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "doppel/nets/weights/weights_file.h"

/// Writers of the two layouts of weights files, as PyTorch and the safetensors library write them.
namespace doppel::test {

/// Instructions of a pickle, protocol 2, in the words of the mapping that torch.save writes.
class Pickle {
 public:
  Pickle() { bytes_ = "\x80\x02"; }

  Pickle& raw(const std::string& bytes) {
    bytes_ += bytes;
    return *this;
  }
  Pickle& function(const std::string& module, const std::string& name) {
    return raw("c" + module + "\n" + name + "\n");
  }
  Pickle& ordered_dict() { return function("collections", "OrderedDict").raw(")R"); }
  Pickle& text(const std::string& value) { return raw("X" + word(value.size(), 4) + value); }
  Pickle& number(int64_t value) {
    if (value >= 0 && value < 256) return raw("K" + word(static_cast<uint64_t>(value), 1));
    if (value >= 0 && value < 65536) return raw("M" + word(static_cast<uint64_t>(value), 2));
    if (value >= -(int64_t{1} << 31) && value < (int64_t{1} << 31))
      return raw("J" + word(static_cast<uint64_t>(value) & 0xffffffffu, 4));
    return raw("\x8a\x08" + word(static_cast<uint64_t>(value), 8));
  }
  Pickle& tuple(at::IntArrayRef values) {
    raw("(");
    for (int64_t value : values) number(value);
    return raw("t");
  }
  /// torch._utils._rebuild_tensor_v2(storage, offset, shape, stride, False, OrderedDict())
  Pickle& tensor(const std::string& storage, const std::string& key, int64_t numbers, int64_t offset,
                 at::IntArrayRef shape, at::IntArrayRef stride) {
    function("torch._utils", "_rebuild_tensor_v2").raw("((").text("storage").function("torch", storage).text(key);
    text("cpu").number(numbers).raw("tQ").number(offset);
    return tuple(shape).tuple(stride).raw("\x89").ordered_dict().raw("tR");
  }
  const std::string& bytes() const { return bytes_; }

 private:
  static std::string word(uint64_t value, int count) {
    std::string bytes;
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
    return bytes;
  }
  std::string bytes_;
};

/// An archive with this pickle and the numbers of these storages, "0", "1", ...
inline void write_archive(const std::filesystem::path& path, const std::string& pickle,
                          const std::vector<torch::Tensor>& storages) {
  caffe2::serialize::PyTorchStreamWriter writer(path.string());
  writer.writeRecord("data.pkl", pickle.data(), pickle.size());
  for (size_t i = 0; i < storages.size(); ++i)
    writer.writeRecord("data/" + std::to_string(i), storages[i].data_ptr(), storages[i].nbytes());
  writer.writeEndOfFile();
}

inline std::string storage_name(const torch::Tensor& tensor) {
  switch (tensor.scalar_type()) {
    case torch::kFloat64:
      return "DoubleStorage";
    case torch::kFloat16:
      return "HalfStorage";
    case torch::kInt64:
      return "LongStorage";
    default:
      return "FloatStorage";
  }
}

/// What torch.save(state_dict) writes.
inline void write_torch_weights(const std::filesystem::path& path, const NamedWeights& weights) {
  Pickle pickle;
  std::vector<torch::Tensor> storages;
  pickle.ordered_dict().raw("q").raw(std::string(1, '\0')).raw("(");
  for (const auto& [name, value] : weights) {
    const torch::Tensor tensor = value.detach().contiguous();
    pickle.text(name).tensor(storage_name(tensor), std::to_string(storages.size()), tensor.numel(), 0, tensor.sizes(),
                             tensor.strides());
    storages.push_back(tensor);
  }
  // Attributes of the mapping: notes on the versions of modules.
  pickle.raw("u}").text("_metadata").ordered_dict().raw("(").text("").raw("}").text("version").number(1).raw("susb.");
  write_archive(path, pickle.bytes(), storages);
}

/// A safetensors file with this header and these bytes.
inline void write_safetensors(const std::filesystem::path& path, const std::string& header, const std::string& data) {
  std::ofstream file(path, std::ios::binary);
  const uint64_t length = header.size();
  file.write(reinterpret_cast<const char*>(&length), 8);
  file << header << data;
}

inline void write_safetensors(const std::filesystem::path& path, const NamedWeights& weights) {
  nlohmann::ordered_json header;
  header["__metadata__"]["format"] = "pt";
  std::string data;
  for (const auto& [name, value] : weights) {
    const torch::Tensor tensor = value.detach().contiguous();
    header[name]["dtype"] = tensor.scalar_type() == torch::kInt64     ? "I64"
                            : tensor.scalar_type() == torch::kFloat16 ? "F16"
                                                                      : "F32";
    header[name]["shape"] = tensor.sizes().vec();
    header[name]["data_offsets"] = {data.size(), data.size() + tensor.nbytes()};
    data.append(static_cast<const char*>(tensor.data_ptr()), tensor.nbytes());
  }
  write_safetensors(path, header.dump(), data);
}

/// Parameters and buffers of a module.
inline NamedWeights weights_of(const torch::nn::Module& module) {
  NamedWeights weights;
  for (const auto& item : module.named_parameters()) weights.emplace_back(item.key(), item.value());
  for (const auto& item : module.named_buffers()) weights.emplace_back(item.key(), item.value());
  return weights;
}

}  // namespace doppel::test
