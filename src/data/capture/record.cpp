#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/error.h"
#include "doppel/data/prepare/store.h"
#include "doppel/geometry/camera.h"

namespace doppel {

namespace {

constexpr std::uint32_t kRecordMagic = 0x43455244;  // "DREC"
constexpr std::uint32_t kTouchesBorder = 1, kEmpty = 2;
constexpr std::uint64_t kKeypointSeed = 0x6b657970;  // another version needs another seed
static_assert(sizeof(Keypoint) == 12, "three floats a landmark are part of the store's format");

/// The fixed part of a record in its layout on disk (little-endian).
struct RecordHead {
  std::uint32_t magic = kRecordMagic, version = kStoreVersion;
  std::int32_t width = 0, height = 0, u0 = 0, v0 = 0, side = 0;
  std::uint32_t flags = 0;
  std::uint64_t area = 0;
  std::int32_t mask_size = 0, image_size = 0;
  std::uint32_t full_mask_bytes = 0, crop_mask_bytes = 0, crop_image_bytes = 0, reserved = 0;
  std::uint64_t checksum = 0;  ///< of the rest of the head (this field 0) and all that follows
};
static_assert(sizeof(RecordHead) == kRecordHeadBytes, "the head of a record is part of the store's format");

/// FNV-1a over 8 bytes at a time: it detects damage, not manipulation.
std::uint64_t checksum(std::uint64_t state, const char* data, std::size_t size) {
  constexpr std::uint64_t kPrime = 0x100000001b3;
  std::size_t i = 0;
  for (; i + 8 <= size; i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, data + i, 8);
    state = (state ^ word) * kPrime;
    state ^= state >> 29;
  }
  for (; i < size; ++i) state = (state ^ static_cast<std::uint8_t>(data[i])) * kPrime;
  return state;
}

std::uint64_t record_checksum(RecordHead head, const char* payload, std::size_t size) {
  head.checksum = 0;
  const std::uint64_t start = checksum(0xcbf29ce484222325, reinterpret_cast<const char*>(&head), sizeof(head));
  return checksum(start, payload, size);
}

RecordHead read_head(const std::string& bytes, const std::string& what) {
  RecordHead head;
  if (bytes.size() < sizeof(head)) fail("{}: the record is cut off after {} bytes", what, bytes.size());
  std::memcpy(&head, bytes.data(), sizeof(head));
  if (head.magic != kRecordMagic) fail("{}: these bytes are not a record of a frame", what);
  if (head.version != static_cast<std::uint32_t>(kStoreVersion))
    fail("{}: the record has version {}, this program reads version {}; prepare the capture again with --overwrite",
         what, head.version, kStoreVersion);
  const auto bad_side = [](std::int32_t side) { return side < 1 || side > kMaxImageSide; };
  const bool bad_box = !(head.flags & kEmpty) && bad_side(head.side);
  if (bad_side(head.width) || bad_side(head.height) || bad_side(head.mask_size) || bad_side(head.image_size) || bad_box)
    fail("{}: the record's sizes are impossible; it is damaged", what);
  return head;
}

FrameRecord to_record(const RecordHead& head) {
  FrameRecord record;
  record.width = head.width;
  record.height = head.height;
  if (!(head.flags & kEmpty)) record.box = {head.u0, head.v0, head.side};
  record.facts.area = static_cast<long>(head.area);
  record.facts.touches_border = (head.flags & kTouchesBorder) != 0;
  record.mask_size = head.mask_size;
  record.image_size = head.image_size;
  return record;
}

}  // namespace

std::string record_key(const std::string& sequence, const std::string& camera, long frame) {
  return fmt::format("frames/{}/{}/{:010}", sequence, camera, frame);
}

