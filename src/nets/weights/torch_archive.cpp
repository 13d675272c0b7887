#include "doppel/nets/weights/torch_archive.h"

#include <minizip/unzip.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/excerpt.h"

namespace doppel {
namespace {

using torch::Tensor;

struct StorageType {
  const char* name;
  torch::ScalarType type;
};
constexpr std::array<StorageType, 10> kStorageTypes{{{"FloatStorage", torch::kFloat32},
                                                     {"DoubleStorage", torch::kFloat64},
                                                     {"HalfStorage", torch::kFloat16},
                                                     {"BFloat16Storage", torch::kBFloat16},
                                                     {"LongStorage", torch::kInt64},
                                                     {"IntStorage", torch::kInt32},
                                                     {"ShortStorage", torch::kInt16},
                                                     {"CharStorage", torch::kInt8},
                                                     {"ByteStorage", torch::kUInt8},
                                                     {"BoolStorage", torch::kBool}}};

/// Larger than any storage, small enough that products of two do not overflow 128 bits.
constexpr std::int64_t kHugeStorage = std::int64_t{1} << 48;
constexpr std::size_t kMaxParts = 200'000, kMaxPartNameLength = 500;

struct CloseZip {
  void operator()(void* archive) const { unzClose(archive); }
};

torch::ScalarType storage_type(const PickledTensor& found, const FileLocation& where) {
  for (const StorageType& known : kStorageTypes)
    if (found.storage == known.name) return known.type;
  fail_at(where, "tensor '{}' has elements of type '{}'; floating-point numbers and integers are supported",
          excerpt(found.name), excerpt(found.storage));
}

/// How far a tensor reaches in its storage, and how many elements it has.
struct Reach {
  std::int64_t extent = 0;  ///< from its first element to its last, both included
  std::int64_t elements = 1;
};

/// Nothing when a size is invalid.
std::optional<Reach> reach_of(const PickledTensor& tensor) {
  if (tensor.offset < 0 || tensor.offset > kHugeStorage) return std::nullopt;
  Reach reach;
  std::int64_t last = 0;
  for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
    const std::int64_t size = tensor.shape[i], stride = tensor.stride[i];
    if (size < 0 || stride < 0 || size > kHugeStorage || stride > kHugeStorage) return std::nullopt;
    const __int128 step = static_cast<__int128>(size - 1) * stride,
                   count = static_cast<__int128>(reach.elements) * size;
    if (step > kHugeStorage || count > kHugeStorage) return std::nullopt;
    reach.elements = static_cast<std::int64_t>(count);
    if (size > 0) last += static_cast<std::int64_t>(step);
  }
  reach.extent = reach.elements == 0 ? 0 : last + 1;
  return reach;
}

/// Whether the bytes end with the record that ends a zip archive, and its comment.
bool ends_as_zip(std::string_view bytes) {
  constexpr std::size_t kEndBytes = 22, kMaxCommentBytes = 65535;
  const std::size_t from = bytes.size() - std::min(bytes.size(), kEndBytes + kMaxCommentBytes);
  const std::size_t at = bytes.rfind("PK\x05\x06");
  if (at == std::string_view::npos || at < from || bytes.size() - at < kEndBytes) return false;
  const auto byte = [&](std::size_t i) { return as_size(static_cast<unsigned char>(bytes[at + i])); };
  return at + kEndBytes + (byte(20) | byte(21) << 8) == bytes.size();
}

}  // namespace

TorchArchive::TorchArchive(const std::filesystem::path& path, std::string bytes)
    : where_{path.string()}, bytes_(std::move(bytes)) {
  list_parts(path);
  const auto order = parts_.find("byteorder");
  if (order != parts_.end() && order->second != "little")
    fail_at(where_, "the numbers are not little-endian; save the file again on a little-endian machine");
}

void TorchArchive::list_parts(const std::filesystem::path& path) {
  const std::unique_ptr<void, CloseZip> archive(unzOpen64(path.c_str()));
  const auto refuse = [&]() {
    fail_at(where_, "not a file that torch.save of PyTorch 1.6 or later wrote (a zip archive), or damaged");
  };
  if (!archive || !ends_as_zip(bytes_)) refuse();
  int state = unzGoToFirstFile(archive.get());
  for (; state == UNZ_OK; state = unzGoToNextFile(archive.get())) {
    unz_file_info64 info{};
    std::array<char, kMaxPartNameLength + 1> name{};
    int method = 0, level = 0;
    if (unzGetCurrentFileInfo64(archive.get(), &info, name.data(), name.size() - 1, nullptr, 0, nullptr, 0) != UNZ_OK ||
        unzOpenCurrentFile2(archive.get(), &method, &level, 1) != UNZ_OK || parts_.size() >= kMaxParts)
      refuse();
    const std::uint64_t begin = unzGetCurrentFileZStreamPos64(archive.get());
    unzCloseCurrentFile(archive.get());
    const std::string whole = name.data(), inner = whole.substr(whole.find('/') + 1);
    if (info.compression_method != 0 || info.compressed_size != info.uncompressed_size)
      fail_at(where_,
              "a part of the archive is compressed; torch.save does not compress, so save the file with it again");
    if (begin > bytes_.size() || info.uncompressed_size > bytes_.size() - begin) refuse();
    const std::string_view content = std::string_view(bytes_).substr(as_size(begin), as_size(info.uncompressed_size));
    if (crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size()) != info.crc)
      fail_at(where_, "the archive's entry '{}' is missing or damaged", excerpt(inner));
    parts_[inner] = content;
  }
  if (state != UNZ_END_OF_LIST_OF_FILE || parts_.empty()) refuse();
}

std::string_view TorchArchive::part(const std::string& name) const {
  const auto found = parts_.find(name);
  if (found == parts_.end()) fail_at(where_, "the archive's entry '{}' is missing or damaged", excerpt(name));
  return found->second;
}

/// Parts of a damaged archive may lie on each other, so that the sum of what is copied is limited too.
const Tensor& TorchArchive::storage(const std::string& key) {
  Tensor& loaded = storages_[key];
  if (loaded.defined()) return loaded;
  const std::string_view content = part("data/" + key);
  loaded_ += content.size();
  if (loaded_ > bytes_.size()) fail_at(where_, "the storages of the archive take more bytes than it has");
  loaded = torch::empty({static_cast<std::int64_t>(content.size())}, torch::kUInt8);
  if (!content.empty()) std::memcpy(loaded.data_ptr(), content.data(), content.size());
  return loaded;
}

Tensor TorchArchive::tensor(const PickledTensor& found) {
  const torch::ScalarType type = storage_type(found, where_);
  const Tensor bytes = storage(found.key);
  const auto numbers = bytes.numel() / static_cast<std::int64_t>(c10::elementSize(type));
  const std::optional<Reach> reach = reach_of(found);
  if (!reach || found.offset + reach->extent > numbers || reach->elements > numbers)
    fail_at(where_, "tensor '{}' of shape [{}] reaches beyond its {} numbers", excerpt(found.name),
            fmt::join(found.shape, ","), numbers);
  const Tensor typed = at::from_blob(
      bytes.data_ptr(), {numbers}, [bytes](void*) {}, torch::TensorOptions().dtype(type));
  return typed.as_strided(found.shape, found.stride, found.offset);
}

}  // namespace doppel
