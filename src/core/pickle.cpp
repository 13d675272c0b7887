#include "doppel/core/pickle.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <unordered_map>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/text_reader.h"

namespace doppel {
namespace {

// A file of a few bytes for every value would otherwise take many times its size in memory.
constexpr std::size_t kPickleMaxNodes = 4'000'000;
constexpr std::size_t kPickleMaxMarks = 1000;
constexpr std::size_t kPickleMaxName = 200;  // bytes of the module and name of a function
constexpr std::size_t kPickleMaxAxes = 32;
constexpr std::size_t kPickleMaxNumbers = 1 << 20;  // of one call of `numbers`
constexpr int kPickleMaxDepth = 16;
constexpr double kPickleMaxAxis = 1e15;

using PickleKind = PickleValue::Kind;

constexpr const char* kPickleArray = "numpy.ndarray";
constexpr const char* kPickleDtype = "numpy.dtype";
constexpr const char* kPickleReconstruct = "numpy.core.multiarray._reconstruct";
constexpr const char* kPickleScalar = "numpy.core.multiarray.scalar";
constexpr const char* kPickleFromBuffer = "numpy.core.numeric._frombuffer";
constexpr const char* kPickleEncode = "_codecs.encode";

/// The positions in the state of an array: (version, shape, dtype, Fortran order, data).
constexpr std::size_t kPickleArrayShape = 1, kPickleArrayDtype = 2, kPickleArrayFortran = 3, kPickleArrayData = 4;
constexpr std::size_t kPickleArrayParts = 5;

const char* refused_pickle_opcode(unsigned char opcode) {
  switch (opcode) {
    case 'P':
      return "names an object outside of the file (PERSID)";
    case 'o':
      return "creates an object (OBJ)";
    case 0x81:
    case 0x92:
      return "creates an object (NEWOBJ)";
    case 0x82:
    case 0x83:
    case 0x84:
      return "names a registered extension (EXT)";
    case 0x8f:
    case 0x90:
    case 0x91:
      return "holds a set";
    case 0x97:
    case 0x98:
      return "holds a buffer outside of the file (NEXT_BUFFER)";
    default:
      return nullptr;
  }
}

void append_pickle_utf8(std::string& text, std::uint32_t code) {
  const auto byte = [&](std::uint32_t value) { text += static_cast<char>(static_cast<unsigned char>(value)); };
  if (code < 0x80) {
    byte(code);
  } else if (code < 0x800) {
    byte(0xC0 | code >> 6);
    byte(0x80 | (code & 0x3F));
  } else if (code < 0x10000) {
    byte(0xE0 | code >> 12);
    byte(0x80 | (code >> 6 & 0x3F));
    byte(0x80 | (code & 0x3F));
  } else {
    byte(0xF0 | (code >> 18 & 0x07));
    byte(0x80 | (code >> 12 & 0x3F));
    byte(0x80 | (code >> 6 & 0x3F));
    byte(0x80 | (code & 0x3F));
  }
}

/// The number that `count` hexadecimal digits mean. Nothing if they are not all there.
std::optional<std::uint32_t> pickle_hexadecimal(std::string_view text, std::size_t begin, std::size_t count) {
  if (begin + count > text.size()) return std::nullopt;
  std::uint32_t value = 0;
  for (char c : text.substr(begin, count)) {
    const std::size_t digit = std::string_view("0123456789abcdef").find(c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c);
    if (digit == std::string_view::npos) return std::nullopt;
    value = value << 4 | static_cast<std::uint32_t>(digit);
  }
  return value;
}

/// The bytes of a literal of Python 2 without its quotation marks. Nothing if it is damaged.
std::optional<std::string> pickle_string_literal(std::string_view literal) {
  if (literal.size() < 2 || literal.front() != literal.back() || (literal[0] != '\'' && literal[0] != '"'))
    return std::nullopt;
  literal = literal.substr(1, literal.size() - 2);
  std::string bytes;
  for (std::size_t i = 0; i < literal.size(); ++i) {
    if (literal[i] != '\\') {
      bytes += literal[i];
      continue;
    }
    if (++i == literal.size()) return std::nullopt;
    if (literal[i] == 'x') {
      const auto value = pickle_hexadecimal(literal, i + 1, 2);
      if (!value) return std::nullopt;
      bytes += static_cast<char>(*value);
      i += 2;
      continue;
    }
    constexpr std::string_view kNames = "ntr\\'\"", kMeant = "\n\t\r\\'\"";
    const std::size_t at = kNames.find(literal[i]);
    if (at == std::string_view::npos) return std::nullopt;
    bytes += kMeant[at];
  }
  return bytes;
}

/// UTF-8 of Latin-1 with \uXXXX and \UXXXXXXXX, as protocol 0 writes a text. Nothing if it is damaged.
std::optional<std::string> pickle_escaped_text(std::string_view line) {
  std::string text;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool escaped = line[i] == '\\' && i + 1 < line.size() && (line[i + 1] == 'u' || line[i + 1] == 'U');
    if (!escaped) {
      append_pickle_utf8(text, static_cast<unsigned char>(line[i]));
      continue;
    }
    const std::size_t digits = line[i + 1] == 'u' ? 4 : 8;
    const auto code = pickle_hexadecimal(line, i + 2, digits);
    if (!code || *code > 0x10FFFF) return std::nullopt;
    append_pickle_utf8(text, *code);
    i += 1 + digits;
  }
  return text;
}

/// The bytes of a text whose characters are all below 256. Nothing for other texts.
std::optional<std::string> pickle_latin1_bytes(std::string_view utf8) {
  std::string bytes;
  for (std::size_t i = 0; i < utf8.size(); ++i) {
    const auto lead = static_cast<unsigned char>(utf8[i]);
    if (lead < 0x80) {
      bytes += utf8[i];
      continue;
    }
    if ((lead != 0xC2 && lead != 0xC3) || i + 1 == utf8.size()) return std::nullopt;
    const auto second = static_cast<unsigned char>(utf8[++i]);
    if ((second & 0xC0) != 0x80) return std::nullopt;
    bytes += static_cast<char>(static_cast<unsigned char>((lead & 0x03) << 6 | (second & 0x3F)));
  }
  return bytes;
}

template <typename Stored>
double pickle_element(const char* data, bool swapped) {
  std::array<char, sizeof(Stored)> bytes;
  std::copy_n(data, sizeof(Stored), bytes.begin());
  if (swapped) std::reverse(bytes.begin(), bytes.end());
  return static_cast<double>(std::bit_cast<Stored>(bytes));
}

struct PickleElement {
  const char* type;
  std::size_t size;
  double (*read)(const char* data, bool swapped);
};

const PickleElement* pickle_element_of(std::string_view type) {
  static constexpr PickleElement kElements[] = {
      {"f8", 8, pickle_element<double>},       {"f4", 4, pickle_element<float>},
      {"i8", 8, pickle_element<std::int64_t>}, {"u8", 8, pickle_element<std::uint64_t>},
      {"i4", 4, pickle_element<std::int32_t>}, {"u4", 4, pickle_element<std::uint32_t>},
      {"i2", 2, pickle_element<std::int16_t>}, {"u2", 2, pickle_element<std::uint16_t>},
      {"i1", 1, pickle_element<std::int8_t>},  {"u1", 1, pickle_element<std::uint8_t>},
      {"b1", 1, pickle_element<std::uint8_t>}};
  for (const PickleElement& element : kElements) {
    if (type == element.type) return &element;
  }
  return nullptr;
}

/// Whether a dtype is stored with the most significant byte first. Its state is (version, byte order, ...).
bool is_swapped_pickle_dtype(const PickleValue& dtype) {
  const auto& state = dtype.node()->items;
  return state.size() > 1 && state[1].text() == ">";
}

/// What functions of numpy would return, and the state of arrays and dtypes.
class NumpyPickleFunctions : public PickleFunctions {
 public:
  std::string_view advice() const override {
    return "which is not allowed; allowed are arrays of numpy, dicts, lists, texts and numbers";
  }
  std::size_t max_values() const override { return 16'000'000; }

