#include "doppel/rigging/scan/edge_table.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace doppel {

std::vector<EdgeUse> sorted_edge_uses(const std::vector<Triangle>& faces) {
  std::vector<EdgeUse> uses;
  uses.reserve(3 * faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(faces[f][k], faces[f][(k + 1) % 3]);
      uses.push_back({low, high, static_cast<int>(3 * f) + k});
    }
  std::sort(uses.begin(), uses.end(), [](const EdgeUse& a, const EdgeUse& b) {
    return std::tie(a.low, a.high, a.half) < std::tie(b.low, b.high, b.half);
  });
  return uses;
}

JoinedSets::JoinedSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

int JoinedSets::find(int item) {
  while (parent_[item] != item) {
    parent_[item] = parent_[parent_[item]];
    item = parent_[item];
  }
  return item;
}

void JoinedSets::join(int a, int b) {
  a = find(a);
  b = find(b);
  parent_[std::max(a, b)] = std::min(a, b);
}

std::vector<int> face_components(const std::vector<Triangle>& faces, std::size_t num_vertices, int& count) {
  JoinedSets sets(num_vertices);
  for (const Triangle& face : faces) {
    sets.join(face[0], face[1]);
    sets.join(face[0], face[2]);
  }
  std::vector<int> number(num_vertices, -1), component(faces.size());
  count = 0;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    int& here = number[sets.find(faces[f][0])];
    if (here < 0) here = count++;
    component[f] = here;
  }
  return component;
}

}  // namespace doppel
