#include "doppel/nets/weights_pickle.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <unordered_map>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

/// A value on the stack. All values are in one array and refer to each other by index, so that cycles and deep nesting
/// in a malicious file do no harm.
struct Value {
  enum class Kind { none, number, text, sequence, mapping, function, storage, tensor };
  Kind kind = Kind::none;
  std::int64_t number = 0;         ///< also of booleans
  std::string text;                ///< of a function: module and name with a dot
  std::vector<std::size_t> items;  ///< of a mapping: key, value, key, value, ...
  PickledTensor tensor;            ///< of a storage: its type and key only
};
using Kind = Value::Kind;

/// The stack machine of Python's pickle protocol 2.
class Machine {
 public:
  Machine(const std::uint8_t* bytes, std::size_t size, const FileLocation& where)
      : next_(bytes), end_(bytes + size), where_(where) {}

  /// Runs to STOP. @return the value on top
  const Value& run() {
    while (step(byte())) {
    }
    return top();
  }
  const Value& at(std::size_t index) const { return arena_[index]; }

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
            "is a "
            "whole model, save its weights alone: torch.save(model.state_dict(), FILE)",
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
    std::vector<std::int64_t> values;
    for (std::size_t i = 0; i < sequence.items.size(); ++i) values.push_back(item(sequence, i, Kind::number).number);
    return values;
  }
  /// ('storage', torch.FloatStorage, key, device, size)
  void open_storage() {
    const Value& id = at(pop());
    if (item(id, 0, Kind::text).text != "storage") bad("a reference to something other than a tensor's numbers");
    const std::string type = item(id, 1, Kind::function).text, key = item(id, 2, Kind::text).text;
    Value& storage = arena_[push(Kind::storage)];
    storage.tensor.storage = type.rfind("torch.", 0) == 0 ? type.substr(6) : type;
    storage.tensor.key = key;
  }
  void call() {
    const Value& arguments = at(pop());
    const std::string function = at(pop()).text;
    if (arguments.kind != Kind::sequence) bad("a call without arguments");
    if (function == "collections.OrderedDict" && arguments.items.empty()) {
      push(Kind::mapping);
    } else if (function == "torch._utils._rebuild_tensor_v2") {
      PickledTensor tensor = item(arguments, 0, Kind::storage).tensor;
      tensor.offset = item(arguments, 1, Kind::number).number;
      tensor.shape = numbers(item(arguments, 2, Kind::sequence));
      tensor.stride = numbers(item(arguments, 3, Kind::sequence));
      if (tensor.shape.size() != tensor.stride.size()) bad("a tensor whose shape and strides differ in length");
      arena_[push(Kind::tensor)].tensor = std::move(tensor);
    } else if (function == "torch._utils._rebuild_parameter") {
      const PickledTensor tensor = item(arguments, 0, Kind::tensor).tensor;
      arena_[push(Kind::tensor)].tensor = tensor;
    } else {
      bad("a call of {}, which a mapping from names to tensors does not need; it was not executed. If this is a whole "
          "model, save its weights alone: torch.save(model.state_dict(), FILE)",
          function);
    }
  }

  const std::uint8_t* next_;
  const std::uint8_t* end_;
  FileLocation where_;
  std::deque<Value> arena_;
  std::vector<std::size_t> stack_, marks_;
  std::unordered_map<std::uint64_t, std::size_t> memo_;
};

}  // namespace

std::vector<PickledTensor> read_pickled_tensors(const std::uint8_t* bytes, std::size_t size,
                                                const FileLocation& where) {
  Machine machine(bytes, size, where);
  const Value& result = machine.run();
  std::vector<PickledTensor> tensors;
  std::string others;
  for (std::size_t i = 0; result.kind == Kind::mapping && i + 1 < result.items.size(); i += 2) {
    const Value &key = machine.at(result.items[i]), &value = machine.at(result.items[i + 1]);
    if (key.kind == Kind::text && value.kind == Kind::tensor) {
      tensors.push_back(value.tensor);
      tensors.back().name = key.text;
    } else {
      others += (others.empty() ? "'" : ", '") + key.text + "'";
    }
  }
  if (tensors.empty() || !others.empty())
    fail_at(where,
            "expected a mapping from names to tensors, found {}; save the weights alone: "
            "torch.save(model.state_dict(), FILE)",
            others.empty() ? "none" : "in it also " + others);
  return tensors;
}

}  // namespace doppel
