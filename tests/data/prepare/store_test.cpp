#include "doppel/data/prepare/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"

namespace doppel::store_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string value_of(int i) { return std::string(100 + 977 * (i % 23), static_cast<char>('a' + i % 26)); }

void fill(const fs::path& folder, int count) {
  Store store(folder, Store::Mode::write);
  for (int i = 0; i < count; i += 50) {
    std::vector<std::pair<std::string, std::string>> items;
    for (int j = i; j < std::min(count, i + 50); ++j) items.emplace_back(record_key("s", "c", j), value_of(j));
    store.put(items);
  }
}

TEST(StoreReference, GivesBackWhatWasPut) {
  const support::TemporaryFolder folder;
  fill(folder / "store", 500);
  const Store store(folder / "store", Store::Mode::read);
  for (int i = 0; i < 500; ++i) EXPECT_EQ(store.get(record_key("s", "c", i)), value_of(i));
  EXPECT_EQ(store.get_head(record_key("s", "c", 3), 10), value_of(3).substr(0, 10));
  EXPECT_FALSE(store.get("nothing").has_value());
  const std::vector<std::string> keys = store.keys("frames/s/c/");
  ASSERT_EQ(keys.size(), 500u);
  EXPECT_EQ(keys[11], record_key("s", "c", 11));
  EXPECT_TRUE(store.keys("frames/t/").empty());
}

TEST(StoreReference, GrowsBeyondItsFirstMap) {
  const support::TemporaryFolder folder;
  const std::string big(9 << 20, 'x');
  {
    Store store(folder / "store", Store::Mode::write);
    for (int i = 0; i < 10; ++i) store.put({{std::to_string(i), big}});
  }
  const Store store(folder / "store", Store::Mode::read);
  EXPECT_EQ(store.keys("").size(), 10u);
  EXPECT_EQ(store.get("9"), big);
}

TEST(StoreRejects, MissingEmptyAndTruncated) {
  const support::TemporaryFolder folder;
  EXPECT_THROW(Store(folder / "none", Store::Mode::read), Error);
  fill(folder / "store", 200);
  const fs::path file = folder / "store/data.mdb";
  const std::string valid = read_file(file);
  for (const double share : {0.0, 0.001, 0.02, 0.5, 0.9, 0.999}) {
    support::write_bytes(file, valid.substr(0, as_size(share * static_cast<double>(valid.size()))));
    EXPECT_THROW(Store(folder / "store", Store::Mode::read), Error) << share;
  }
}

TEST(StoreRejects, HeadsWithTwoPageSizes) {
  const support::TemporaryFolder folder;
  fill(folder / "store", 10);
  const fs::path file = folder / "store/data.mdb";
  std::string bytes = read_file(file);
  constexpr std::size_t kSecondHead = 4096, kPageSizeField = 16 + 24;
  bytes[kSecondHead + kPageSizeField + 1] = 0x20;  // 8192 in place of 4096
  support::write_bytes(file, bytes);
  EXPECT_THROW(Store(folder / "store", Store::Mode::read), Error);
}

// A writer takes pages from the lists of free pages, and LMDB does not check them.
TEST(StoreRejects, FreePagesThatDoNotExist) {
  const support::TemporaryFolder folder;
  fill(folder / "store", 200);
  const fs::path file = folder / "store/data.mdb";
  const std::string valid = read_file(file);
  constexpr std::size_t kPage = 4096, kMetaTrees = 16 + 24, kRoot = 40, kTransaction = 16 + 128;
  const auto word = [&](std::size_t at) {
    std::uint64_t value = 0;
    std::memcpy(&value, valid.data() + at, sizeof value);
    return value;
  };
  const std::size_t meta = word(kTransaction) > word(kPage + kTransaction) ? 0 : kPage;
  const std::size_t page = as_size(word(meta + kMetaTrees + kRoot)) * kPage;
  ASSERT_LT(page, valid.size());
  std::uint16_t node = 0;
  std::memcpy(&node, valid.data() + page + 16,
              sizeof node);  // the first node: head of 8 bytes, key of 8, then the list
  const std::size_t list = page + node + 16;
  ASSERT_GT(word(list), 0u);
  for (const std::size_t at : {list, list + 8}) {
    for (const std::uint64_t wrong : {std::uint64_t{1}, word(list) + 1, std::uint64_t{1} << 40}) {
      std::string bytes = valid;
      std::memcpy(bytes.data() + at, &wrong, sizeof wrong);
      if (bytes == valid || (at != list && wrong == word(list) + 1)) continue;
      support::write_bytes(file, bytes);
      EXPECT_THROW(Store(folder / "store", Store::Mode::write), Error) << at - list << " " << wrong;
    }
  }
  support::write_bytes(file, valid);
  EXPECT_NO_THROW(Store(folder / "store", Store::Mode::write));
}

