#include "doppel/nets/weights/torch_pickle.h"

#include <cmath>
#include <set>

#include "doppel/core/excerpt.h"
#include "doppel/core/pickle.h"

namespace doppel {
namespace {

constexpr std::size_t kMaxPickledTensors = 100'000, kMaxPickledAxes = 16, kMaxKeyLength = 200;
constexpr std::size_t kMaxTextBytes = 64 << 20;
constexpr std::size_t kMaxOthers = 5;

using Kind = PickleValue::Kind;

constexpr std::string_view kStorage = "storage";  // an object with a type and a key
constexpr std::string_view kTensor = "tensor";    // an object with a storage, an offset, a shape and strides

bool is_object(const PickleValue& value, std::string_view type) {
  return value.kind() == Kind::object && value.node()->text == type;
}

/// The four functions that mappings from names to tensors and texts need. A tensor is checked when it is used, because
/// opcodes that follow can change its parts.
class TorchFunctions : public PickleFunctions {
 public:
  std::string_view advice() const override {
    return "which a mapping from names to tensors does not need; it was not executed. If this is a whole model, save "
           "its "
           "weights alone: torch.save(model.state_dict(), FILE)";
  }
  std::size_t max_values() const override { return 2'000'000; }

  std::string find(const std::string& name) override { return name; }  // types of storages; a call is refused

  std::optional<PickleValue> call(const std::string& function, Items arguments, Pickle& pickle) override {
    if (function == "collections.OrderedDict" && arguments.empty()) return pickle.add(Kind::dictionary);
    if (function == "torch._utils._rebuild_tensor_v2" && arguments.size() >= 4 && is_object(arguments[0], kStorage))
      return pickle.add(Kind::object, std::string(kTensor), {arguments.begin(), arguments.begin() + 4});
    if (function == "torch._utils._rebuild_parameter" && !arguments.empty() && is_object(arguments[0], kTensor))
      return arguments[0];
    // A value with the name of its type, as LibTorch writes it.
    if (function == "torch.jit._pickle.restore_type_tag" && arguments.size() == 2) return arguments[0];
    return std::nullopt;
  }

  /// Attributes of an object: version numbers.
  void set_state(const PickleValue& /*target*/, const PickleValue& /*state*/, Pickle& /*pickle*/) override {}

  /// ('storage', torch.FloatStorage, key, device, size)
  std::optional<PickleValue> persistent_load(const PickleValue& id, Pickle& pickle) override {
    const Items parts = id.kind() == Kind::list ? id.items() : Items();
    const bool is_storage = parts.size() >= 3 && parts[0].text() == "storage" && parts[1].kind() == Kind::global &&
                            parts[2].kind() == Kind::text;
    if (!is_storage) return std::nullopt;
    return pickle.add(Kind::object, std::string(kStorage), {parts[1], parts[2]});
  }
};

/// Copies what was read. A pickle may name one long text a thousand times, so that copies are counted.
class DictionaryBuilder {
 public:
  explicit DictionaryBuilder(const FileLocation& where) : where_(where) {}

  PickledDictionary build(const PickleValue& mapping, bool is_root) {
    PickledDictionary built;
    std::set<std::string_view> names;
    const bool is_mapping = mapping.kind() == Kind::dictionary;
    if (!is_mapping || !taken_.insert(mapping.node()).second)
      fail_at(where_, "expected a mapping from names to tensors, found {}",
              is_mapping ? "one mapping twice" : "another value");
    const auto& items = mapping.node()->items;
    for (std::size_t i = 0; i + 1 < items.size(); i += 2) {
      const PickleValue &key = items[i], &value = items[i + 1];
      if (!names.insert(key.text()).second)
        fail_at(where_, "the pickle holds two values with the name '{}'", excerpt(key.text()));
      if (key.kind() == Kind::text || key.kind() == Kind::bytes)
        add(built, copy(key.text()), value, is_root);
      else if (built.others.size() < kMaxOthers)
        built.others.emplace_back("a key that is no text");
    }
    return built;
  }

 private:
  template <typename... Args>
  [[noreturn]] void bad(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where_, "the pickle holds {}", fmt::format(format, std::forward<Args>(args)...));
  }

  void add(PickledDictionary& to, const std::string& name, const PickleValue& value, bool is_root) {
    if (is_object(value, kTensor)) {
      if (++tensors_ > kMaxPickledTensors) bad("more than {} tensors", kMaxPickledTensors);
      to.tensors.push_back(tensor(value.node()->items));
      to.tensors.back().name = name;
    } else if (value.kind() == Kind::text || value.kind() == Kind::bytes) {
      to.texts[name] = copy(value.text());
    } else if (value.kind() == Kind::dictionary && is_root) {
      to.dictionaries[name] = build(value, false);
    } else if (to.others.size() < kMaxOthers) {
      to.others.push_back(excerpt(name));
    }
  }

  std::string copy(std::string_view text) {
    copied_ += text.size();
    if (copied_ > kMaxTextBytes) fail_at(where_, "the texts of the pickle take more than {} bytes", kMaxTextBytes);
    return std::string(text);
  }

  PickledTensor tensor(const std::vector<PickleValue>& parts) const {
    const auto& storage = parts[0].node()->items;
    const std::string &type = storage[0].node()->text, key(storage[1].text());
    if (key.size() > kMaxKeyLength) bad("a tensor with a key of {} bytes", key.size());
    PickledTensor tensor;
    tensor.storage = type.starts_with("torch.") ? type.substr(6) : type;
    tensor.key = key;
    tensor.offset = integer(parts[1]);
    tensor.shape = integers(parts[2]);
    tensor.stride = integers(parts[3]);
    if (tensor.shape.size() != tensor.stride.size()) bad("a tensor whose shape and strides differ in length");
    return tensor;
  }

  std::int64_t integer(const PickleValue& value) const {
    const double number = value.number();
    // Larger numbers are not exact in a double, and no file has so many elements.
    if (value.kind() != Kind::number || number != std::floor(number) || std::abs(number) > 9e15)
      bad("a tensor with an unknown description");
    return static_cast<std::int64_t>(number);
  }

  std::vector<std::int64_t> integers(const PickleValue& sequence) const {
    if (sequence.kind() != Kind::list) bad("a tensor with an unknown description");
    if (sequence.items().size() > kMaxPickledAxes) bad("a tensor with {} axes", sequence.items().size());
    std::vector<std::int64_t> values;
    for (const PickleValue& value : sequence.items()) values.push_back(integer(value));
    return values;
  }

  const FileLocation& where_;
  std::set<const PickleNode*> taken_;
  std::size_t copied_ = 0, tensors_ = 0;
};

}  // namespace

PickledDictionary read_torch_pickle(std::string_view bytes, const FileLocation& where) {
  TorchFunctions functions;
  const Pickle pickle = read_pickle(bytes, where, functions);
  return DictionaryBuilder(where).build(pickle.root, true);
}

}  // namespace doppel
