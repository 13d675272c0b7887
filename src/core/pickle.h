#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

struct PickleNode;

/// A value of a pickle. Cheap to copy, and valid as long as its Pickle lives. Values may share parts and may even hold
/// themselves, so that a reader must limit its depth; `numbers` does.
class PickleValue {
 public:
  enum class Kind : std::uint8_t {
    none,
    number,      ///< also booleans and the scalars of numpy
    text,        ///< str
    bytes,       ///< bytes, bytearray
    list,        ///< list, tuple
    dictionary,  ///< dict
    array,       ///< numpy.ndarray
    dtype,       ///< numpy.dtype
    global,      ///< a function or class that was named, but not called
    object,      ///< what a function of other PickleFunctions than those of numpy returned
  };

  PickleValue() : number_(0) {}
  explicit PickleValue(double number) : kind_(Kind::number), number_(number) {}
  PickleValue(Kind kind, PickleNode* node) : kind_(kind), node_(node) {}

  Kind kind() const { return kind_; }
  const char* kind_name() const;
  /// 0 for the other kinds.
  double number() const { return kind_ == Kind::number ? number_ : 0; }
  /// The content of a text or of bytes; empty for the other kinds.
  std::string_view text() const;
  /// The items of a list or of an array of objects; empty for the other kinds.
  std::span<const PickleValue> items() const;
  /// The axes of an array; nothing for the other kinds and when the state of the array is damaged.
  std::optional<std::vector<std::size_t>> shape() const;
  /// The value of a key that is a text. Nothing if there is none, and for the other kinds.
  std::optional<PickleValue> find(std::string_view key) const;
  /// Only for the kinds from `text` on.
  PickleNode* node() const { return node_; }

 private:
  Kind kind_ = Kind::none;
  union {  // a file may hold millions of values
    double number_;
    PickleNode* node_;
  };
};

/// The part of a value that does not fit into a PickleValue.
struct PickleNode {
  std::string text;  ///< of a text, of bytes; type of a dtype ("f8"); dotted name of a global; type of an object
  std::vector<PickleValue> items;  ///< of a list; key, value, key, ... of a dict; state of an array, dtype or object
};

/// The content of a Python pickle.
struct Pickle {
  PickleValue root;
  std::deque<PickleNode> nodes;  ///< owns the nodes of all values

  // While the pickle is read:
  std::string_view bytes;
  FileLocation where;
  std::size_t position = 0;  ///< of the next opcode

  PickleValue add(PickleValue::Kind kind, std::string text = {}, std::vector<PickleValue> items = {});
  /// @throws FileError with the position
  template <typename... Args>
  [[noreturn]] void refuse(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where, "reading a pickle: it cannot be read at byte {}: {}", position,
            fmt::format(format, std::forward<Args>(args)...));
  }
};

/// What a pickle may name and call. A pickle is a program that may name and call any function of Python. The reader
/// calls nothing: it asks for what a function would return. An answer must not copy more than a bounded part of the
/// arguments, because a pickle may name one argument a million times.
class PickleFunctions {
 public:
  using Items = std::span<const PickleValue>;

  virtual ~PickleFunctions() = default;

  /// The end of a message that refuses something, after a comma.
  virtual std::string_view advice() const = 0;
  virtual std::size_t max_values() const = 0;
  /// The name of a function or class that `call` uses; empty if a pickle may not name it. @param name "module.name"
  virtual std::string find(const std::string& name) = 0;
  /// Nothing if the call is not allowed.
  virtual std::optional<PickleValue> call(const std::string& function, Items arguments, Pickle& pickle) = 0;
  virtual void set_state(const PickleValue& target, const PickleValue& state, Pickle& pickle) = 0;
  /// The object outside of the pickle that an ID names (persistent_load of Python). Nothing if that is not allowed.
  virtual std::optional<PickleValue> persistent_load(const PickleValue& /*id*/, Pickle& /*pickle*/) { return {}; }
};

/// Reads a pickle of protocol 0 to 5 that holds dicts, lists, tuples, texts, bytes, numbers and what `functions`
/// return. The memory it takes is limited by the size of the file and by constants, and nothing recurses.
/// @param bytes the pickle, from its first opcode on @param where the file, for messages
/// @throws FileError that names what is not allowed, or the byte where the pickle is damaged
Pickle read_pickle(std::string_view bytes, const FileLocation& where, PickleFunctions& functions);

/// Reads a pickle with numpy arrays. Allowed are numpy.ndarray, numpy.dtype, _reconstruct and scalar of
/// numpy.core.multiarray (numpy._core.multiarray), _frombuffer of numpy.core.numeric and _codecs.encode.
Pickle read_pickle(std::string_view bytes, const FileLocation& where);

/// The value of a key of a dict. @throws FileError that names `what` and the key, when it is missing
PickleValue entry(const PickleValue& dictionary, std::string_view key, const std::string& what,
                  const FileLocation& where);
/// The numbers of a number, a list of numbers (nested or not) or an array, row by row. @throws FileError that names
/// `what`, when there are not `count` of them (0: any number), or one is not finite
std::vector<double> numbers(const PickleValue& value, std::size_t count, const std::string& what,
                            const FileLocation& where);

}  // namespace doppel
