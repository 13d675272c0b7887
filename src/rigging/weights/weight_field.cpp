#include "doppel/rigging/weights/weight_field.h"

#include <algorithm>
#include <numeric>

namespace doppel {

SparseRow sparse_row(const WeightField& field, int vertex) {
  constexpr std::size_t kMaxBones = 6;
  constexpr double kMinWeight = 0.01;
  const auto row = field.row(vertex);
  std::vector<int> order(row.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return row[a] > row[b]; });
  std::size_t count = 1;
  while (count < order.size() && count < kMaxBones && row[order[count]] >= kMinWeight) ++count;
  double total = 0;
  for (std::size_t k = 0; k < count; ++k) total += double{row[order[k]]};
  SparseRow result;
  for (std::size_t k = 0; k < count; ++k) {
    result.bones.push_back(order[k]);
    result.weights.push_back(double{row[order[k]]} / total);
  }
  return result;
}

SkinningWeights sparse_weights(const WeightField& field, const std::vector<std::string>& bones) {
  SkinningWeights skin;
  skin.bones = bones;
  for (int v = 0; v < static_cast<int>(field.rows()); ++v) {
    const SparseRow row = sparse_row(field, v);
    skin.vertex_bones.items.insert(skin.vertex_bones.items.end(), row.bones.begin(), row.bones.end());
    skin.weights.insert(skin.weights.end(), row.weights.begin(), row.weights.end());
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  return skin;
}

}  // namespace doppel