  /// What numpy 1 and numpy 2 name differently gets one name.
  std::string find(const std::string& name) override {
    constexpr std::string_view kNewCore = "numpy._core.";
    const bool is_new = name.starts_with(kNewCore);
    const std::string old = is_new ? "numpy.core." + name.substr(kNewCore.size()) : name;
    constexpr const char* kAllowed[] = {kPickleArray,  kPickleDtype,      kPickleReconstruct,
                                        kPickleScalar, kPickleFromBuffer, kPickleEncode};
    return std::find(std::begin(kAllowed), std::end(kAllowed), old) != std::end(kAllowed) ? old : "";
  }

  std::optional<PickleValue> call(const std::string& function, Items arguments, Pickle& pickle) override {
    const auto is = [&](std::size_t i, PickleKind kind) { return i < arguments.size() && arguments[i].kind() == kind; };
    if (function == kPickleReconstruct && is(0, PickleKind::global) && arguments[0].node()->text == kPickleArray)
      return pickle.add(PickleKind::array);  // its state follows
    if (function == kPickleDtype && !arguments.empty() && !arguments[0].text().empty())
      return pickle.add(PickleKind::dtype, std::string(arguments[0].text().substr(0, 16)));
    if (function == kPickleFromBuffer && arguments.size() == 4 && is(0, PickleKind::bytes)) {
      const PickleValue fortran(arguments[3].text() == "F" ? 1 : 0);
      return pickle.add(PickleKind::array, "", {PickleValue(1), arguments[2], arguments[1], fortran, arguments[0]});
    }
    if (function == kPickleScalar && is(0, PickleKind::dtype) && is(1, PickleKind::bytes))
      return scalar(arguments[0], arguments[1].text(), pickle);
    if (function == kPickleEncode && is(0, PickleKind::text) && is(1, PickleKind::text))
      return encoded(arguments[0].text(), arguments[1].text(), pickle);
    return std::nullopt;
  }