// LMDB trusts its pages; whatever is damaged must surface as an error or leave the values readable, never crash.
TEST(StoreRejects, RandomBytes) {
  const support::TemporaryFolder folder;
  fill(folder / "store", 300);
  const fs::path file = folder / "store/data.mdb";
  const std::string valid = read_file(file);
  std::mt19937 random(7);
  int refused = 0;
  for (int round = 0; round < 150; ++round) {
    std::string bytes = valid;
    const int changes = round % 3 == 0 ? 1 : 200;
    // A third of the rounds aims at the head of some page, where the structure stands.
    for (int i = 0; i < changes; ++i) {
      const std::size_t page = random() % (bytes.size() / 4096);
      const std::size_t at = round % 2 ? page * 4096 + random() % 160 : random() % bytes.size();
      bytes[at] = static_cast<char>(random());
    }
    support::write_bytes(file, bytes);
    try {
      const Store store(folder / "store", Store::Mode::read);
      for (int i = 0; i < 300; ++i) store.get(record_key("s", "c", i));
      store.keys("");
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 30);
  support::write_bytes(file, std::string(20000, '\x5a'));
  EXPECT_THROW(Store(folder / "store", Store::Mode::read), Error);
  EXPECT_THROW(Store(folder / "store", Store::Mode::write), Error);
}

FrameRecord sample_record() {
  FrameRecord record;
  record.width = 640;
  record.height = 480;
  record.box = {-5, 20, 300};
  record.facts = {1234, true};
  record.mask_size = 64;
  record.image_size = 32;
  record.full_mask = "full mask";
  record.crop_mask = "crop";
  record.crop_image = "image bytes";
  return record;
}

TEST(RecordReference, EncodesAndDecodes) {
  const std::string bytes = encode_record(sample_record());
  const FrameRecord record = decode_record(bytes, "test");
  EXPECT_EQ(record.box, sample_record().box);
  EXPECT_EQ(record.full_mask, "full mask");
  EXPECT_EQ(record.crop_mask, "crop");
  EXPECT_EQ(record.crop_image, "image bytes");
  EXPECT_EQ(record.facts.area, 1234);
  EXPECT_TRUE(record.facts.touches_border);
  EXPECT_EQ(decode_record_head(bytes.substr(0, kRecordHeadBytes), "test").width, 640);
}

TEST(RecordRejects, EveryDamage) {
  const std::string valid = encode_record(sample_record());
  for (std::size_t n = 0; n < valid.size(); ++n) EXPECT_THROW(decode_record(valid.substr(0, n), "r"), Error) << n;
  EXPECT_THROW(decode_record(valid + "x", "r"), Error);
  for (std::size_t i = 0; i < valid.size(); ++i)
    for (const char flip : {'\x01', '\x80', '\xff'}) {
      std::string bytes = valid;
      bytes[i] = static_cast<char>(bytes[i] ^ flip);
      EXPECT_THROW(decode_record(bytes, "r"), Error) << "byte " << i;
    }
}

TEST(RecordReference, MasksSurviveAsOneBitImages) {
  cv::Mat mask = cv::Mat::zeros(37, 53, CV_8U);
  mask(cv::Rect(5, 6, 20, 11)).setTo(255);
  mask.at<std::uint8_t>(30, 52) = 255;
  const std::string png = encode_mask(mask);
  EXPECT_EQ(cv::countNonZero(decode_mask(png, mask.size(), "m") != mask), 0);
  EXPECT_LT(png.size(), 200u);
  EXPECT_THROW(decode_mask(png, {53, 38}, "m"), Error);
  EXPECT_THROW(decode_mask("noise", mask.size(), "m"), Error);
  EXPECT_THROW(decode_mask("", mask.size(), "m"), Error);
}

}  // namespace
}  // namespace doppel::store_test
