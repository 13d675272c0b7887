#include "doppel/io/scene/fbx_text.h"

#include <charconv>
#include <cstdlib>
#include <cstring>

#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr int kMaxTextDepth = 64;

/// A recursive descent over `Name: value, value { ... }`.
class FbxText {
 public:
  FbxText(const std::filesystem::path& path, const std::string& text) : path_(path), text_(text) {}

  FbxRecord read() {
    FbxRecord root;
    while (skip_blank(), at_ < text_.size()) root.children.push_back(read_record(0));
    if (root.children.empty()) fail_here("the file holds no FBX records");
    const FbxRecord* header = root.child("FBXHeaderExtension");
    const FbxRecord* version = header ? header->child("FBXVersion") : nullptr;
    if (!version || !(version->number(0) >= 7000))
      fail_here("is FBX version {}; version 7 is read. Export it again as FBX 7.4 (2014)",
                version ? version->number(0) / 1000 : 0.0);
    return root;
  }

 private:
  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at({path_.string(), line_}, format, std::forward<Args>(args)...);
  }
  void step() {
    if (text_[at_++] == '\n') ++line_;
  }
  void skip_blank() {
    while (at_ < text_.size()) {
      if (text_[at_] == ';') {
        while (at_ < text_.size() && text_[at_] != '\n') step();
      } else if (static_cast<unsigned char>(text_[at_]) <= ' ') {
        step();
      } else {
        return;
      }
    }
  }
  /// Blanks of the same line.
  void skip_spaces() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\r')) step();
  }
  char here() const { return at_ < text_.size() ? text_[at_] : '\0'; }

  FbxRecord read_record(int depth) {
    if (depth > kMaxTextDepth) fail_here("records are nested more than {} deep", kMaxTextDepth);
    FbxRecord record;
    while (at_ < text_.size() && text_[at_] != ':' && text_[at_] != '\n' && text_[at_] != '{') {
      record.name += text_[at_];
      step();
    }
    if (here() != ':') fail_here("expected 'Name: values', found '{}'", record.name.substr(0, 60));
    step();
    read_values(record);
    skip_spaces();
    if (here() == '{') read_block(record, depth);
    return record;
  }

  void read_values(FbxRecord& record) {
    for (skip_spaces(); here() != '\n' && here() != '{' && here() != '}' && here() != '\0'; skip_spaces()) {
      if (here() == ';') return;
      if (here() == ',') {
        step();
        skip_blank();
        continue;
      }
      if (here() == '*') return read_array(record);
      record.values.push_back(here() == '"' ? FbxValue(read_quoted()) : read_word());
    }
  }

  std::string read_quoted() {
    std::string text;
    for (step(); here() != '"'; step()) {
      if (at_ >= text_.size()) fail_here("the file is truncated: a text has no end");
      text += text_[at_];
    }
    step();
    return text;
  }

  FbxValue read_word() {
    const std::size_t start = at_;
    while (at_ < text_.size() && !std::strchr(",{};\n\r\t ", text_[at_])) step();
    const std::string word = text_.substr(start, at_ - start);
    if (word.empty()) fail_here("expected a value, found '{}'", std::string(1, here()));
    std::int64_t whole = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), whole);
    if (error == std::errc() && end == word.data() + word.size()) return whole;
    char* stop = nullptr;
    const double number = std::strtod(word.c_str(), &stop);
    if (stop == word.c_str() + word.size()) return number;
    return word;
  }

  /// `*N { a: 1,2,3 }`
  void read_array(FbxRecord& record) {
    while (here() != '{' && here() != '\0') step();
    if (here() == '\0') fail_here("the file is truncated in an array");
    step();
    skip_blank();
    if (here() == 'a') step();
    skip_blank();
    if (here() == ':') step();
    std::vector<double> reals;
    std::vector<std::int64_t> wholes;
    bool whole = true;
    for (skip_blank(); here() != '}'; skip_blank()) {
      if (here() == '\0') fail_here("the file is truncated in an array");
      if (here() == ',') {
        step();
        continue;
      }
      const FbxValue value = read_word();
      if (std::holds_alternative<std::string>(value))
        fail_here("'{}' in an array is not a number", std::get<std::string>(value).substr(0, 40));
      const auto* integer = std::get_if<std::int64_t>(&value);
      whole = whole && integer;
      if (integer) wholes.push_back(*integer);
      reals.push_back(integer ? static_cast<double>(*integer) : std::get<double>(value));
    }
    step();
    if (whole)
      record.values.push_back(std::move(wholes));
    else
      record.values.push_back(std::move(reals));
  }

  void read_block(FbxRecord& record, int depth) {
    step();
    for (skip_blank(); here() != '}'; skip_blank()) {
      if (here() == '\0') fail_here("the file is truncated: the record '{}' has no end", record.name.substr(0, 60));
      record.children.push_back(read_record(depth + 1));
    }
    step();
  }

  const std::filesystem::path& path_;
  const std::string& text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

FbxRecord read_fbx_text(const std::filesystem::path& path, const std::string& text) {
  return FbxText(path, text).read();
}

}  // namespace doppel
