#pragma once

/// What the calibration formats in XML share: a parsed file and the values of its elements, with file:line in every
/// error.

#include <filesystem>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {

/// A parsed XML file in UTF-8 or UTF-16, of at most 64 MB.
class XmlFile {
 public:
  /// @throws FileError when the file cannot be read, is no valid XML, or has not one root element
  explicit XmlFile(const std::filesystem::path& path);

  pugi::xml_node root() const { return document_.document_element(); }
  FileLocation where(const pugi::xml_node& node) const;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::string text_;  ///< UTF-8
  pugi::xml_document document_;
};

/// An element with its name in messages ("camera 7"). A value is an attribute or, without one, the text of a child
/// element, because some programs write the same key in both ways.
class XmlPart {
 public:
  XmlPart(const XmlFile& file, const pugi::xml_node& node, std::string what);

  const pugi::xml_node& node() const { return node_; }
  const std::string& what() const { return what_; }
  FileLocation where() const { return file_->where(node_); }

  bool has(const char* key) const;
  /// The value without outer blanks. @throws FileError that names `key` when it is missing
  std::string text(const char* key) const;
  std::string text_or(const char* key, const std::string& otherwise) const;
  /// @throws FileError that names `key` when it is missing or no finite number
  double number(const char* key) const;
  double number_or(const char* key, double otherwise) const;
  /// Numbers between blanks. @param count 0: any number of them
  std::vector<double> numbers(const char* key, std::size_t count) const;
  /// As `numbers`, for a value that begins with a word ("ViconRadial2 951 603 0 0 0"). The word may be missing.
  std::vector<double> numbers_after_word(const char* key, std::size_t count) const;
  /// A side of an image. @throws FileError when it is no integer of 1 to 65536
  int pixels(const char* key) const;
  /// A child element, with the same name in messages. @throws FileError when it is missing
  XmlPart child(const char* name) const;
  bool has_child(const char* name) const { return static_cast<bool>(node_.child(name)); }

  template <typename... Args>
  [[noreturn]] void fail_here(fmt::format_string<Args...> format, Args&&... args) const {
    fail_at(where(), "reading a camera calibration: {}: {}", what_, fmt::format(format, std::forward<Args>(args)...));
  }

 private:
  std::vector<double> numbers_of(const char* key, std::string_view value, std::size_t count) const;

  const XmlFile* file_;
  pugi::xml_node node_;
  std::string what_;
};

/// The beginning of a file as text: files in UTF-16 without their zero bytes.
std::string readable_head(const CalibrationSource& source);
/// The name of the first element of an XML text, of which only the beginning may be there; "" when it is no XML.
std::string_view root_element(std::string_view head);

}  // namespace doppel