  /// `numbers` checks the state when it is used, because opcodes that follow can change its parts.
  void set_state(const PickleValue& target, const PickleValue& state, Pickle& pickle) override {
    const bool is_array = target.kind() == PickleKind::array;
    if (!is_array && target.kind() != PickleKind::dtype)
      pickle.refuse("it sets the state of a {}, allowed are arrays of numpy", target.kind_name());
    if (state.kind() != PickleKind::list || state.items().size() > kPickleMaxAxes ||
        (is_array && state.items().size() != kPickleArrayParts))
      pickle.refuse("the state of an array of numpy has an unknown form");
    target.node()->items.assign(state.items().begin(), state.items().end());
  }

 private:
  static PickleValue scalar(const PickleValue& dtype, std::string_view data, const Pickle& pickle) {
    const PickleElement* element = pickle_element_of(dtype.node()->text);
    if (!element || data.size() != element->size)
      pickle.refuse("it holds a scalar of type {} with {} bytes", excerpt(dtype.node()->text), data.size());
    return PickleValue(element->read(data.data(), is_swapped_pickle_dtype(dtype)));
  }

  /// Protocols 0 to 2 write bytes as a text of Latin-1.
  PickleValue encoded(std::string_view text, std::string_view encoding, Pickle& pickle) {
    if (encoding != "latin1") pickle.refuse("it encodes a text as {}, allowed is latin1", excerpt(encoding));
    // Each text of a file is encoded once; the limit is for files that encode one text again and again.
    encoded_ += text.size();
    if (encoded_ > 2 * pickle.bytes.size()) pickle.refuse("it encodes more text than it holds");
    std::optional<std::string> bytes = pickle_latin1_bytes(text);
    if (!bytes) pickle.refuse("a text that stands for bytes holds other characters");
    return pickle.add(PickleKind::bytes, std::move(*bytes));
  }

