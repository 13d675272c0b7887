#include "doppel/train/tensorboard.h"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/crc32c.h"
#include "support/temporary_folder.h"

namespace doppel::tensorboard_test {

using support::TemporaryFolder;

namespace {

TEST(Crc32cReference, KnownChecksums) {
  // RFC 3720, B.4.
  EXPECT_EQ(crc32c("123456789", 9), 0xe3069283u);
  EXPECT_EQ(crc32c(std::string(32, '\0').data(), 32), 0x8a9136aau);
  EXPECT_EQ(crc32c(std::string(32, '\xff').data(), 32), 0x62a8ab43u);
  EXPECT_EQ(crc32c(nullptr, 0), 0u);
  // Continued at any position it is the same.
  for (std::size_t split = 0; split <= 9; ++split)
    EXPECT_EQ(crc32c("123456789" + split, 9 - split, crc32c("123456789", split)), 0xe3069283u);
}

/// A field of a protobuf message, read by hand: number, wire type and content.
struct Field {
  unsigned number;
  std::string bytes;        ///< length-delimited
  std::uint64_t value = 0;  ///< varint or fixed
};

std::uint64_t varint(const std::string& s, std::size_t& at) {
  std::uint64_t value = 0;
  for (int shift = 0; at < s.size(); shift += 7) {
    const auto byte = static_cast<unsigned char>(s[at++]);
    value |= static_cast<std::uint64_t>(byte & 127u) << shift;
    if (byte < 128) break;
  }
  return value;
}

std::vector<Field> fields(const std::string& message) {
  std::vector<Field> out;
  for (std::size_t at = 0; at < message.size();) {
    const std::uint64_t key = varint(message, at);
    Field field{static_cast<unsigned>(key >> 3), "", 0};
    const auto fixed = [&](std::size_t size) {
      std::memcpy(&field.value, message.data() + at, size);
      at += size;
    };
    switch (key & 7u) {
      case 0:
        field.value = varint(message, at);
        break;
      case 1:
        fixed(8);
        break;
      case 5:
        fixed(4);
        break;
      case 2: {
        const std::size_t size = varint(message, at);
        field.bytes = message.substr(at, size);
        at += size;
        break;
      }
      default:
        ADD_FAILURE() << "wire type " << (key & 7u);
        return out;
    }
    out.push_back(field);
  }
  return out;
}

const Field* find(const std::vector<Field>& all, unsigned number) {
  for (const Field& field : all)
    if (field.number == number) return &field;
  return nullptr;
}

template <typename T>
T number_at(const std::string& bytes, std::size_t at) {
  T value{};
  if (at + sizeof(T) <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

/// Records as TensorFlow lays them out: length, its checksum, content, its checksum.
std::vector<std::string> records_of(const std::string& bytes) {
  const auto masked = [](const std::string& data) {
    const std::uint32_t crc = crc32c(data.data(), data.size());
    return (crc >> 15 | crc << 17) + 0xa282ead8u;
  };
  std::vector<std::string> records;
  for (std::size_t at = 0; at < bytes.size();) {
    const auto size = number_at<std::uint64_t>(bytes, at);
    EXPECT_EQ(number_at<std::uint32_t>(bytes, at + 8), masked(bytes.substr(at, 8)));
    records.push_back(bytes.substr(at + 12, size));
    EXPECT_EQ(number_at<std::uint32_t>(bytes, at + 12 + size), masked(records.back()));
    at += 16 + size;
  }
  return records;
}

TEST(TensorBoardReference, RecordsParseBackAsTensorFlowLaysThemOut) {
  const TemporaryFolder folder;
  std::filesystem::path path;
  {
    TensorBoardWriter writer(folder.path(), 40);
    path = writer.path();
    writer.add_scalars(50, {{"loss", 0.25}, {"raw/arap", -2.0}});
    writer.add_image(60, "overlay", cv::Mat(4, 6, CV_8UC3, cv::Scalar(10, 20, 30)));
  }
  EXPECT_EQ(path.filename().string().rfind("events.out.tfevents.", 0), 0u);
  const auto records = records_of(read_file(path));
  ASSERT_EQ(records.size(), 4u);

  const auto version = fields(records[0]);
  ASSERT_NE(find(version, 3), nullptr);
  EXPECT_EQ(find(version, 3)->bytes, "brain.Event:2");
  const auto start = fields(records[1]);
  EXPECT_EQ(find(start, 2)->value, 40u);
  EXPECT_EQ(find(fields(find(start, 7)->bytes), 1)->value, 1u);

  const auto scalars = fields(records[2]);
  EXPECT_EQ(find(scalars, 2)->value, 50u);
  const auto values = fields(find(scalars, 5)->bytes);
  ASSERT_EQ(values.size(), 2u);
  const auto second = fields(values[1].bytes);
  EXPECT_EQ(find(second, 1)->bytes, "raw/arap");
  const auto bits = static_cast<std::uint32_t>(find(second, 2)->value);
  float number;
  std::memcpy(&number, &bits, 4);
  EXPECT_EQ(number, -2.0f);

  const auto image = fields(fields(find(fields(records[3]), 5)->bytes)[0].bytes);
  const auto content = fields(find(image, 4)->bytes);
  EXPECT_EQ(find(content, 1)->value, 4u);
  EXPECT_EQ(find(content, 2)->value, 6u);
  const std::string& png = find(content, 4)->bytes;
  const cv::Mat decoded = cv::imdecode(std::vector<unsigned char>(png.begin(), png.end()), cv::IMREAD_COLOR);
  EXPECT_EQ(decoded.at<cv::Vec3b>(2, 3), cv::Vec3b(10, 20, 30));
}

}  // namespace
}  // namespace doppel::tensorboard_test
