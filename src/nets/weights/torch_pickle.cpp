#include "doppel/nets/weights/torch_pickle.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <set>
#include <unordered_map>

#include "doppel/core/as_size.h"
#include "doppel/core/excerpt.h"

namespace doppel {
namespace {

constexpr std::size_t kMostPickledValues = 2'000'000, kMostPickledTensors = 100'000, kMostPickledAxes = 16,
                      kLongestKey = 200;
constexpr std::size_t kMostTextBytes = 64 << 20;
constexpr std::size_t kMostOthers = 5;

/// A value on the stack. All values are in one array and refer to each other by index, so that cycles and deep nesting
/// in a malicious file do no harm.
struct Value {
  enum class Kind { none, number, text, sequence, mapping, function, storage, tensor };
  Kind kind = Kind::none;
  std::int64_t number = 0;         ///< also of booleans; of a tensor: its place among the tensors
  std::string text;                ///< of a function: module and name with a dot
  std::vector<std::size_t> items;  ///< of a mapping: key, value, key, value, ...; of a storage: its type and its key
};
using Kind = Value::Kind;

/// The stack machine of Python's pickle protocol 2.
class Machine {
 public:
  Machine(std::string_view bytes, const FileLocation& where)
      : next_(reinterpret_cast<const std::uint8_t*>(bytes.data())), end_(next_ + bytes.size()), where_(where) {}

  /// Runs to STOP. @return the value on top
  const Value& run() {
    while (step(byte())) {
    }
    return top();
  }
  const Value& at(std::size_t index) const { return arena_[index]; }
  const PickledTensor& tensor(const Value& value) const { return tensors_[value.number]; }

 private:
  // Instructions, by their letter in the protocol.
  bool step(int instruction) {
    switch (instruction) {
      case 0x80:
        byte();
        return true;  // PROTO
      case '.':
        return false;
      case '(':
        marks_.push_back(stack_.size());
        return true;
      case 'N':
        push(Kind::none);
        return true;
      case 0x88:
        push_number(1);
        return true;
      case 0x89:
        push_number(0);
        return true;
      case 'K':
        push_number(byte());
        return true;
      case 'M':
        push_number(static_cast<std::int64_t>(unsigned_number(2)));
        return true;
      case 'J':
        push_number(static_cast<std::int32_t>(unsigned_number(4)));
        return true;
      case 0x8a:
        push_number(long_number(byte()));
        return true;
      case 'G':
        skip(8);
        push(Kind::none);
        return true;  // a floating-point number: not part of a tensor
      case 'X':
        push_text(unsigned_number(4));
        return true;
      case 'U':
        push_text(byte());
        return true;
      case 'c':
        push_function();
        return true;
      case ')':
      case ']':
        push(Kind::sequence);
        return true;
      case '}':
        push(Kind::mapping);
        return true;
      default:
        return step_on_stack(instruction);
    }
  }

  bool step_on_stack(int instruction) {
    switch (instruction) {
      case 0x85:
      case 0x86:
      case 0x87:
        gather(stack_.size() - need(instruction - 0x84));
        return true;
      case 't':
        gather(mark());
        return true;
      case 'a':
        append(stack_.size() - need(1), Kind::sequence);
        return true;
      case 'e':
        append(mark(), Kind::sequence);
        return true;
      case 's':
        append(stack_.size() - need(2), Kind::mapping);
        return true;
      case 'u':
        append(mark(), Kind::mapping);
        return true;
      case 'q':
        memo_[byte()] = top_index();
        return true;
      case 'r':
        memo_[unsigned_number(4)] = top_index();
        return true;
      case 'h':
        recall(byte());
        return true;
      case 'j':
        recall(unsigned_number(4));
        return true;
      case 'Q':
        open_storage();
        return true;
      case 'R':
        call();
        return true;
      case 'b':
        need(2);
        stack_.pop_back();
        return true;  // attributes of an object: version numbers
      default:
        bad("instruction 0x{:02x}, which a mapping from names to tensors does not need; it was not executed. If this "
            "is a whole model, save its weights alone: torch.save(model.state_dict(), FILE)",
            instruction);
    }
  }

  template <typename... Args>
  [[noreturn]] void bad(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where_, "the pickle holds {}", fmt::format(format, std::forward<Args>(args)...));
  }