  std::size_t encoded_ = 0;
};

/// Executes the opcodes. Values live on a stack; a mark is a position on the stack from which on values become the
/// items of a list.
class PickleMachine {
 public:
  PickleMachine(Pickle& pickle, PickleFunctions& functions) : pickle_(pickle), functions_(functions) {}

  void run() {
    for (;;) {
      const auto opcode = static_cast<unsigned char>(take(1)[0]);
      if (opcode == '.') break;
      const bool known = run_frame(opcode) || run_number(opcode) || run_text(opcode) || run_container(opcode) ||
                         run_stack(opcode) || run_memo(opcode) || run_global(opcode);
      if (known) continue;
      if (const char* reason = refused_pickle_opcode(opcode))
        refuse("it {}, {} (opcode 0x{:02x})", reason, functions_.advice(), opcode);
      refuse("found the unknown opcode 0x{:02x}", opcode);
    }
    pickle_.root = pop();
  }

 private:
  template <typename... Args>
  [[noreturn]] void refuse(fmt::format_string<Args...> format, Args&&... args) const {
    pickle_.refuse(format, std::forward<Args>(args)...);
  }

  std::string_view take(std::uint64_t count) {
    const std::size_t left = pickle_.bytes.size() - pickle_.position;
    if (count > left) refuse("{} bytes are needed, {} are left; is the file truncated?", count, left);
    const std::string_view taken = pickle_.bytes.substr(pickle_.position, as_size(count));
    pickle_.position += as_size(count);
    return taken;
  }

  std::string_view take_line() {
    const std::size_t end = pickle_.bytes.find('\n', pickle_.position);
    if (end == std::string_view::npos) refuse("a line has no end; is the file truncated?");
    const std::string_view line = take(end - pickle_.position);
    take(1);
    return line;
  }

  template <typename Number>
  Number take_little_endian() {
    Number value;
    std::memcpy(&value, take(sizeof(Number)).data(), sizeof(Number));
    return value;
  }

  double take_decimal(std::string_view line) const {
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (!line.empty() && line.back() == 'L') line.remove_suffix(1);
    const auto value = parse_number(line);
    if (!value) refuse("\"{}\" is no number", excerpt(line));
    return *value;
  }

  /// An integer of `size` bytes in two's complement, the least significant byte first.
  double take_long(std::uint64_t size) {
    if (size > 8) refuse("an integer has {} bytes, allowed are 8", size);
    const std::string_view bytes = take(size);
    const bool negative = !bytes.empty() && static_cast<signed char>(bytes.back()) < 0;
    std::array<char, 8> wide;
    wide.fill(static_cast<char>(negative ? -1 : 0));
    std::copy(bytes.begin(), bytes.end(), wide.begin());
    return static_cast<double>(std::bit_cast<std::int64_t>(wide));
  }

  void push(PickleValue value) {
    if (++pushed_ > functions_.max_values()) refuse("it holds more than {} values", functions_.max_values());
    if (pickle_.nodes.size() > kPickleMaxNodes) refuse("it holds more than {} lists and texts", kPickleMaxNodes);
    stack_.push_back(value);
  }

  void push_number(double number) { push(PickleValue(number)); }

  void push_node(PickleKind kind, std::string_view text) { push(pickle_.add(kind, std::string(text))); }

  void push_list(PickleKind kind, std::vector<PickleValue> items) {
    if (kind == PickleKind::dictionary && items.size() % 2 != 0) refuse("a dict has a key without a value");
    push(pickle_.add(kind, "", std::move(items)));
  }

