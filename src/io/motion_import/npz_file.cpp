#include "doppel/io/motion_import/npz_file.h"

#include <fmt/ranges.h>
#include <zlib.h>

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

// APPNOTE.TXT of PKWARE: signatures, and the lengths of the fixed parts.
constexpr std::size_t kEndMark = 0x06054b50, kEndLength = 22;
constexpr std::size_t kDirectoryMark = 0x02014b50, kDirectoryLength = 46;
constexpr std::size_t kLocalMark = 0x04034b50, kLocalLength = 30;
constexpr std::size_t kMaxCommentBytes = 65535;
constexpr int kEncrypted = 1, kStored = 0, kDeflated = 8;
constexpr std::size_t kMaxUnpackedBytes = std::size_t{1} << 29;
/// Deflate cannot pack better than this.
constexpr std::size_t kBestRatio = 1032;

}  // namespace

NpzFile::NpzFile(const std::filesystem::path& path) : where_{path.string()} {
  bytes_ = read_file(path, (std::uintmax_t{1} << 32) - 1);
  read_directory();
}

std::vector<std::string> NpzFile::names() const {
  std::vector<std::string> result;
  for (const auto& [name, entry] : entries_) result.push_back(name);
  return result;
}

/// A little-endian number of up to 4 bytes.
std::size_t NpzFile::number(std::size_t at, std::size_t bytes) const {
  if (at > bytes_.size() || bytes > bytes_.size() - at)
    fail_at(where_, "reading the .npz file: it ends at byte {}, inside of an entry; it is truncated", bytes_.size());
  std::size_t value = 0;
  for (std::size_t i = bytes; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes_[at + i]);
  return value;
}

void NpzFile::read_directory() {
  if (bytes_.size() < 4 || bytes_.compare(0, 2, "PK") != 0)
    fail_at(where_, "is no .npz file: it does not begin with PK, as a zip archive does");
  // The record of the end is the last with its mark whose comment reaches the end of the file.
  std::size_t end = std::string::npos;
  const std::size_t last = bytes_.size() < kEndLength ? 0 : bytes_.size() - kEndLength;
  for (std::size_t back = 0; back <= std::min(last, kMaxCommentBytes) && end == std::string::npos; ++back)
    if (number(last - back, 4) == kEndMark && number(last - back + 20, 2) == back) end = last - back;
  if (end == std::string::npos)
    fail_at(where_, "reading the .npz file: its directory, which stands at the end, is missing; the file is truncated");
  if (number(end + 4, 2) != 0 || number(end + 16, 4) == 0xffffffff)
    fail_at(where_, "reading the .npz file: archives in several volumes or above 4 GiB are not read");
  std::size_t at = number(end + 16, 4);
  for (std::size_t i = 0; i < number(end + 10, 2); ++i) {
    if (number(at, 4) != kDirectoryMark)
      fail_at(where_, "reading the .npz file: entry {} of its directory is damaged", i + 1);
    const std::size_t name_length = number(at + 28, 2);
    number(at + kDirectoryLength, 0);
    if (name_length > bytes_.size() - at - kDirectoryLength) number(bytes_.size(), 1);
    std::string name = bytes_.substr(at + kDirectoryLength, name_length);
    if (name.ends_with(".npy")) entries_[name.substr(0, name.size() - 4)] = read_entry(at);
    at += kDirectoryLength + name_length + number(at + 30, 2) + number(at + 32, 2);
  }
}

NpzFile::Entry NpzFile::read_entry(std::size_t at) const {
  Entry entry;
  entry.flags = static_cast<int>(number(at + 8, 2));
  entry.method = static_cast<int>(number(at + 10, 2));
  entry.crc = number(at + 16, 4);
  entry.packed = number(at + 20, 4);
  entry.unpacked = number(at + 24, 4);
  entry.begin = number(at + 42, 4);
  return entry;
}

std::string_view NpzFile::packed_bytes(const Entry& entry) const {
  if (number(entry.begin, 4) != kLocalMark)
    fail_at(where_, "reading the .npz file: no entry begins at byte {}; the file is damaged", entry.begin);
  const std::size_t begin = entry.begin + kLocalLength + number(entry.begin + 26, 2) + number(entry.begin + 28, 2);
  number(begin, 0);
  if (entry.packed > bytes_.size() - begin) number(bytes_.size(), 1);
  return std::string_view(bytes_).substr(begin, entry.packed);
}

std::string NpzFile::unpack(const Entry& entry, const FileLocation& where) const {
  const std::string_view packed = packed_bytes(entry);
  if (entry.flags & kEncrypted) fail_at(where, "is encrypted; save it without a password");
  if (entry.method != kStored && entry.method != kDeflated)
    fail_at(where, "is packed by method {}; allowed are 0 (stored) and 8 (deflated), as NumPy writes", entry.method);
  // Checked before memory is taken: a small file cannot claim a large array.
  const std::size_t most = entry.method == kStored ? packed.size() : kBestRatio * packed.size() + 64;
  if (entry.unpacked > kMaxUnpackedBytes || entry.unpacked > most)
    fail_at(where, "claims {} bytes unpacked from {}; at most {} are read", entry.unpacked, packed.size(),
            std::min(kMaxUnpackedBytes, most));
  std::string bytes(entry.unpacked, '\0');
  std::size_t written = 0;
  if (entry.method == kStored) {
    bytes.assign(packed.substr(0, entry.unpacked));
    written = entry.packed;
  } else {
    z_stream stream{};
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = static_cast<uInt>(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
    stream.avail_out = static_cast<uInt>(bytes.size());
    const bool started = inflateInit2(&stream, -MAX_WBITS) == Z_OK;  // a raw stream, without zlib's own header
    const bool ended = started && inflate(&stream, Z_FINISH) == Z_STREAM_END;
    written = ended ? stream.total_out : 0;
    if (started) inflateEnd(&stream);
  }
  if (written != entry.unpacked ||
      crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())) != entry.crc)
    fail_at(where, "is damaged: what is packed in it is not what its directory says");
  return bytes;
}

NpyArray NpzFile::read(const std::string& name) const {
  const auto entry = entries_.find(name);
  if (entry == entries_.end()) fail_at(where_, "has no array '{}'; it has {}", name, fmt::join(names(), ", "));
  const FileLocation where{where_.file + ": " + name + ".npy"};
  return parse_npy(unpack(entry->second, where), where);
}

}  // namespace doppel
