#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/masks/mask.h"

namespace doppel {

/// A key-value file (LMDB) with string keys. One process writes, in transactions; any number of threads read.
/// Killing a writer at any moment leaves the last transaction that finished.
class Store {
 public:
  enum class Mode { read, write };

  /// Opens a store. Mode `write` creates a missing store.
  /// @throws FileError when the folder contains no store, or a truncated or damaged one. The page tree is checked
  /// first, because LMDB does not check it.
  Store(const std::filesystem::path& folder, Mode mode);
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;

  std::optional<std::string> get(const std::string& key) const;
  /// Only the first `bytes` bytes of a value (fewer when the value is shorter).
  std::optional<std::string> get_head(const std::string& key, std::size_t bytes) const;
  bool has(const std::string& key) const { return get_head(key, 0).has_value(); }
  /// All keys that begin with `prefix`, ascending.
  std::vector<std::string> keys(const std::string& prefix) const;

  /// Writes all items in one transaction, and flushes to disk.
  void put(const std::vector<std::pair<std::string, std::string>>& items);

  const std::filesystem::path& folder() const;

  /// Whether `folder` contains a store.
  static bool exists(const std::filesystem::path& folder);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Version of the formats below. A store of another version must be prepared again.
inline constexpr int kStoreVersion = 1;

/// One prepared view: the value that the store holds under `record_key`.
struct FrameRecord {
  int width = 0, height = 0;  ///< of the full image
  CropBox box;                ///< empty when the person is not visible
  MaskFacts facts;
  int mask_size = 0, image_size = 0;  ///< sides of the two crops in pixels
  std::string full_mask;              ///< PNG, 1 bit
  std::string crop_mask;              ///< PNG, 1 bit, mask_size squared; empty when the box is
  std::string crop_image;             ///< JPEG or PNG, image_size squared; empty when the box is
};

/// "<sequence>/<camera>/<frame>", ordered by frame.
std::string record_key(const std::string& sequence, const std::string& camera, long frame);
std::string encode_record(const FrameRecord& record);
/// @param what name of the record, for messages
/// @throws Error when the bytes are not a record: magic number, inconsistent sizes, checksum
FrameRecord decode_record(const std::string& bytes, const std::string& what);
/// Decodes only the numbers of a record, from its first `kRecordHeadBytes` bytes.
inline constexpr std::size_t kRecordHeadBytes = 72;
FrameRecord decode_record_head(const std::string& bytes, const std::string& what);

/// "keypoints/<sequence>/<camera>/<frame>": the keypoints of one view.
std::string keypoints_key(const std::string& sequence, const std::string& camera, long frame);
std::string encode_keypoints(const std::vector<Keypoint>& keypoints);
/// @throws Error when the bytes are not the keypoints of `count` landmarks: length, checksum, not finite
std::vector<Keypoint> decode_keypoints(const std::string& bytes, std::size_t count, const std::string& what);

/// A mask as a 1-bit PNG, and back. @throws Error when the bytes are not an image of the expected size
std::string encode_mask(const cv::Mat& mask);
cv::Mat decode_mask(const std::string& png, cv::Size expected, const std::string& what);

}  // namespace doppel
