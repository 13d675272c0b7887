#include "doppel/core/json_bounds.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <nlohmann/json.hpp>
#include <string>

namespace doppel::json_bounds_test {
namespace {

TEST(JsonBounds, DepthIsThatOfListsAndObjectsOutsideOfStrings) {
  EXPECT_FALSE(is_json_deeper_than("[{\"a\": [1]}]", 3));
  EXPECT_TRUE(is_json_deeper_than("[{\"a\": [1]}]", 2));
  EXPECT_FALSE(is_json_deeper_than(R"(["[[[\"[[["])", 1));
  EXPECT_FALSE(is_json_deeper_than("[],[],[]", 1));
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

std::size_t bytes_in_use() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

std::string list_of(const std::string& item, int count) {
  std::string text = "[" + item;
  for (int i = 1; i < count; ++i) text += "," + item;
  return text + "]";
}

TEST(JsonBounds, MemoryBoundsThatOfTheParsedText) {
  // 65,537 is one more than a power of two: the list has just grown, and half of it is empty.
  for (const std::string item : {"0", "{}", "[]", "[0]", R"({"":0})", R"({"a":{"b":[1,2,3]},"c":0.5})", R"("short")"}) {
    const std::string text = list_of(item, 65537);
    const std::size_t before = bytes_in_use();
    const auto parsed = nlohmann::json::parse(text);
    const std::size_t taken = bytes_in_use() - before;
    ASSERT_EQ(parsed.size(), 65537u);
    const std::size_t strings = item[0] == '"' ? 65537u * (sizeof(std::string) + 16) : 0;  // the bound leaves them out
    constexpr std::size_t kPages = 2 * 4096;  // large blocks are whole pages
    EXPECT_LE(taken, json_memory(text) + strings + kPages) << item;
    EXPECT_GE(4 * taken, json_memory(text)) << item << ": the bound is too loose to be of use";
  }
}

#endif

}  // namespace
}  // namespace doppel::json_bounds_test