  // Bytes.
  int byte() { return *take(1); }
  void skip(std::size_t count) { take(count); }
  const std::uint8_t* take(std::size_t count) {
    if (as_size(end_ - next_) < count) fail_at(where_, "the pickle ends too early");
    const std::uint8_t* at = next_;
    next_ += count;
    return at;
  }
  std::uint64_t unsigned_number(int count) {
    const std::uint8_t* bytes = take(as_size(count));
    std::uint64_t value = 0;
    for (int i = 0; i < count; ++i) value |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
    return value;
  }
  std::int64_t long_number(int count) {
    if (count > 8) bad("a whole number of {} bytes", count);
    if (count == 0) return 0;
    const int unused = 64 - 8 * count;
    return static_cast<std::int64_t>(unsigned_number(count) << unused) >> unused;
  }
  std::string line() {
    const std::uint8_t* end = std::find(next_, end_, '\n');
    const std::string text(next_, end);
    skip(text.size() + 1);
    return text;
  }

  // Stack.
  std::size_t push(Kind kind) {
    if (arena_.size() >= kMostPickledValues) bad("more than {} values", kMostPickledValues);
    arena_.emplace_back().kind = kind;
    stack_.push_back(arena_.size() - 1);
    return arena_.size() - 1;
  }
  void push_number(std::int64_t number) { arena_[push(Kind::number)].number = number; }
  void push_text(std::uint64_t size) {
    const auto* bytes = reinterpret_cast<const char*>(take(size));
    arena_[push(Kind::text)].text.assign(bytes, size);
  }
  void push_function() {
    const std::string module = line(), name = line();
    arena_[push(Kind::function)].text = module + "." + name;
  }
  /// Requires at least so many values above the last mark. @return their number
  std::size_t need(std::size_t count) const {
    const std::size_t floor = marks_.empty() ? 0 : marks_.back();
    if (stack_.size() < floor + count) bad("an instruction without the values it works on");
    return count;
  }
  std::size_t top_index() const {
    need(1);
    return stack_.back();
  }
  const Value& top() const { return arena_[top_index()]; }
  std::size_t pop() {
    const std::size_t index = top_index();
    stack_.pop_back();
    return index;
  }
  std::size_t mark() {
    if (marks_.empty()) bad("an instruction without its mark");
    const std::size_t at = marks_.back();
    marks_.pop_back();
    return at;
  }
  std::vector<std::size_t> cut(std::size_t first) {
    const std::vector<std::size_t> items(stack_.begin() + static_cast<std::ptrdiff_t>(first), stack_.end());
    stack_.resize(first);
    return items;
  }
  void gather(std::size_t first) {
    std::vector<std::size_t> items = cut(first);
    arena_[push(Kind::sequence)].items = std::move(items);
  }
  void append(std::size_t first, Kind kind) {
    const std::vector<std::size_t> items = cut(first);
    Value& target = arena_[top_index()];
    if (target.kind != kind || (kind == Kind::mapping && items.size() % 2 != 0))
      bad("entries for a value that is not a container");
    target.items.insert(target.items.end(), items.begin(), items.end());
  }
  void recall(std::uint64_t key) {
    const auto found = memo_.find(key);
    if (found == memo_.end()) bad("a reference to a value that was not stored");
    stack_.push_back(found->second);
  }

