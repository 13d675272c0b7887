#include "doppel/nets/weights/weights_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/file_head.h"
#include "doppel/core/json_bounds.h"
#include "doppel/nets/weights/torch_archive.h"

namespace doppel {

using torch::Tensor;

namespace {

/// An element type and its name in a safetensors file.
struct NumberType {
  const char* name;
  torch::ScalarType type;
};
constexpr std::array<NumberType, 10> kNumberTypes{{{"F32", torch::kFloat32},
                                                   {"F64", torch::kFloat64},
                                                   {"F16", torch::kFloat16},
                                                   {"BF16", torch::kBFloat16},
                                                   {"I64", torch::kInt64},
                                                   {"I32", torch::kInt32},
                                                   {"I16", torch::kInt16},
                                                   {"I8", torch::kInt8},
                                                   {"U8", torch::kUInt8},
                                                   {"BOOL", torch::kBool}}};

/// Larger than any tensor, small enough that products of two do not overflow 128 bits.
constexpr std::int64_t kHugeSize = std::int64_t{1} << 48;
constexpr std::size_t kMaxAxes = 16, kMaxTensors = 100'000, kMaxDepth = 8;
constexpr std::size_t kMaxHeaderBytes = 100 << 20;  // as the safetensors library allows

constexpr std::size_t kLengthBytes = 8;

torch::ScalarType number_type(const std::string& name, const std::string& tensor, const FileLocation& where) {
  for (const NumberType& type : kNumberTypes)
    if (name == type.name) return type.type;
  fail_at(where, "tensor '{}' has elements of type '{}'; floating-point numbers and integers are supported",
          excerpt(tensor), excerpt(name));
}

/// The JSON header of a safetensors file.
std::string_view safetensors_header(std::string_view bytes, const FileLocation& where) {
  std::uint64_t length = 0;
  if (bytes.size() < kLengthBytes) fail_at(where, "{} bytes are too few for weights", bytes.size());
  std::memcpy(&length, bytes.data(), kLengthBytes);
  if (length > bytes.size() - kLengthBytes)
    fail_at(where, "neither a .pth (zip) nor safetensors: the header would be {} bytes long, the file has {}", length,
            bytes.size());
  if (length > kMaxHeaderBytes) fail_at(where, "the header has {} bytes, allowed are {}", length, kMaxHeaderBytes);
  return bytes.substr(kLengthBytes, as_size(length));
}

/// One entry of that header.
struct SafetensorsEntry {
  std::string name;
  torch::ScalarType type = torch::kFloat32;
  std::vector<std::int64_t> shape;
  std::uint64_t begin = 0, end = 0;

  SafetensorsEntry(const std::string& name_in, const nlohmann::json& json, const FileLocation& where) : name(name_in) {
    try {
      type = number_type(json.at("dtype").get<std::string>(), name, where);
      const auto &sizes = json.at("shape"), &offsets = json.at("data_offsets");
      if (sizes.size() > kMaxAxes || offsets.size() != 2) throw std::out_of_range("shape");
      for (const auto& size : sizes) shape.push_back(whole_number(size));
      begin = static_cast<std::uint64_t>(whole_number(offsets.at(0)));
      end = static_cast<std::uint64_t>(whole_number(offsets.at(1)));
    } catch (const FileError&) {
      throw;
    } catch (const std::exception&) {
      fail_at(where, "tensor '{}' needs dtype, shape of at most {} sizes and data_offsets [begin, end], found {}",
              excerpt(name), kMaxAxes, excerpt(shown_json(json)));
    }
    __int128 bytes = static_cast<__int128>(c10::elementSize(type));
    for (std::int64_t size : shape) bytes = std::min<__int128>(bytes * size, kHugeSize);
    if (end < begin || bytes != static_cast<__int128>(end - begin))
      fail_at(where, "tensor '{}' of shape [{}] does not fill its bytes {} to {}", excerpt(name), fmt::join(shape, ","),
              begin, end);
  }

