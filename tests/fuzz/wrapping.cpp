#include "fuzz/wrapping.h"

#include <minizip/unzip.h>

#include <cstdint>
#include <cstring>
#include <memory>

#include "doppel/detect/networks/onnx_message.h"
#include "fuzz/fuzz_target.h"
#include "io/motion_import/motion_writers.h"
#include "support/number_bytes.h"
#include "support/temporary_folder.h"

namespace doppel::fuzz {

using support::number_bytes;

namespace {

constexpr std::size_t kMaxUnpacked = 1 << 20;  ///< bytes of a file of an archive; the mutator needs no larger ones
constexpr int kMaxMessages = 8;                ///< that lie in each other

/// An unsigned integer of `count` bytes, the lowest first. @return nothing behind the end
std::optional<std::uint64_t> number_at(std::string_view bytes, std::size_t at, std::size_t count) {
  if (bytes.size() < count || at > bytes.size() - count) return std::nullopt;
  std::uint64_t value = 0;
  for (std::size_t i = count; i > 0; --i) value = value << 8 | static_cast<unsigned char>(bytes[at + i - 1]);
  return value;
}

/// Appends name and content of the archive's current file. @return its method, or -1 for one that cannot be read
int take_current_file(unzFile archive, std::vector<std::string>& parts) {
  unz_file_info info{};
  char name[256];
  if (unzGetCurrentFileInfo(archive, &info, name, sizeof name, nullptr, 0, nullptr, 0) != UNZ_OK ||
      info.size_filename >= sizeof name || info.uncompressed_size > kMaxUnpacked ||
      unzOpenCurrentFile(archive) != UNZ_OK)
    return -1;
  std::string content(info.uncompressed_size, '\0');
  const int read = unzReadCurrentFile(archive, content.data(), static_cast<unsigned>(content.size()));
  unzCloseCurrentFile(archive);
  if (read != static_cast<int>(content.size())) return -1;
  parts.insert(parts.end(), {name, content});
  return static_cast<int>(info.compression_method);
}

std::string zip_of(const std::vector<std::string>& parts, bool deflated) {
  support::NpzWriter writer(deflated);
  for (std::size_t i = 0; i + 1 < parts.size(); i += 2) writer.add_bytes(parts[i].substr(0, 255), parts[i + 1]);
  return writer.bytes();
}

/// A field of a message: one whose bytes are a message has that one's fields, another one with bytes is a part.
struct FieldTree {
  int id = 0;
  std::string whole;
  std::optional<std::size_t> part;
  std::vector<FieldTree> fields;
};

/// @throws onnx::NoMessage
std::vector<FieldTree> field_trees(std::string_view message, int depth, std::vector<std::string>& parts) {
  std::vector<FieldTree> trees;
  for (const onnx::Field& field : onnx::fields_of(message)) {
    FieldTree tree{field.id, std::string(field.whole), std::nullopt, {}};
    if (field.has_bytes) {
      const std::size_t num_parts = parts.size();
      try {
        if (depth < kMaxMessages) tree.fields = field_trees(field.bytes, depth + 1, parts);
      } catch (const onnx::NoMessage&) {
        parts.resize(num_parts);
      }
      if (tree.fields.empty()) {
        tree.part = parts.size();
        parts.emplace_back(field.bytes);
      }
    }
    trees.push_back(std::move(tree));
  }
  return trees;
}

std::string message_of(const std::vector<FieldTree>& trees, const std::vector<std::string>& parts) {
  std::string message;
  for (const FieldTree& tree : trees) {
    if (tree.part)
      onnx::append_bytes(message, tree.id, parts[*tree.part]);
    else if (!tree.fields.empty())
      onnx::append_bytes(message, tree.id, message_of(tree.fields, parts));
    else
      message += tree.whole;
  }
  return message;
}

}  // namespace

std::optional<Unwrapped> unwrap_zip(std::string_view bytes) {
  static const support::TemporaryFolder folder;
  const std::unique_ptr<void, int (*)(unzFile)> archive(unzOpen(written(bytes, folder.path(), "a.zip").c_str()),
                                                        unzClose);
  if (!archive) return std::nullopt;
  Unwrapped file;
  bool deflated = false;
  for (int found = unzGoToFirstFile(archive.get()); found == UNZ_OK; found = unzGoToNextFile(archive.get())) {
    const int method = take_current_file(archive.get(), file.parts);
    if (method < 0) return std::nullopt;
    deflated = deflated || method == Z_DEFLATED;
  }
  if (file.parts.empty()) return std::nullopt;
  file.wrap = [deflated](const std::vector<std::string>& parts) { return zip_of(parts, deflated); };
  return file;
}

std::optional<Unwrapped> unwrap_glb(std::string_view bytes) {
  constexpr std::size_t kHeader = 12, kChunkHeader = 8;
  if (!bytes.starts_with("glTF")) return std::nullopt;
  Unwrapped file;
  std::vector<std::string> types;
  for (std::size_t at = kHeader; at < bytes.size();) {
    const std::optional<std::uint64_t> size = number_at(bytes, at, 4);
    if (!size || bytes.size() < at + kChunkHeader || *size > bytes.size() - at - kChunkHeader) return std::nullopt;
    types.emplace_back(bytes.substr(at + 4, 4));
    file.parts.emplace_back(bytes.substr(at + kChunkHeader, *size));
    at += kChunkHeader + *size;
  }
  if (file.parts.empty()) return std::nullopt;
  file.wrap = [types](const std::vector<std::string>& parts) {
    std::string chunks;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const std::string padding((4 - parts[i].size() % 4) % 4, i == 0 ? ' ' : '\0');
      chunks += number_bytes(parts[i].size() + padding.size(), 4, false) + types[i] + parts[i] + padding;
    }
    return "glTF" + number_bytes(2, 4, false) + number_bytes(kHeader + chunks.size(), 4, false) + chunks;
  };
  return file;
}

std::optional<Unwrapped> unwrap_safetensors(std::string_view bytes) {
  constexpr std::size_t kLength = 8;
  const auto size = number_at(bytes, 0, kLength);
  if (!size || *size > bytes.size() - kLength) return std::nullopt;
  return Unwrapped{{std::string(bytes.substr(kLength, *size)), std::string(bytes.substr(kLength + *size))},
                   [](const std::vector<std::string>& parts) {
                     return number_bytes(parts[0].size(), kLength, false) + parts[0] + parts[1];
                   }};
}

std::optional<Unwrapped> unwrap_protobuf(std::string_view bytes) {
  Unwrapped file;
  std::vector<FieldTree> trees;
  try {
    trees = field_trees(bytes, 0, file.parts);
  } catch (const onnx::NoMessage&) {
  }
  if (file.parts.empty()) return std::nullopt;
  file.wrap = [trees](const std::vector<std::string>& parts) { return message_of(trees, parts); };
  return file;
}

}  // namespace doppel::fuzz
