#include "doppel/nets/weights_file.h"

#include <caffe2/serialize/inline_container.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/nets/weights_pickle.h"

namespace doppel {

using torch::Tensor;

namespace {

/// An element type and its names in both formats.
struct NumberType {
  const char* storage;
  const char* safetensors;
  torch::ScalarType type;
};
constexpr std::array<NumberType, 10> kNumberTypes{{{"FloatStorage", "F32", torch::kFloat32},
                                                   {"DoubleStorage", "F64", torch::kFloat64},
                                                   {"HalfStorage", "F16", torch::kFloat16},
                                                   {"BFloat16Storage", "BF16", torch::kBFloat16},
                                                   {"LongStorage", "I64", torch::kInt64},
                                                   {"IntStorage", "I32", torch::kInt32},
                                                   {"ShortStorage", "I16", torch::kInt16},
                                                   {"CharStorage", "I8", torch::kInt8},
                                                   {"ByteStorage", "U8", torch::kUInt8},
                                                   {"BoolStorage", "BOOL", torch::kBool}}};

torch::ScalarType number_type(const char* NumberType::*format, const std::string& name, const std::string& tensor,
                              const FileLocation& where) {
  for (const NumberType& type : kNumberTypes)
    if (name == type.*format) return type.type;
  fail_at(where, "tensor '{}' has elements of type '{}'; floating-point numbers and integers are supported", tensor,
          name);
}

/// Larger than any tensor, small enough that products of two do not overflow 128 bits.
constexpr std::int64_t kHugeSize = std::int64_t{1} << 48;

/// The number of elements from the first to the last of a tensor, both included; nothing when a size is invalid.
std::optional<std::int64_t> extent(const PickledTensor& tensor) {
  if (tensor.offset < 0 || tensor.offset > kHugeSize || tensor.shape.size() > 16) return std::nullopt;
  std::int64_t last = 0, elements = 1;
  for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
    const std::int64_t size = tensor.shape[i], stride = tensor.stride[i];
    if (size < 0 || stride < 0 || size > kHugeSize || stride > kHugeSize) return std::nullopt;
    const __int128 reach = static_cast<__int128>(size - 1) * stride, count = static_cast<__int128>(elements) * size;
    if (reach > kHugeSize || count > kHugeSize) return std::nullopt;
    elements = static_cast<std::int64_t>(count);
    if (size > 0) last += static_cast<std::int64_t>(reach);
  }
  return elements == 0 ? 0 : last + 1;
}

/// The zip archive of a `.pth`.
class TorchArchive {
 public:
  explicit TorchArchive(const std::filesystem::path& path) : where_{path.string()} {
    try {
      reader_ = std::make_unique<caffe2::serialize::PyTorchStreamReader>(path.string());
    } catch (const std::exception&) {
      fail_at(where_, "not a file that torch.save of PyTorch 1.6 or later wrote (a zip archive), or damaged");
    }
  }

  std::pair<at::DataPtr, std::size_t> record(const std::string& name) {
    try {
      auto [data, size] = reader_->getRecord(name);
      return {std::move(data), size};
    } catch (const std::exception&) {
      fail_at(where_, "the archive's entry '{}' is missing or damaged", name);
    }
  }
  bool has(const std::string& name) { return reader_->hasRecord(name); }

  /// A view of the storage. Each storage is read once.
  Tensor tensor(const PickledTensor& found) {
    const torch::ScalarType type = number_type(&NumberType::storage, found.storage, found.name, where_);
    Tensor& storage = storages_[found.key];
    if (!storage.defined()) storage = load(found.key);
    const auto numbers = storage.numel() / static_cast<std::int64_t>(c10::elementSize(type));
    const std::optional<std::int64_t> elements = extent(found);
    if (!elements || found.offset + *elements > numbers)
      fail_at(where_, "tensor '{}' of shape [{}] reaches beyond its {} numbers", found.name,
              fmt::join(found.shape, ","), numbers);
    const Tensor typed = at::from_blob(
        storage.data_ptr(), {numbers}, [storage](void*) {}, torch::TensorOptions().dtype(type));
    return typed.as_strided(found.shape, found.stride, found.offset);
  }

 private:
  Tensor load(const std::string& key) {
    auto [data, size] = record("data/" + key);
    auto holder = std::make_shared<at::DataPtr>(std::move(data));
    return at::from_blob(
        holder->get(), {static_cast<std::int64_t>(size)}, [holder](void*) {},
        torch::TensorOptions().dtype(torch::kUInt8));
  }

  FileLocation where_;
  std::unique_ptr<caffe2::serialize::PyTorchStreamReader> reader_;
  std::map<std::string, Tensor> storages_;
};

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (!file) fail_at({path.string()}, "cannot be opened");
  std::vector<std::uint8_t> bytes(as_size(std::max<std::streamoff>(file.tellg(), 0)));
  file.seekg(0);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) fail_at({path.string()}, "cannot be read");
  return bytes;
}

