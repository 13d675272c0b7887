/// Parts of tensors, chosen by index.

#include <algorithm>
#include <limits>
#include <vector>

#include "doppel/actor/onnx/conversion.h"

namespace doppel {
namespace {

constexpr std::int64_t kEnd = std::numeric_limits<std::int64_t>::max();

std::string sliced(const OnnxOperation& o, std::int64_t dimension, std::int64_t begin, std::int64_t end,
                   std::int64_t step) {
  OnnxGraph& g = o.graph;
  return g.add("Slice",
               {o.tensor(0), g.integers({begin}), g.integers({end}), g.integers({dimension}), g.integers({step})});
}

std::string select(const OnnxOperation& o) {
  const std::string index = o.graph.constant(torch::scalar_tensor(o.integer(2), torch::kInt64));
  return o.graph.add("Gather", {o.tensor(0), index}, {{"axis", o.dimension(1)}});
}

std::string narrow(const OnnxOperation& o) {
  const std::int64_t size = o.sizes(0).at(o.dimension(1));
  const std::int64_t begin = o.integer(2) < 0 ? o.integer(2) + size : o.integer(2);
  return sliced(o, o.dimension(1), begin, begin + o.integer(3), 1);
}

std::string slice(const OnnxOperation& o) {
  return sliced(o, o.dimension(1), o.is_none(2) ? 0 : o.integer(2), o.is_none(3) ? kEnd : o.integer(3), o.integer(4));
}

std::string flip(const OnnxOperation& o) {
  std::vector<std::int64_t> dimensions = o.integers(1);
  for (std::int64_t& d : dimensions) d += d < 0 ? o.rank(0) : 0;
  OnnxGraph& g = o.graph;
  const std::size_t count = dimensions.size();
  const std::string minus = g.integers(std::vector<std::int64_t>(count, -1));
  const std::string before_first =
      g.integers(std::vector<std::int64_t>(count, std::numeric_limits<std::int64_t>::min()));
  return g.add("Slice", {o.tensor(0), minus, before_first, g.integers(dimensions), minus});
}

std::string index_select(const OnnxOperation& o) {
  return o.graph.add("Gather", {o.tensor(0), o.tensor(2)}, {{"axis", o.dimension(1)}});
}

std::string gather(const OnnxOperation& o) {
  return o.graph.add("GatherElements", {o.tensor(0), o.tensor(2)}, {{"axis", o.dimension(1)}});
}

/// The entries of a constant index by target, [targets, P]. Rows are filled up with `none`.
torch::Tensor sources_by_target(const torch::Tensor& index, std::int64_t targets, std::int64_t none) {
  std::vector<std::vector<std::int64_t>> sources(targets);
  const auto at = index.accessor<std::int64_t, 1>();
  for (std::int64_t e = 0; e < at.size(0); ++e) sources.at(at[e]).push_back(e);
  std::size_t longest = 1;
  for (const auto& row : sources) longest = std::max(longest, row.size());
  torch::Tensor table = torch::full({targets, static_cast<std::int64_t>(longest)}, none, torch::kInt64);
  for (std::int64_t i = 0; i < targets; ++i)
    for (std::size_t p = 0; p < sources[i].size(); ++p) table[i][static_cast<std::int64_t>(p)] = sources[i][p];
  return table;
}

/// out[i] = self[i] + alpha sum of source[e] with index[e] = i. The index is constant, so the sum becomes a gather:
/// each target takes its sources and, as filling, a row of zeros behind the last one.
std::string index_add(const OnnxOperation& o) {
  OnnxGraph& g = o.graph;
  const std::int64_t dimension = o.dimension(1), rank = o.rank(0);
  const torch::Tensor index = o.constant(2).toTensor().to(torch::kInt64);
  std::vector<std::int64_t> pads(2 * rank, 0);
  pads.at(rank + dimension) = 1;
  const std::string source =
      g.add("Pad", {o.tensor(3, o.result_type()), g.integers(pads), g.number(0.0, o.result_type())});
  const std::string table = g.constant(sources_by_target(index, o.sizes(0).at(dimension), index.size(0)));
  const std::string gathered = g.add("Gather", {source, table}, {{"axis", dimension}});
  std::string sum = g.add("ReduceSum", {gathered, g.integers({dimension + 1})}, {{"keepdims", std::int64_t{0}}});
  if (o.number(4) != 1.0) sum = g.add("Mul", {sum, g.number(o.number(4), o.result_type())});
  return g.add("Add", {o.tensor(0), sum});
}

/// out[index[e]] = source[e], elsewhere self. The index is constant, so the result gathers rows of both.
std::string index_copy(const OnnxOperation& o) {
  const std::int64_t dimension = o.dimension(1), targets = o.sizes(0).at(dimension);
  torch::Tensor rows = torch::arange(targets, torch::kInt64);
  const torch::Tensor index = o.constant(2).toTensor().to(torch::kInt64);
  rows.index_copy_(0, index, torch::arange(targets, targets + index.size(0), torch::kInt64));
  const std::string both = o.graph.add("Concat", {o.tensor(0), o.tensor(3, o.result_type())}, {{"axis", dimension}});
  return o.graph.add("Gather", {both, o.graph.constant(rows)}, {{"axis", dimension}});
}

}  // namespace

const OnnxConversionTable& indexing_conversions() {
  static const OnnxConversionTable table{{"aten::select", select},
                                         {"aten::narrow", narrow},
                                         {"aten::slice", slice},
                                         {"aten::flip", flip},
                                         {"aten::index_select", index_select},
                                         {"aten::gather", gather},
                                         {"aten::index_add", index_add},
                                         {"aten::index_copy", index_copy}};
  return table;
}

}  // namespace doppel
