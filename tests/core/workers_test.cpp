#include "doppel/core/workers.h"

#include <gtest/gtest.h>

#include <array>
#include <stdexcept>

#include "doppel/core/process.h"

namespace doppel {
namespace {

TEST(Workers, DoEachItemOnce) {
  Workers workers(3);
  std::array<std::atomic<int>, 50> calls{};
  workers.share(calls.size(), [&](std::size_t worker, std::size_t item) {
    EXPECT_LT(worker, 3u);
    ++calls[item];
  });
  for (const auto& count : calls) EXPECT_EQ(count, 1);
}

TEST(Workers, EndAtTheFirstErrorAndPassItOn) {
  Workers workers(2);
  std::atomic<int> calls{0};
  EXPECT_THROW(workers.share(1000,
                             [&](std::size_t, std::size_t item) {
                               ++calls;
                               if (item == 1) throw std::runtime_error("the second item");
                               while (item == 0 && workers.wanted()) {
                               }
                             }),
               std::runtime_error);
  EXPECT_LE(calls, 3);
  EXPECT_FALSE(workers.wanted());
}

TEST(Workers, StopWhenTheUserAsks) {
  Workers workers(2);
  std::atomic<int> calls{0};
  workers.share(1000, [&](std::size_t, std::size_t) {
    ++calls;
    request_stop();
  });
  request_stop(false);
  EXPECT_LE(calls, 2);
}

}  // namespace
}  // namespace doppel