  // Tensors.
  const Value& item(const Value& sequence, std::size_t index, Kind kind) const {
    if (sequence.kind != Kind::sequence || index >= sequence.items.size() || at(sequence.items[index]).kind != kind)
      bad("a tensor with an unknown description");
    return at(sequence.items[index]);
  }
  std::vector<std::int64_t> numbers(const Value& sequence) const {
    if (sequence.items.size() > kMostPickledAxes) bad("a tensor with {} axes", sequence.items.size());
    std::vector<std::int64_t> values;
    for (std::size_t i = 0; i < sequence.items.size(); ++i) values.push_back(item(sequence, i, Kind::number).number);
    return values;
  }
  /// ('storage', torch.FloatStorage, key, device, size)
  void open_storage() {
    const Value& id = at(pop());
    if (item(id, 0, Kind::text).text != "storage") bad("a reference to something other than a tensor's numbers");
    item(id, 1, Kind::function), item(id, 2, Kind::text);
    std::vector<std::size_t> type_and_key{id.items[1], id.items[2]};
    arena_[push(Kind::storage)].items = std::move(type_and_key);
  }
  void push_tensor(const Value& arguments) {
    if (tensors_.size() >= kMostPickledTensors) bad("more than {} tensors", kMostPickledTensors);
    const Value& storage = item(arguments, 0, Kind::storage);
    const std::string &type = at(storage.items[0]).text, &key = at(storage.items[1]).text;
    if (type.size() > kLongestKey || key.size() > kLongestKey) bad("a tensor with a key of {} bytes", key.size());
    PickledTensor tensor;
    tensor.storage = type.rfind("torch.", 0) == 0 ? type.substr(6) : type;
    tensor.key = key;
    tensor.offset = item(arguments, 1, Kind::number).number;
    tensor.shape = numbers(item(arguments, 2, Kind::sequence));
    tensor.stride = numbers(item(arguments, 3, Kind::sequence));
    if (tensor.shape.size() != tensor.stride.size()) bad("a tensor whose shape and strides differ in length");
    tensors_.push_back(std::move(tensor));
    arena_[push(Kind::tensor)].number = static_cast<std::int64_t>(tensors_.size()) - 1;
  }
  void call() {
    const Value& arguments = at(pop());
    const std::string& function = at(pop()).text;
    if (arguments.kind != Kind::sequence) bad("a call without arguments");
    if (function == "collections.OrderedDict" && arguments.items.empty()) {
      push(Kind::mapping);
    } else if (function == "torch._utils._rebuild_tensor_v2") {
      push_tensor(arguments);
    } else if (function == "torch._utils._rebuild_parameter") {
      item(arguments, 0, Kind::tensor);
      stack_.push_back(arguments.items[0]);
    } else if (function == "torch.jit._pickle.restore_type_tag" && arguments.items.size() == 2) {
      stack_.push_back(arguments.items[0]);  // a value with the name of its type, as LibTorch writes it
    } else {
      bad("a call of {}, which a mapping from names to tensors does not need; it was not executed. If this is a whole "
          "model, save its weights alone: torch.save(model.state_dict(), FILE)",
          excerpt(function));
    }
  }

  const std::uint8_t* next_;
  const std::uint8_t* end_;
  FileLocation where_;
  std::deque<Value> arena_;
  std::vector<PickledTensor> tensors_;
  std::vector<std::size_t> stack_, marks_;
  std::unordered_map<std::uint64_t, std::size_t> memo_;
};

/// Copies what a machine has read. A pickle may name one long text a thousand times, so that copies are counted.
class DictionaryBuilder {
 public:
  DictionaryBuilder(const Machine& machine, const FileLocation& where) : machine_(machine), where_(where) {}

  PickledDictionary build(const Value& mapping, bool is_root) {
    PickledDictionary built;
    std::set<std::string_view> names;
    if (mapping.kind != Kind::mapping || !taken_.insert(&mapping).second)
      fail_at(where_, "expected a mapping from names to tensors, found {}",
              mapping.kind == Kind::mapping ? "one mapping twice" : "another value");
    for (std::size_t i = 0; i + 1 < mapping.items.size(); i += 2) {
      const Value &key = machine_.at(mapping.items[i]), &value = machine_.at(mapping.items[i + 1]);
      if (!names.insert(key.text).second)
        fail_at(where_, "the pickle holds two values with the name '{}'", excerpt(key.text));
      if (key.kind == Kind::text)
        add(built, copy(key.text), value, is_root);
      else if (built.others.size() < kMostOthers)
        built.others.emplace_back("a key that is no text");
    }
    return built;
  }

 private:
  void add(PickledDictionary& to, const std::string& name, const Value& value, bool is_root) {
    if (value.kind == Kind::tensor) {
      to.tensors.push_back(machine_.tensor(value));
      to.tensors.back().name = name;
    } else if (value.kind == Kind::text) {
      to.texts[name] = copy(value.text);
    } else if (value.kind == Kind::mapping && is_root) {
      to.dictionaries[name] = build(value, false);
    } else if (to.others.size() < kMostOthers) {
      to.others.push_back(excerpt(name));
    }
  }
  const std::string& copy(const std::string& text) {
    copied_ += text.size();
    if (copied_ > kMostTextBytes) fail_at(where_, "the texts of the pickle take more than {} bytes", kMostTextBytes);
    return text;
  }

  const Machine& machine_;
  const FileLocation& where_;
  std::set<const Value*> taken_;
  std::size_t copied_ = 0;
};

}  // namespace

PickledDictionary read_torch_pickle(std::string_view bytes, const FileLocation& where) {
  Machine machine(bytes, where);
  const Value& root = machine.run();
  return DictionaryBuilder(machine, where).build(root, true);
}

}  // namespace doppel
