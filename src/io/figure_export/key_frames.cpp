#include "doppel/io/figure_export/key_frames.h"

#include <algorithm>
#include <utility>

namespace doppel {

std::vector<int> key_frames(int count, double tolerance, const std::function<double(int, int, int)>& error) {
  if (count == 1) return {0};
  std::vector<int> keys{0, count - 1};
  std::vector<std::pair<int, int>> open{{0, count - 1}};
  while (!open.empty()) {
    const auto [a, b] = open.back();
    open.pop_back();
    int worst = -1;
    double largest = tolerance;
    for (int i = a + 1; i < b; ++i)
      if (const double here = error(a, b, i); here > largest) {
        largest = here;
        worst = i;
      }
    if (worst < 0) continue;
    keys.push_back(worst);
    open.emplace_back(a, worst);
    open.emplace_back(worst, b);
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

}  // namespace doppel
