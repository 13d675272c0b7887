#include "doppel/solver/parallel.h"

#include <ATen/Parallel.h>

#include <algorithm>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {
constexpr std::size_t kGrain = 512;  // fewer do not pay for another thread
}

void for_parts(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work) {
  at::parallel_for(0, static_cast<std::int64_t>(count), static_cast<std::int64_t>(kGrain),
                   [&](std::int64_t first, std::int64_t last) { work(as_size(first), as_size(last)); });
}

double sum_in_order(std::size_t count, const std::function<double(std::size_t, std::size_t)>& sum_of_part) {
  const std::size_t parts = (count + kGrain - 1) / kGrain;
  std::vector<double> sums(parts, 0.0);
  at::parallel_for(0, static_cast<std::int64_t>(parts), 1, [&](std::int64_t first, std::int64_t last) {
    for (auto p = as_size(first); p < as_size(last); ++p)
      sums[p] = sum_of_part(p * kGrain, std::min(count, (p + 1) * kGrain));
  });
  double sum = 0.0;
  for (const double part : sums) sum += part;
  return sum;
}

}  // namespace doppel
