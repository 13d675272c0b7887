#include "doppel/track/prefetch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>

namespace doppel {
namespace {

TEST(Prefetch, HandsAllOverInOrder) {
  int next = 0;
  Prefetch<int> numbers([&]() { return next < 100 ? std::optional(next++) : std::nullopt; }, 3);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(numbers.next(), i);
  EXPECT_EQ(numbers.next(), std::nullopt);
  EXPECT_EQ(numbers.next(), std::nullopt);
}

TEST(Prefetch, MakesNoMoreThanItMayKeep) {
  std::atomic<int> made{0};
  {
    Prefetch<int> numbers([&]() { return std::optional(made++); }, 2);
    while (made < 2) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_EQ(made, 2) << "nothing was taken";
    EXPECT_EQ(numbers.next(), 0);
  }
  EXPECT_LE(made, 4) << "and it ends when nobody wants more";
}

TEST(Prefetch, AnExceptionComesInItsPlace) {
  int next = 0;
  Prefetch<int> numbers(
      [&]() -> std::optional<int> {
        if (next == 2) throw std::runtime_error("the third is broken");
        return next++;
      },
      5);
  EXPECT_EQ(numbers.next(), 0);
  EXPECT_EQ(numbers.next(), 1);
  EXPECT_THROW(numbers.next(), std::runtime_error);
  EXPECT_EQ(numbers.next(), std::nullopt);
}

}  // namespace
}  // namespace doppel