constexpr std::size_t kLengthBytes = 8;

/// The JSON header of a safetensors file, and the offset of the numbers after it.
struct SafetensorsHeader {
  nlohmann::ordered_json entries;
  std::size_t begin = 0;

  SafetensorsHeader(const std::vector<std::uint8_t>& bytes, const FileLocation& where) {
    std::uint64_t length = 0;
    if (bytes.size() < kLengthBytes) fail_at(where, "{} bytes are too few for weights", bytes.size());
    std::memcpy(&length, bytes.data(), kLengthBytes);
    if (length > bytes.size() - kLengthBytes)
      fail_at(where, "neither a .pth (zip) nor safetensors: the header would be {} bytes long, the file has {}", length,
              bytes.size());
    begin = kLengthBytes + length;
    entries = nlohmann::ordered_json::parse(bytes.begin() + kLengthBytes,
                                            bytes.begin() + static_cast<std::ptrdiff_t>(begin), nullptr, false);
    if (!entries.is_object()) fail_at(where, "the header of a safetensors file must be a JSON object");
    entries.erase("__metadata__");
  }
};

/// One entry of that header.
struct SafetensorsEntry {
  std::string name;
  torch::ScalarType type;
  std::vector<std::int64_t> shape;
  std::uint64_t begin = 0, end = 0;

  SafetensorsEntry(const std::string& name_in, const nlohmann::ordered_json& json, const FileLocation& where)
      : name(name_in) {
    try {
      type = number_type(&NumberType::safetensors, json.at("dtype").get<std::string>(), name, where);
      for (const auto& size : json.at("shape")) shape.push_back(whole_number(size));
      const auto& offsets = json.at("data_offsets");
      if (offsets.size() != 2) throw std::out_of_range("data_offsets");
      begin = static_cast<std::uint64_t>(whole_number(offsets[0]));
      end = static_cast<std::uint64_t>(whole_number(offsets[1]));
    } catch (const FileError&) {
      throw;
    } catch (const std::exception&) {
      fail_at(where, "tensor '{}' needs dtype, shape and data_offsets [begin, end], found {}", name, json.dump());
    }
    __int128 bytes = static_cast<__int128>(c10::elementSize(type));
    for (std::int64_t size : shape) bytes = std::min<__int128>(bytes * size, kHugeSize);
    if (end < begin || bytes != static_cast<__int128>(end - begin))
      fail_at(where, "tensor '{}' of shape [{}] does not fill its bytes {} to {}", name, fmt::join(shape, ","), begin,
              end);
  }

 private:
  static std::int64_t whole_number(const nlohmann::ordered_json& json) {
    if (!json.is_number_unsigned() || json.get<std::uint64_t>() > static_cast<std::uint64_t>(kHugeSize))
      throw std::out_of_range("not a size");
    return static_cast<std::int64_t>(json.get<std::uint64_t>());
  }
};

/// Tensors must be contiguous, from the first byte to the last.
void check_places(const std::vector<SafetensorsEntry>& entries, std::uint64_t size, const FileLocation& where) {
  std::vector<const SafetensorsEntry*> order;
  for (const SafetensorsEntry& entry : entries) order.push_back(&entry);
  std::sort(order.begin(), order.end(),
            [](const auto* a, const auto* b) { return std::pair(a->begin, a->end) < std::pair(b->begin, b->end); });
  std::uint64_t reached = 0;
  for (const SafetensorsEntry* entry : order) {
    if (entry->begin != reached)
      fail_at(where, "tensor '{}' starts at byte {}, the one before ends at {}", entry->name, entry->begin, reached);
    reached = entry->end;
  }
  if (reached != size)
    fail_at(where, "the tensors end at byte {} of {}: the file is truncated or has surplus bytes", reached, size);
}

/// "a, b, c and 4 more"
std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 5;
  std::string text = fmt::format(
      "{}",
      fmt::join(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kShown)), ", "));
  if (names.size() > kShown) text += fmt::format(" and {} more", names.size() - kShown);
  return text;
}

bool begins_with_one_of(const std::string& name, const std::vector<std::string>& beginnings) {
  return std::any_of(beginnings.begin(), beginnings.end(),
                     [&](const std::string& beginning) { return name.rfind(beginning, 0) == 0; });
}

