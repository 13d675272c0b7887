#include "doppel/rigging/joints/same_positions.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace doppel {

std::vector<int> same_positions(const std::vector<Eigen::Vector3d>& vertices) {
  std::vector<int> order(vertices.size()), number_of(vertices.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int v) {
    const Eigen::Vector3d& p = vertices[v];
    return std::array<double, 3>{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  int number = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i]) != key(order[i - 1])) ++number;
    number_of[order[i]] = number;
  }
  return number_of;
}

}  // namespace doppel