  std::size_t bottom() const { return marks_.empty() ? 0 : marks_.back(); }

  PickleValue pop() {
    const PickleValue value = top();
    stack_.pop_back();
    return value;
  }

  PickleValue top() const {
    if (stack_.size() <= bottom()) refuse("a value is missing");
    return stack_.back();
  }

  std::vector<PickleValue> pop_values(std::size_t count) {
    if (stack_.size() - bottom() < count) refuse("{} values are needed for a tuple", count);
    const auto begin = stack_.end() - static_cast<std::ptrdiff_t>(count);
    std::vector<PickleValue> values(begin, stack_.end());
    stack_.erase(begin, stack_.end());
    return values;
  }

  std::vector<PickleValue> pop_to_mark() {
    if (marks_.empty()) refuse("a mark is missing");
    std::vector<PickleValue> values = pop_values(stack_.size() - marks_.back());
    marks_.pop_back();
    return values;
  }

  bool run_frame(unsigned char opcode) {
    if (opcode == 0x80) {
      const auto protocol = static_cast<unsigned char>(take(1)[0]);
      if (protocol > 5) refuse("it has protocol {}, supported are 0 to 5", static_cast<int>(protocol));
      return true;
    }
    if (opcode != 0x95) return false;
    take_little_endian<std::uint64_t>();  // the size of a frame, a hint for readers of streams
    return true;
  }

  bool run_number(unsigned char opcode) {
    switch (opcode) {
      case 'N':
        return push({}), true;
      case 'F':
      case 'I':
      case 'L':
        return push_number(take_decimal(take_line())), true;
      case 'J':
        return push_number(take_little_endian<std::int32_t>()), true;
      case 'K':
        return push_number(take_little_endian<std::uint8_t>()), true;
      case 'M':
        return push_number(take_little_endian<std::uint16_t>()), true;
      case 'G':
        return push_number(pickle_element<double>(take(8).data(), true)), true;
      case 0x88:
      case 0x89:
        return push_number(opcode == 0x88 ? 1 : 0), true;
      case 0x8a:
        return push_number(take_long(take_little_endian<std::uint8_t>())), true;
      case 0x8b:
        return push_number(take_long(take_little_endian<std::uint32_t>())), true;
      default:
        return false;
    }
  }

  bool run_text(unsigned char opcode) {
    switch (opcode) {
      case 'S':
      case 'V':
        return push_escaped(opcode == 'S'), true;
      case 'U':
      case 'C':
        return push_node(PickleKind::bytes, take(take_little_endian<std::uint8_t>())), true;
      case 'T':
      case 'B':
        return push_node(PickleKind::bytes, take(take_little_endian<std::uint32_t>())), true;
      case 0x8e:
      case 0x96:
        return push_node(PickleKind::bytes, take(take_little_endian<std::uint64_t>())), true;
      case 0x8c:
        return push_node(PickleKind::text, take(take_little_endian<std::uint8_t>())), true;
      case 'X':
        return push_node(PickleKind::text, take(take_little_endian<std::uint32_t>())), true;
      case 0x8d:
        return push_node(PickleKind::text, take(take_little_endian<std::uint64_t>())), true;
      default:
        return false;
    }
  }

  void push_escaped(bool is_literal) {
    const std::string_view line = take_line();
    std::optional<std::string> text = is_literal ? pickle_string_literal(line) : pickle_escaped_text(line);
    if (!text) refuse("the text \"{}\" is damaged", excerpt(line));
    push_node(is_literal ? PickleKind::bytes : PickleKind::text, *text);
  }