bool counts_batches(const std::string& name) {
  const std::string ending = "num_batches_tracked";
  return name.size() >= ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace

NamedWeights read_torch_weights(const std::filesystem::path& path) {
  const FileLocation where{path.string()};
  TorchArchive archive(path);
  if (archive.has("byteorder")) {
    const auto [order, size] = archive.record("byteorder");
    if (std::string(static_cast<const char*>(order.get()), size) != "little")
      fail_at(where, "the numbers are not little-endian; save the file again on a little-endian machine");
  }
  const auto [pickle, size] = archive.record("data.pkl");
  NamedWeights weights;
  for (const PickledTensor& found : read_pickled_tensors(static_cast<const std::uint8_t*>(pickle.get()), size, where))
    weights.emplace_back(found.name, archive.tensor(found));
  return weights;
}

NamedWeights read_safetensors(const std::filesystem::path& path) {
  const FileLocation where{path.string()};
  const std::vector<std::uint8_t> bytes = read_bytes(path);
  const SafetensorsHeader header(bytes, where);
  std::vector<SafetensorsEntry> entries;
  for (const auto& [name, json] : header.entries.items()) entries.emplace_back(name, json, where);
  check_places(entries, bytes.size() - header.begin, where);
  NamedWeights weights;
  for (const SafetensorsEntry& entry : entries) {
    Tensor tensor = torch::empty(entry.shape, torch::TensorOptions().dtype(entry.type));
    if (entry.end > entry.begin)
      std::memcpy(tensor.data_ptr(), bytes.data() + header.begin + entry.begin, entry.end - entry.begin);
    weights.emplace_back(entry.name, tensor);
  }
  return weights;
}

void write_safetensors(const std::filesystem::path& path, const NamedWeights& weights,
                       const std::map<std::string, std::string>& metadata) {
  nlohmann::ordered_json header = nlohmann::ordered_json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  std::size_t end = 0;
  for (const auto& [name, tensor] : weights) {
    if (header.contains(name)) fail("{}: two tensors are called '{}'", path.string(), name);
    const auto type = std::find_if(kNumberTypes.begin(), kNumberTypes.end(),
                                   [&](const NumberType& known) { return known.type == tensor.scalar_type(); });
    if (type == kNumberTypes.end())
      fail("{}: safetensors cannot hold '{}' of type {}", path.string(), name, c10::toString(tensor.scalar_type()));
    const std::size_t begin = end;
    end += tensor.nbytes();
    header[name] = {{"dtype", type->safetensors}, {"shape", tensor.sizes().vec()}, {"data_offsets", {begin, end}}};
  }
  std::string text = header.dump();
  text.resize((text.size() + kLengthBytes - 1) / kLengthBytes * kLengthBytes, ' ');  // the numbers are aligned
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    const std::uint64_t length = text.size();
    out.write(reinterpret_cast<const char*>(&length), kLengthBytes);
    out << text;
    for (const auto& [name, tensor] : weights) {
      const Tensor contiguous = tensor.detach().contiguous();
      out.write(static_cast<const char*>(contiguous.data_ptr()), static_cast<std::streamsize>(contiguous.nbytes()));
    }
    out.close();
    if (!out) fail("{}: writing failed; is the disk full?", path.string());
  });
}

NamedWeights read_weights(const std::filesystem::path& path) {
  std::array<char, 4> start{};
  std::ifstream file(path, std::ios::binary);
  if (!file) fail_at({path.string()}, "cannot be opened");
  file.read(start.data(), start.size());
  const std::string_view first(start.data(), as_size(file.gcount()));
  if (first == "PK\x03\x04") return read_torch_weights(path);
  if (first.substr(0, 2) == "\x80\x02")
    fail_at({path.string()},
            "the layout of PyTorch before 1.6; load it with a newer one and write it with torch.save again");
  return read_safetensors(path);
}

void load_weights(torch::nn::Module& module, const NamedWeights& weights, const std::filesystem::path& source,
                  const std::vector<std::string>& unused) {
  std::map<std::string, Tensor> targets;
  for (const auto& item : module.named_parameters()) targets[item.key()] = item.value();
  for (const auto& item : module.named_buffers()) targets[item.key()] = item.value();
  std::vector<std::pair<Tensor, Tensor>> copies;
  std::vector<std::string> unexpected, other_shape, missing;
  for (const auto& [name, tensor] : weights) {
    const auto target = targets.find(name);
    if (target == targets.end()) {
      if (!begins_with_one_of(name, unused)) unexpected.push_back(name);
      continue;
    }
    if (tensor.sizes() == target->second.sizes())
      copies.emplace_back(target->second, tensor);
    else
      other_shape.push_back(fmt::format("{} [{}] instead of [{}]", name, fmt::join(tensor.sizes(), ","),
                                        fmt::join(target->second.sizes(), ",")));
    targets.erase(target);
  }
  for (const auto& [name, tensor] : targets)
    if (!counts_batches(name)) missing.push_back(name);
  std::vector<std::string> faults;
  if (!missing.empty()) faults.push_back(fmt::format("missing: {}", listed(missing)));
  if (!unexpected.empty()) faults.push_back(fmt::format("unexpected: {}", listed(unexpected)));
  if (!other_shape.empty()) faults.push_back(fmt::format("other shapes: {}", listed(other_shape)));
  if (!faults.empty()) fail_at({source.string()}, "these weights are of another network ({})", fmt::join(faults, "; "));
  const torch::NoGradGuard no_grad;
  for (auto& [target, tensor] : copies) target.copy_(tensor);
}

}  // namespace doppel
