#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/capture/keypoints.h"
#include "doppel/capture/mask.h"

namespace doppel {

/// A key-value file (LMDB) with string keys. One process writes, in transactions; any number of threads read.
/// Killing a writer at any moment leaves the last transaction that finished.
class Store {
 public:
  enum class Mode { read, write };

  /// Opens a store; for writing it is made when missing.
  /// @throws FileError when the folder holds no store, a truncated or a damaged one. The tree of pages is checked
  ///         first, since LMDB itself trusts it blindly.
  Store(const std::filesystem::path& folder, Mode mode);
  ~Store();
  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;

  std::optional<std::string> get(const std::string& key) const;
  /// Only the first `bytes` bytes of a value (less when it is shorter).
  std::optional<std::string> get_head(const std::string& key, std::size_t bytes) const;
  bool has(const std::string& key) const { return get_head(key, 0).has_value(); }
  /// All keys that begin with `prefix`, ascending.
  std::vector<std::string> keys(const std::string& prefix) const;

  /// Writes all or nothing, and flushes to disk.
  void put(const std::vector<std::pair<std::string, std::string>>& items);

  const std::filesystem::path& folder() const;

  /// Whether `folder` holds a store at all.
  static bool exists(const std::filesystem::path& folder);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Version of everything below; a store of another version must be prepared again.
inline constexpr int kStoreVersion = 1;

/// One frame of one camera, prepared: what the store holds under `record_key`.
struct FrameRecord {
  int width = 0, height = 0;  ///< of the full image
  CropBox box;                ///< empty when nothing of the person is seen
  MaskFacts facts;
  int mask_size = 0, image_size = 0;  ///< sides of the two crops in pixels
  std::string full_mask;              ///< PNG, 1 bit
  std::string crop_mask;              ///< PNG, 1 bit, mask_size squared; empty when box is
  std::string crop_image;             ///< JPEG or PNG, image_size squared; empty when box is
};

/// "<sequence>/<camera>/<frame>", ordered by frame.
std::string record_key(const std::string& sequence, const std::string& camera, long frame);
std::string encode_record(const FrameRecord& record);
/// @param what names the record in messages
/// @throws Error when the bytes are no record: bad magic, sizes that do not add up, checksum
FrameRecord decode_record(const std::string& bytes, const std::string& what);
/// The numbers only, from the first `kRecordHeadBytes` bytes.
inline constexpr std::size_t kRecordHeadBytes = 72;
FrameRecord decode_record_head(const std::string& bytes, const std::string& what);

/// "keypoints/<sequence>/<camera>/<frame>": the landmarks of one frame of one camera.
std::string keypoints_key(const std::string& sequence, const std::string& camera, long frame);
std::string encode_keypoints(const std::vector<Keypoint>& keypoints);
/// @throws Error when the bytes are not the keypoints of `count` landmarks: length, checksum, not finite
std::vector<Keypoint> decode_keypoints(const std::string& bytes, std::size_t count, const std::string& what);

/// A mask as a 1-bit PNG, and back. @throws Error when the bytes are no image of the expected size
std::string encode_mask(const cv::Mat& mask);
cv::Mat decode_mask(const std::string& png, cv::Size expected, const std::string& what);

}  // namespace doppel