 private:
  static std::int64_t whole_number(const nlohmann::json& json) {
    if (!json.is_number_unsigned() || json.get<std::uint64_t>() > static_cast<std::uint64_t>(kHugeSize))
      throw std::out_of_range("not a size");
    return static_cast<std::int64_t>(json.get<std::uint64_t>());
  }
  /// A text of the file need not be UTF-8.
  static std::string shown_json(const nlohmann::json& json) {
    return json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  }
};

/// The tensors of a header, in the order of their numbers.
std::vector<SafetensorsEntry> safetensors_entries(std::string_view header, const FileLocation& where) {
  if (is_json_deeper_than(header, kMaxDepth)) fail_at(where, "the header's lists are nested too deeply");
  const nlohmann::json json = nlohmann::json::parse(header, nullptr, false);
  if (!json.is_object()) fail_at(where, "the header of a safetensors file must be a JSON object");
  if (json.size() > kMaxTensors) fail_at(where, "the header has {} tensors, allowed are {}", json.size(), kMaxTensors);
  std::vector<SafetensorsEntry> entries;
  for (const auto& [name, entry] : json.items())
    if (name != "__metadata__") entries.emplace_back(name, entry, where);
  std::stable_sort(entries.begin(), entries.end(), [](const SafetensorsEntry& a, const SafetensorsEntry& b) {
    return std::pair(a.begin, a.end) < std::pair(b.begin, b.end);
  });
  return entries;
}

/// Tensors must be contiguous, from the first byte to the last.
void check_ranges(const std::vector<SafetensorsEntry>& entries, std::uint64_t size, const FileLocation& where) {
  std::uint64_t reached = 0;
  for (const SafetensorsEntry& entry : entries) {
    if (entry.begin != reached)
      fail_at(where, "tensor '{}' starts at byte {}, the one before ends at {}", excerpt(entry.name), entry.begin,
              reached);
    reached = entry.end;
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
  TorchArchive archive(path, read_file(path));
  const PickledDictionary found = archive.dictionary();
  std::vector<std::string> others = found.others;
  for (const auto& [name, text] : found.texts) others.push_back(excerpt(name));
  for (const auto& [name, dictionary] : found.dictionaries) others.push_back(excerpt(name));
  if (found.tensors.empty() || !others.empty())
    fail_at(where,
            "expected a mapping from names to tensors, found {}; save the weights alone: "
            "torch.save(model.state_dict(), FILE)",
            others.empty() ? "none" : "in it also '" + listed(others) + "'");
  NamedWeights weights;
  for (const PickledTensor& tensor : found.tensors) weights.emplace_back(tensor.name, archive.tensor(tensor));
  return weights;
}

NamedWeights read_safetensors(const std::filesystem::path& path) {
  const FileLocation where{path.string()};
  const std::string bytes = read_file(path);
  const std::string_view header = safetensors_header(bytes, where);
  const std::string_view data = std::string_view(bytes).substr(kLengthBytes + header.size());
  const std::vector<SafetensorsEntry> entries = safetensors_entries(header, where);
  check_ranges(entries, data.size(), where);
  NamedWeights weights;
  for (const SafetensorsEntry& entry : entries) {
    Tensor tensor = torch::empty(entry.shape, torch::TensorOptions().dtype(entry.type));
    if (entry.end > entry.begin)
      std::memcpy(tensor.data_ptr(), data.data() + entry.begin, as_size(entry.end - entry.begin));
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
                                   [wanted = tensor.scalar_type()](const auto& known) { return known.type == wanted; });
    if (type == kNumberTypes.end())
      fail("{}: safetensors cannot hold '{}' of type {}", path.string(), name, c10::toString(tensor.scalar_type()));
    const std::size_t begin = end;
    end += tensor.nbytes();
    header[name] = {{"dtype", type->name}, {"shape", tensor.sizes().vec()}, {"data_offsets", {begin, end}}};
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const nlohmann::json::exception&) {
    fail("{}: a name or a text is not in UTF-8, which safetensors needs", path.string());
  }
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
  const std::string first = read_head(path, 4);
  if (first == "PK\x03\x04") return read_torch_weights(path);
  if (first.starts_with("\x80\x02"))
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