  bool run_container(unsigned char opcode) {
    switch (opcode) {
      case ']':
      case ')':
        return push_list(PickleKind::list, {}), true;
      case '}':
        return push_list(PickleKind::dictionary, {}), true;
      case 'l':
      case 't':
        return push_list(PickleKind::list, pop_to_mark()), true;
      case 'd':
        return push_list(PickleKind::dictionary, pop_to_mark()), true;
      case 0x85:
      case 0x86:
      case 0x87:
        return push_list(PickleKind::list, pop_values(opcode - as_size(0x84))), true;
      case 'a':
        return fill(pop_values(1), PickleKind::list), true;
      case 'e':
        return fill(pop_to_mark(), PickleKind::list), true;
      case 's':
        return fill(pop_values(2), PickleKind::dictionary), true;
      case 'u':
        return fill(pop_to_mark(), PickleKind::dictionary), true;
      default:
        return false;
    }
  }

  void fill(const std::vector<PickleValue>& values, PickleKind kind) {
    const PickleValue target = top();
    if (target.kind() != kind) refuse("items are added to a {}", target.kind_name());
    if (kind == PickleKind::dictionary && values.size() % 2 != 0) refuse("a dict has a key without a value");
    target.node()->items.insert(target.node()->items.end(), values.begin(), values.end());
  }

  bool run_stack(unsigned char opcode) {
    switch (opcode) {
      case '(':
        if (marks_.size() >= kPickleMaxMarks) refuse("it is nested more than {} deep", kPickleMaxMarks);
        marks_.push_back(stack_.size());
        return true;
      case '0':
        return pop(), true;
      case '1':
        return pop_to_mark(), true;
      case '2':
        return push(top()), true;
      default:
        return false;
    }
  }

  bool run_memo(unsigned char opcode) {
    switch (opcode) {
      case 'p':
        return store(take_index()), true;
      case 'q':
        return store(take_little_endian<std::uint8_t>()), true;
      case 'r':
        return store(take_little_endian<std::uint32_t>()), true;
      case 0x94:
        return store(memo_.size()), true;
      case 'g':
        return recall(take_index()), true;
      case 'h':
        return recall(take_little_endian<std::uint8_t>()), true;
      case 'j':
        return recall(take_little_endian<std::uint32_t>()), true;
      default:
        return false;
    }
  }

  std::uint64_t take_index() {
    const double index = take_decimal(take_line());
    if (!(index >= 0 && index < 4e9)) refuse("{} is no position in the memo", index);
    return static_cast<std::uint64_t>(index);
  }

  void store(std::uint64_t index) {
    if (memo_.size() >= kPickleMaxNodes) refuse("its memo holds more than {} values", kPickleMaxNodes);
    memo_[index] = top();
  }

  void recall(std::uint64_t index) {
    const auto found = memo_.find(index);
    if (found == memo_.end()) refuse("it uses the value {} of its memo, which it has not stored", index);
    push(found->second);
  }

  bool run_global(unsigned char opcode) {
    switch (opcode) {
      case 'c':
      case 'i': {
        const std::string_view module = take_line();
        push_global(module, take_line());
        if (opcode == 'i') refuse("it creates an object of {} (INST), {}", excerpt(module), functions_.advice());
        return true;
      }
      case 0x93: {
        const PickleValue name = pop(), module = pop();
        return push_global(module.text(), name.text()), true;
      }
      case 'R':
        return call(), true;
      case 'Q':
        return load_persistent(), true;
      case 'b': {
        const PickleValue state = pop(), target = top();
        return functions_.set_state(target, state, pickle_), true;
      }
      default:
        return false;
    }
  }

  void push_global(std::string_view module, std::string_view name) {
    // A long text of the memo could be named again and again.
    const bool is_short = module.size() + name.size() <= kPickleMaxName;
    const std::string dotted = fmt::format("{}.{}", module.substr(0, kPickleMaxName), name.substr(0, kPickleMaxName));
    const std::string found = is_short ? functions_.find(dotted) : "";
    if (found.empty()) refuse("it names {}, {}", excerpt(dotted), functions_.advice());
    push_node(PickleKind::global, found);
  }