std::string encode_record(const FrameRecord& record) {
  RecordHead head;
  head.width = record.width;
  head.height = record.height;
  head.u0 = record.box.u0;
  head.v0 = record.box.v0;
  head.side = record.box.side;
  head.flags = (record.facts.touches_border ? kTouchesBorder : 0) | (record.box.empty() ? kEmpty : 0);
  head.area = static_cast<std::uint64_t>(record.facts.area);
  head.mask_size = record.mask_size;
  head.image_size = record.image_size;
  head.full_mask_bytes = static_cast<std::uint32_t>(record.full_mask.size());
  head.crop_mask_bytes = static_cast<std::uint32_t>(record.crop_mask.size());
  head.crop_image_bytes = static_cast<std::uint32_t>(record.crop_image.size());
  const std::string payload = record.full_mask + record.crop_mask + record.crop_image;
  head.checksum = record_checksum(head, payload.data(), payload.size());
  return std::string(reinterpret_cast<const char*>(&head), sizeof(head)) + payload;
}

FrameRecord decode_record_head(const std::string& bytes, const std::string& what) {
  return to_record(read_head(bytes, what));
}

FrameRecord decode_record(const std::string& bytes, const std::string& what) {
  const RecordHead head = read_head(bytes, what);
  const std::uint64_t payload =
      std::uint64_t{head.full_mask_bytes} + head.crop_mask_bytes + std::uint64_t{head.crop_image_bytes};
  if (bytes.size() - sizeof(head) != payload)
    fail("{}: the record has {} bytes, its head says {}; it is damaged", what, bytes.size() - sizeof(head), payload);
  if (record_checksum(head, bytes.data() + sizeof(head), payload) != head.checksum)
    fail("{}: the record's checksum is wrong; it is damaged: prepare the capture again with --overwrite", what);
  FrameRecord record = to_record(head);
  std::size_t at = sizeof(head);
  for (const auto& [size, part] :
       {std::pair(head.full_mask_bytes, &record.full_mask), std::pair(head.crop_mask_bytes, &record.crop_mask),
        std::pair(head.crop_image_bytes, &record.crop_image)}) {
    *part = bytes.substr(at, size);
    at += size;
  }
  return record;
}

std::string keypoints_key(const std::string& sequence, const std::string& camera, long frame) {
  return fmt::format("keypoints/{}/{}/{:010}", sequence, camera, frame);
}

std::string encode_keypoints(const std::vector<Keypoint>& keypoints) {
  const auto* data = reinterpret_cast<const char*>(keypoints.data());
  const std::size_t size = keypoints.size() * sizeof(Keypoint);
  const std::uint64_t sum = checksum(kKeypointSeed, data, size);
  std::string bytes(reinterpret_cast<const char*>(&sum), sizeof(sum));
  if (size > 0) bytes.append(data, size);
  return bytes;
}

std::vector<Keypoint> decode_keypoints(const std::string& bytes, std::size_t count, const std::string& what) {
  std::uint64_t sum = 0;
  const std::size_t size = count * sizeof(Keypoint);
  if (bytes.size() != sizeof(sum) + size)
    fail("{}: {} bytes are not the keypoints of {} landmarks; prepare the capture again with --overwrite", what,
         bytes.size(), count);
  std::memcpy(&sum, bytes.data(), sizeof(sum));
  if (sum != checksum(kKeypointSeed, bytes.data() + sizeof(sum), size))
    fail("{}: the checksum is wrong; the keypoints are damaged: prepare the capture again with --overwrite", what);
  std::vector<Keypoint> keypoints(count);
  if (size > 0) std::memcpy(keypoints.data(), bytes.data() + sizeof(sum), size);
  for (const Keypoint& point : keypoints)
    if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.confidence))
      fail("{}: a keypoint is not finite; prepare the capture again with --overwrite", what);
  return keypoints;
}

std::string encode_mask(const cv::Mat& mask) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", mask, bytes, {cv::IMWRITE_PNG_BILEVEL, 1, cv::IMWRITE_PNG_COMPRESSION, 6});
  return std::string(bytes.begin(), bytes.end());
}

cv::Mat decode_mask(const std::string& png, cv::Size expected, const std::string& what) {
  cv::Mat mask;
  try {
    const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data()));
    if (!png.empty()) mask = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    mask.release();
  }
  if (mask.size() != expected)
    fail("{}: the mask is not an image of {}x{} pixels; the store is damaged", what, expected.width, expected.height);
  return mask;
}

}  // namespace doppel
