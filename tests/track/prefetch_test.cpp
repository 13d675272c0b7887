#include "doppel/track/prefetch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>

namespace doppel::prefetch_test {
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

TEST(Prefetch, TheNewestWinsWhereOldOnesMayBeDropped) {
  std::atomic<int> made{0};
  Prefetch<int> numbers(
      [&]() {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return made < 50 ? std::optional(made++) : std::nullopt;
      },
      1, WhenFull::drop_oldest);
  while (made < 50) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(numbers.next(), 49) << "nobody took the others";
  EXPECT_EQ(numbers.next(), std::nullopt);
  EXPECT_EQ(numbers.num_dropped(), 49);
}

TEST(Prefetch, WaitsNoLongerThanItIsTold) {
  std::atomic<bool> go{false};
  Prefetch<int> numbers(
      [&, first = true]() mutable -> std::optional<int> {
        while (!go) std::this_thread::yield();
        return std::exchange(first, false) ? std::optional(7) : std::nullopt;
      },
      1);
  const auto nothing = numbers.next_within(0.02);
  EXPECT_FALSE(nothing.thing);
  EXPECT_FALSE(nothing.ended);
  go = true;
  EXPECT_EQ(numbers.next_within(60.0).thing, 7);
  EXPECT_TRUE(numbers.next_within(60.0).ended);
}

TEST(Prefetch, AStopReachesWhoeverWaitsEvenWhileTheNextIsMade) {
  std::atomic<bool> go{false};
  std::atomic<int> made{0};
  Prefetch<int> source(
      [&]() {
        while (made > 0 && !go) std::this_thread::yield();
        return std::optional(made++);
      },
      1);
  Prefetch<int> doubled(
      [&]() {
        const auto number = source.next();
        return number ? std::optional(2 * *number) : std::nullopt;
      },
      1);
  EXPECT_EQ(doubled.next(), 0);
  source.stop();
  EXPECT_EQ(doubled.next(), std::nullopt) << "though the source is still at it";
  go = true;
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
}  // namespace doppel::prefetch_test
