/// Shapes, copies, types and constants of a shape.

#include <algorithm>

#include "doppel/actor/onnx/conversion.h"

namespace doppel {
namespace {

std::string same(const OnnxOperation& o) { return o.tensor(0, o.result_type()); }

std::string reshape(const OnnxOperation& o) { return o.reshaped(o.tensor(0)); }

/// Broadcasting. A size that follows the batch stays the argument's.
std::string expand(const OnnxOperation& o) {
  std::vector<std::int64_t> sizes = o.result_sizes();
  std::replace(sizes.begin(), sizes.end(), std::int64_t{-1}, std::int64_t{1});
  return o.graph.add("Expand", {o.tensor(0), o.graph.integers(sizes)});
}

std::string expand_as(const OnnxOperation& o) {
  return o.graph.add("Expand", {o.tensor(0), o.graph.add("Shape", {o.tensor(1)})});
}

std::string filled(const OnnxOperation& o, double value) {
  const std::string number = o.graph.number(value, o.result_type());
  return o.graph.add("Expand", {number, o.graph.add("Shape", {o.tensor(0)})});
}

std::string zeros_like(const OnnxOperation& o) { return filled(o, 0.0); }
std::string ones_like(const OnnxOperation& o) { return filled(o, 1.0); }
std::string full_like(const OnnxOperation& o) { return filled(o, o.number(1)); }

std::vector<std::int64_t> order_of(std::int64_t rank) {
  std::vector<std::int64_t> order;
  for (std::int64_t d = 0; d < rank; ++d) order.push_back(d);
  return order;
}

std::string transposed(const OnnxOperation& o, const std::vector<std::int64_t>& order) {
  return o.graph.add("Transpose", {o.tensor(0)}, {{"perm", order}});
}

std::string transpose(const OnnxOperation& o) {
  std::vector<std::int64_t> order = order_of(o.rank(0));
  std::swap(order.at(o.dimension(1)), order.at(o.dimension(2)));
  return transposed(o, order);
}

std::string t(const OnnxOperation& o) {
  std::vector<std::int64_t> order = order_of(o.rank(0));
  std::reverse(order.begin(), order.end());
  return transposed(o, order);
}

std::string permute(const OnnxOperation& o) {
  std::vector<std::int64_t> order = o.integers(1);
  for (std::int64_t& d : order) d += d < 0 ? o.rank(0) : 0;
  return transposed(o, order);
}

std::string cat(const OnnxOperation& o) {
  const std::int64_t dimension = o.result_dimension(1);
  return o.graph.add("Concat", o.tensors(0), {{"axis", dimension}});
}

std::string stack(const OnnxOperation& o) {
  const std::int64_t dimension = o.result_dimension(1);
  std::vector<std::string> parts = o.tensors(0);
  for (std::string& part : parts) part = o.graph.add("Unsqueeze", {part, o.graph.integers({dimension})});
  return o.graph.add("Concat", parts, {{"axis", dimension}});
}

std::string unsqueeze(const OnnxOperation& o) {
  return o.graph.add("Unsqueeze", {o.tensor(0), o.graph.integers({o.result_dimension(1)})});
}

/// aten's list of pads begins with the last dimension.
std::string constant_pad(const OnnxOperation& o) {
  const std::vector<std::int64_t> pads = o.integers(1);
  const std::size_t rank = o.sizes(0).size();
  std::vector<std::int64_t> all(2 * rank, 0);
  for (std::size_t p = 0; p < pads.size() / 2; ++p) {
    all.at(rank - 1 - p) = pads[2 * p];
    all.at(2 * rank - 1 - p) = pads[2 * p + 1];
  }
  return o.graph.add("Pad", {o.tensor(0), o.graph.integers(all), o.graph.number(o.number(2), o.result_type())});
}

}  // namespace

const OnnxConversionTable& shape_conversions() {
  static const OnnxConversionTable table{{"aten::contiguous", same},
                                         {"aten::detach", same},
                                         {"aten::clone", same},
                                         {"aten::alias", same},
                                         {"aten::to", same},
                                         {"aten::dropout", same},
                                         {"aten::view", reshape},
                                         {"aten::reshape", reshape},
                                         {"aten::flatten", reshape},
                                         {"aten::unflatten", reshape},
                                         {"aten::squeeze", reshape},
                                         {"aten::unsqueeze", unsqueeze},
                                         {"aten::expand", expand},
                                         {"aten::expand_as", expand_as},
                                         {"aten::zeros_like", zeros_like},
                                         {"aten::empty_like", zeros_like},
                                         {"aten::ones_like", ones_like},
                                         {"aten::full_like", full_like},
                                         {"aten::transpose", transpose},
                                         {"aten::t", t},
                                         {"aten::permute", permute},
                                         {"aten::cat", cat},
                                         {"aten::stack", stack},
                                         {"aten::constant_pad_nd", constant_pad}};
  return table;
}

}  // namespace doppel