  void call() {
    const PickleValue arguments = pop(), function = pop();
    if (function.kind() != PickleKind::global) refuse("it calls a {}", function.kind_name());
    const std::string& name = function.node()->text;
    if (arguments.kind() != PickleKind::list) refuse("it calls {} with a {}", excerpt(name), arguments.kind_name());
    const auto returned = functions_.call(name, arguments.items(), pickle_);
    if (!returned) refuse("it calls {} with arguments that are not known, {}", excerpt(name), functions_.advice());
    push(*returned);
  }

  void load_persistent() {
    const auto loaded = functions_.persistent_load(pop(), pickle_);
    if (!loaded) refuse("it names an object outside of the file (PERSID), {}", functions_.advice());
    push(*loaded);
  }

  Pickle& pickle_;
  PickleFunctions& functions_;
  std::size_t pushed_ = 0;
  std::vector<PickleValue> stack_;
  std::vector<std::size_t> marks_;
  std::unordered_map<std::uint64_t, PickleValue> memo_;
};

/// Where the item `i`, counted row by row, stands in an array of `count` items that is stored column by column.
std::size_t pickle_fortran_index(std::size_t i, std::size_t count, const std::vector<std::size_t>& shape) {
  std::size_t index = 0, stride = count;
  for (std::size_t axis = shape.size(); axis-- > 0;) {
    stride /= shape[axis];
    index += i % shape[axis] * stride;
    i /= shape[axis];
  }
  return index;
}

/// Collects the numbers of lists and arrays.
class PickleNumbers {
 public:
  PickleNumbers(const std::string& what, const FileLocation& where) : what_(what), where_(where) {}

  std::vector<double> of(const PickleValue& value) {
    add(value, 0);
    return std::move(found_);
  }

 private:
  [[noreturn]] void refuse(const std::string& fault) const { fail_at(where_, "reading a pickle: {} {}", what_, fault); }

  void add(const PickleValue& value, int depth) {
    // A list may hold itself, or one list many times.
    if (depth > kPickleMaxDepth || ++visited_ > 2 * kPickleMaxNumbers) refuse("is nested too deeply");
    switch (value.kind()) {
      case PickleKind::number:
        return add_number(value.number());
      case PickleKind::list:
        for (const PickleValue& item : value.items()) add(item, depth + 1);
        return;
      case PickleKind::array:
        return add_array(value, depth);
      default:
        refuse(fmt::format("must hold numbers, found a {}", value.kind_name()));
    }
  }

  void add_number(double number) {
    if (!std::isfinite(number)) refuse("must hold finite numbers");
    if (found_.size() >= kPickleMaxNumbers) refuse("holds too many numbers");
    found_.push_back(number);
  }

  void add_array(const PickleValue& array, int depth) {
    const auto shape = array.shape();
    if (!shape) refuse("is a damaged array");
    std::size_t count = 1;
    for (std::size_t axis : *shape) {
      if (axis > kPickleMaxNumbers) refuse(fmt::format("is an array with an axis of {} items", axis));
      count *= axis;
      if (count > kPickleMaxNumbers) refuse("is an array with too many numbers");
    }
    const PickleValue& dtype = array.node()->items[kPickleArrayDtype];
    const PickleValue& data = array.node()->items[kPickleArrayData];
    const std::string type = dtype.kind() == PickleKind::dtype ? dtype.node()->text : "";
    const bool of_objects = data.kind() == PickleKind::list;
    const PickleElement* element = pickle_element_of(type);
    if (!of_objects && !element) refuse(fmt::format("is an array of the type \"{}\", which holds no numbers", type));
    const std::string_view bytes = data.kind() == PickleKind::bytes ? data.text() : std::string_view();
    const std::size_t found = of_objects ? data.items().size() : bytes.size();
    const std::size_t expected = of_objects ? count : count * element->size;
    if (found != expected)
      refuse(fmt::format("is an array that needs {} {}, found {}", expected, of_objects ? "items" : "bytes", found));
    const bool fortran = array.node()->items[kPickleArrayFortran].number() != 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t at = fortran ? pickle_fortran_index(i, count, *shape) : i;
      if (of_objects)
        add(data.items()[at], depth + 1);
      else
        add_number(element->read(bytes.data() + at * element->size, is_swapped_pickle_dtype(dtype)));
    }
  }

