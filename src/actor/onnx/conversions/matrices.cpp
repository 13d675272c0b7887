/// Products of matrices, and the inverse and determinant of 3 x 3 matrices by cofactors.

#include "doppel/actor/onnx/conversion.h"

namespace doppel {
namespace {

std::string matmul(const OnnxOperation& o) {
  return o.graph.add("MatMul", {o.tensor(0, o.result_type()), o.tensor(1, o.result_type())});
}

std::string added(const OnnxOperation& o, const std::string& value, std::size_t i) {
  return o.is_none(i) ? value : o.graph.add("Add", {value, o.tensor(i, o.result_type())});
}

/// linear(input, weight, bias) = input weight^T + bias
std::string linear(const OnnxOperation& o) {
  const std::string weight = o.graph.add("Transpose", {o.tensor(1)}, {{"perm", std::vector<std::int64_t>{1, 0}}});
  return added(o, o.graph.add("MatMul", {o.tensor(0), weight}), 2);
}

/// addmm(self, a, b, beta, alpha), baddbmm alike
std::string addmm(const OnnxOperation& o) {
  if (o.number(3) != 1.0 || o.number(4) != 1.0) o.unsupported("has factors");
  return added(o, o.graph.add("MatMul", {o.tensor(1), o.tensor(2)}), 0);
}

std::string taken(OnnxGraph& g, const std::string& value, const std::vector<std::int64_t>& index, std::int64_t axis) {
  return g.add("Gather", {value, g.integers(index)}, {{"axis", axis}});
}

/// a x b along `axis`: a[1,2,0] b[2,0,1] - a[2,0,1] b[1,2,0]
std::string cross_product(OnnxGraph& g, const std::string& a, const std::string& b, std::int64_t axis) {
  const std::vector<std::int64_t> next{1, 2, 0}, last{2, 0, 1};
  return g.add("Sub", {g.add("Mul", {taken(g, a, next, axis), taken(g, b, last, axis)}),
                       g.add("Mul", {taken(g, a, last, axis), taken(g, b, next, axis)})});
}

/// cross(self, other, dim), linalg_cross alike; without a dimension the first of size 3
std::string cross(const OnnxOperation& o) {
  std::int64_t axis = 0;
  if (!o.is_none(2))
    axis = o.dimension(2);
  else
    while (o.result_sizes().at(axis) != 3) ++axis;
  return cross_product(o.graph, o.tensor(0, o.result_type()), o.tensor(1, o.result_type()), axis);
}

struct Cofactors {
  std::string rows;         ///< [...,3,3]: row i is the cross product of the two other rows, in order
  std::string determinant;  ///< [...,1]
};

Cofactors cofactors(const OnnxOperation& o) {
  const std::vector<std::int64_t>& sizes = o.sizes(0);
  if (sizes.size() < 2 || sizes.back() != 3 || sizes[sizes.size() - 2] != 3) o.unsupported("is of no 3 x 3 matrix");
  OnnxGraph& g = o.graph;
  const std::int64_t row_axis = o.rank(0) - 2, column_axis = o.rank(0) - 1;
  const std::string matrix = o.tensor(0);
  const std::string rows =
      cross_product(g, taken(g, matrix, {1, 2, 0}, row_axis), taken(g, matrix, {2, 0, 1}, row_axis), column_axis);
  const std::string products = g.add("Mul", {taken(g, matrix, {0}, row_axis), taken(g, rows, {0}, row_axis)});
  return {rows, g.add("ReduceSum", {products, g.integers({column_axis})}, {{"keepdims", std::int64_t{1}}})};
}

std::string determinant(const OnnxOperation& o) { return o.reshaped(cofactors(o).determinant); }

/// The transposed cofactors over the determinant.
std::string inverse(const OnnxOperation& o) {
  const Cofactors c = cofactors(o);
  std::vector<std::int64_t> order;
  for (std::int64_t d = 0; d < o.rank(0); ++d) order.push_back(d);
  std::swap(order[order.size() - 1], order[order.size() - 2]);
  return o.graph.add("Div", {o.graph.add("Transpose", {c.rows}, {{"perm", order}}), c.determinant});
}

}  // namespace

const OnnxConversionTable& matrix_conversions() {
  static const OnnxConversionTable table{
      {"aten::matmul", matmul},     {"aten::mm", matmul},          {"aten::bmm", matmul},
      {"aten::linear", linear},     {"aten::addmm", addmm},        {"aten::baddbmm", addmm},
      {"aten::cross", cross},       {"aten::linalg_cross", cross}, {"aten::linalg_det", determinant},
      {"aten::linalg_inv", inverse}};
  return table;
}

}  // namespace doppel
