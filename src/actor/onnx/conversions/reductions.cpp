/// Sums, means and extremes.

#include "doppel/actor/onnx/conversion.h"

namespace doppel {
namespace {

/// The dimensions of argument i; all of them when the argument is empty.
std::vector<std::int64_t> dimensions_of(const OnnxOperation& o, std::size_t i) {
  std::vector<std::int64_t> dimensions;
  if (!o.is_none(i)) dimensions = o.integers(i);
  if (dimensions.empty())
    for (std::int64_t d = 0; d < o.rank(0); ++d) dimensions.push_back(d);
  return dimensions;
}

std::string sum_of(const OnnxOperation& o, const std::string& value, const std::vector<std::int64_t>& dimensions,
                   bool keep) {
  return o.graph.add("ReduceSum", {value, o.graph.integers(dimensions)}, {{"keepdims", std::int64_t{keep}}});
}

/// sum(self, dtype) or sum(self, dimensions, keep, dtype)
std::string sum_over(const OnnxOperation& o) {
  const bool everything = o.size() == 2;
  return sum_of(o, o.tensor(0, o.result_type()), everything ? dimensions_of(o, o.size()) : dimensions_of(o, 1),
                !everything && o.flag(2));
}

std::string mean_over(const OnnxOperation& o) {
  const bool everything = o.size() == 2;
  const std::vector<std::int64_t> dimensions = everything ? dimensions_of(o, o.size()) : dimensions_of(o, 1);
  return o.graph.add("ReduceMean", {o.tensor(0, o.result_type())},
                     {{"axes", dimensions}, {"keepdims", std::int64_t{!everything && o.flag(2)}}});
}

/// norm(self, p, dimensions, keep) and linalg_vector_norm(self, p, dimensions, keep, dtype) with p = 2
std::string norm(const OnnxOperation& o) {
  if (o.size() < 4 || (!o.is_none(1) && o.number(1) != 2.0)) o.unsupported("is not the Euclidean norm over dimensions");
  const std::string squares = o.graph.add("Mul", {o.tensor(0), o.tensor(0)});
  return o.graph.add("Sqrt", {sum_of(o, squares, dimensions_of(o, 2), o.flag(3))});
}

std::string argmax(const OnnxOperation& o) {
  return o.graph.add("ArgMax", {o.tensor(0)}, {{"axis", o.dimension(1)}, {"keepdims", std::int64_t{o.flag(2)}}});
}

std::string amax(const OnnxOperation& o) {
  return o.graph.add("ReduceMax", {o.tensor(0)},
                     {{"axes", dimensions_of(o, 1)}, {"keepdims", std::int64_t{o.flag(2)}}});
}

/// Of booleans: the least or the greatest of 0 and 1. all(self), all(self, dimension, keep), any alike
template <const char* const* op>
std::string of_truths(const OnnxOperation& o) {
  const bool everything = o.size() == 1;
  const std::vector<std::int64_t> dimensions = everything ? dimensions_of(o, o.size()) : dimensions_of(o, 1);
  const std::string value = o.graph.add(*op, {o.tensor(0, torch::kInt32)},
                                        {{"axes", dimensions}, {"keepdims", std::int64_t{!everything && o.flag(2)}}});
  return o.graph.cast(value, torch::kBool);
}

constexpr const char *kReduceMin = "ReduceMin", *kReduceMax = "ReduceMax";

std::string cumsum(const OnnxOperation& o) {
  const std::string axis = o.graph.constant(torch::scalar_tensor(o.dimension(1), torch::kInt64));
  return o.graph.add("CumSum", {o.tensor(0, o.result_type()), axis});
}

std::string softmax(const OnnxOperation& o) {
  return o.graph.add("Softmax", {o.tensor(0, o.result_type())}, {{"axis", o.dimension(1)}});
}

}  // namespace

const OnnxConversionTable& reduction_conversions() {
  static const OnnxConversionTable table{{"aten::sum", sum_over},
                                         {"aten::mean", mean_over},
                                         {"aten::norm", norm},
                                         {"aten::linalg_vector_norm", norm},
                                         {"aten::argmax", argmax},
                                         {"aten::amax", amax},
                                         {"aten::all", of_truths<&kReduceMin>},
                                         {"aten::any", of_truths<&kReduceMax>},
                                         {"aten::cumsum", cumsum},
                                         {"aten::softmax", softmax}};
  return table;
}

}  // namespace doppel