  const std::string& what_;
  const FileLocation& where_;
  std::vector<double> found_;
  std::size_t visited_ = 0;
};

}  // namespace

const char* PickleValue::kind_name() const {
  constexpr const char* kNames[] = {"None", "number", "text",  "bytes",    "list",
                                    "dict", "array",  "dtype", "function", "object"};
  return kNames[static_cast<int>(kind_)];
}

std::string_view PickleValue::text() const {
  return kind_ == Kind::text || kind_ == Kind::bytes ? std::string_view(node_->text) : std::string_view();
}

std::span<const PickleValue> PickleValue::items() const {
  if (kind_ == Kind::list) return node_->items;
  const bool of_objects = kind_ == Kind::array && node_->items.size() == kPickleArrayParts &&
                          node_->items[kPickleArrayData].kind() == Kind::list;
  if (of_objects) return node_->items[kPickleArrayData].node()->items;
  return {};
}

std::optional<std::vector<std::size_t>> PickleValue::shape() const {
  if (kind_ != Kind::array || node_->items.size() != kPickleArrayParts) return std::nullopt;
  const PickleValue& axes = node_->items[kPickleArrayShape];
  if (axes.kind() != Kind::list || axes.items().size() > kPickleMaxAxes) return std::nullopt;
  std::vector<std::size_t> shape;
  for (const PickleValue& axis : axes.items()) {
    const double size = axis.number();
    if (axis.kind() != Kind::number || !(size >= 0 && size <= kPickleMaxAxis) || size != std::floor(size))
      return std::nullopt;
    shape.push_back(as_size(size));
  }
  return shape;
}

std::optional<PickleValue> PickleValue::find(std::string_view key) const {
  if (kind_ != Kind::dictionary) return std::nullopt;
  // A later value replaces an earlier one.
  for (std::size_t i = node_->items.size(); i >= 2; i -= 2) {
    const PickleValue& found = node_->items[i - 2];
    if ((found.kind() == Kind::text || found.kind() == Kind::bytes) && found.text() == key) return node_->items[i - 1];
  }
  return std::nullopt;
}

PickleValue Pickle::add(PickleKind kind, std::string text, std::vector<PickleValue> items) {
  return {kind, &nodes.emplace_back(PickleNode{std::move(text), std::move(items)})};
}

Pickle read_pickle(std::string_view bytes, const FileLocation& where, PickleFunctions& functions) {
  Pickle pickle{{}, {}, bytes, where, 0};
  PickleMachine(pickle, functions).run();
  return pickle;
}

Pickle read_pickle(std::string_view bytes, const FileLocation& where) {
  NumpyPickleFunctions functions;
  return read_pickle(bytes, where, functions);
}

PickleValue entry(const PickleValue& dictionary, std::string_view key, const std::string& what,
                  const FileLocation& where) {
  if (dictionary.kind() != PickleKind::dictionary)
    fail_at(where, "reading a pickle: {} must be a dict, found a {}", what, dictionary.kind_name());
  const auto value = dictionary.find(key);
  if (!value) fail_at(where, "reading a pickle: {} has no \"{}\"; is it another file?", what, key);
  return *value;
}

std::vector<double> numbers(const PickleValue& value, std::size_t count, const std::string& what,
                            const FileLocation& where) {
  std::vector<double> found = PickleNumbers(what, where).of(value);
  if (count != 0 && found.size() != count)
    fail_at(where, "reading a pickle: {} has {} numbers, expected {}", what, found.size(), count);
  return found;
}

}  // namespace doppel
