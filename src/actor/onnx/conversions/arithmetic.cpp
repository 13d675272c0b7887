#include <algorithm>

#include "doppel/actor/onnx/conversion.h"

/// Operations on each element.

namespace doppel {
namespace {

template <const char* const* op>
std::string unary(const OnnxOperation& o) {
  return o.graph.add(*op, {o.tensor(0, o.result_type())});
}

/// self + alpha other, self - alpha other
template <const char* const* op>
std::string sum(const OnnxOperation& o) {
  std::string other = o.tensor(1, o.result_type());
  if (!o.is_none(2) && o.number(2) != 1.0)
    other = o.graph.add("Mul", {other, o.graph.number(o.number(2), o.result_type())});
  return o.graph.add(*op, {o.tensor(0, o.result_type()), other});
}

template <const char* const* op>
std::string binary(const OnnxOperation& o) {
  if (!o.is_none(2)) o.unsupported("has a rounding mode");
  return o.graph.add(*op, {o.tensor(0, o.result_type()), o.tensor(1, o.result_type())});
}

/// A number takes the type of the tensor, except a fraction beside integers.
torch::ScalarType common_type(const OnnxOperation& o) {
  if (o.rank(1) > 0 || o.rank(0) > 0) {
    const torch::ScalarType tensor = o.rank(0) > 0 ? o.type(0) : o.type(1),
                            other = o.rank(0) > 0 ? o.type(1) : o.type(0);
    if (c10::isFloatingType(tensor) || !c10::isFloatingType(other))
      return o.rank(0) > 0 && o.rank(1) > 0 ? c10::promoteTypes(tensor, other) : tensor;
  }
  return c10::promoteTypes(o.type(0), o.type(1));
}

template <const char* const* op>
std::string compare(const OnnxOperation& o) {
  const torch::ScalarType type = common_type(o);
  return o.graph.add(*op, {o.tensor(0, type), o.tensor(1, type)});
}

std::string not_equal(const OnnxOperation& o) {
  const torch::ScalarType type = common_type(o);
  return o.graph.add("Not", {o.graph.add("Equal", {o.tensor(0, type), o.tensor(1, type)})});
}

std::string reverse_sub(const OnnxOperation& o) {
  return o.graph.add("Sub", {o.tensor(1, o.result_type()), o.tensor(0, o.result_type())});
}

std::string square(const OnnxOperation& o) { return o.graph.add("Mul", {o.tensor(0), o.tensor(0)}); }

std::string rsqrt(const OnnxOperation& o) { return o.graph.add("Reciprocal", {o.graph.add("Sqrt", {o.tensor(0)})}); }

std::string clamp(const OnnxOperation& o) {
  std::string value = o.tensor(0, o.result_type());
  if (!o.is_none(1)) value = o.graph.add("Max", {value, o.tensor(1, o.result_type())});
  if (!o.is_none(2)) value = o.graph.add("Min", {value, o.tensor(2, o.result_type())});
  return value;
}

std::string where(const OnnxOperation& o) {
  return o.graph.add("Where", {o.tensor(0, torch::kBool), o.tensor(1, o.result_type()), o.tensor(2, o.result_type())});
}

/// x - x is NaN for infinite x and NaN.
std::string is_finite(const OnnxOperation& o) {
  return o.graph.add("Not", {o.graph.add("IsNaN", {o.graph.add("Sub", {o.tensor(0), o.tensor(0)})})});
}

/// In the runtimes the functions of angles exist in float32.
template <const char* const* op>
std::string in_float(const OnnxOperation& o) {
  const std::string value = o.graph.add(*op, {o.tensor(0, torch::kFloat32)});
  return o.result_type() == torch::kFloat32 ? value : o.graph.cast(value, o.result_type());
}

/// atan2(y, x): atan(y / x), turned by pi where x < 0; +-pi/2 or 0 where x = 0.
std::string atan2(const OnnxOperation& o) {
  OnnxGraph& g = o.graph;
  const auto number = [&](double value) { return g.number(value, torch::kFloat32); };
  const std::string y = o.tensor(0, torch::kFloat32), x = o.tensor(1, torch::kFloat32), zero = number(0.0);
  const std::string on_axis = g.add("Equal", {x, zero});
  const std::string angle = g.add("Atan", {g.add("Div", {y, g.add("Where", {on_axis, number(1.0), x})})});
  const std::string turn = g.add("Where", {g.add("Less", {y, zero}), number(-M_PI), number(M_PI)});
  const std::string left = g.add("Where", {g.add("Less", {x, zero}), g.add("Add", {angle, turn}), angle});
  const std::string upright = g.add("Mul", {g.add("Sign", {y}), number(M_PI_2)});
  const std::string value = g.add("Where", {on_axis, upright, left});
  return o.result_type() == torch::kFloat32 ? value : g.cast(value, o.result_type());
}

std::string elu(const OnnxOperation& o) {
  if (o.number(2) != 1.0 || o.number(3) != 1.0) o.unsupported("has a scale");
  return o.graph.add("Elu", {o.tensor(0)}, {{"alpha", o.number(1)}});
}

std::string leaky_relu(const OnnxOperation& o) {
  return o.graph.add("LeakyRelu", {o.tensor(0)}, {{"alpha", o.number(1)}});
}

/// beta = 1 and values below the threshold, as everywhere in Doppel.
std::string softplus(const OnnxOperation& o) {
  if (o.number(1) != 1.0) o.unsupported("has a beta");
  return o.graph.add("Softplus", {o.tensor(0)});
}

std::string power(const OnnxOperation& o) {
  return o.graph.add("Pow", {o.tensor(0, o.result_type()), o.tensor(1, o.result_type())});
}

constexpr const char *kAdd = "Add", *kSub = "Sub", *kMul = "Mul", *kDiv = "Div", *kNeg = "Neg", *kAbs = "Abs",
                     *kSqrt = "Sqrt", *kExp = "Exp", *kLog = "Log", *kSin = "Sin", *kCos = "Cos", *kTanh = "Tanh",
                     *kSigmoid = "Sigmoid", *kSign = "Sign", *kCeil = "Ceil", *kFloor = "Floor", *kRelu = "Relu",
                     *kReciprocal = "Reciprocal", *kAcos = "Acos", *kAsin = "Asin", *kAtan = "Atan", *kLess = "Less",
                     *kGreater = "Greater", *kLessEqual = "LessOrEqual", *kGreaterEqual = "GreaterOrEqual",
                     *kEqual = "Equal", *kAnd = "And", *kOr = "Or", *kNot = "Not", *kMax = "Max", *kMin = "Min";

}  // namespace

const OnnxConversionTable& arithmetic_conversions() {
  static const OnnxConversionTable table{{"aten::add", sum<&kAdd>},
                                         {"aten::sub", sum<&kSub>},
                                         {"aten::rsub", reverse_sub},
                                         {"aten::mul", binary<&kMul>},
                                         {"aten::div", binary<&kDiv>},
                                         {"aten::neg", unary<&kNeg>},
                                         {"aten::abs", unary<&kAbs>},
                                         {"aten::sqrt", unary<&kSqrt>},
                                         {"aten::rsqrt", rsqrt},
                                         {"aten::square", square},
                                         {"aten::pow", power},
                                         {"aten::exp", unary<&kExp>},
                                         {"aten::log", unary<&kLog>},
                                         {"aten::reciprocal", unary<&kReciprocal>},
                                         {"aten::sign", unary<&kSign>},
                                         {"aten::ceil", unary<&kCeil>},
                                         {"aten::floor", unary<&kFloor>},
                                         {"aten::sin", in_float<&kSin>},
                                         {"aten::cos", in_float<&kCos>},
                                         {"aten::asin", in_float<&kAsin>},
                                         {"aten::acos", in_float<&kAcos>},
                                         {"aten::atan", in_float<&kAtan>},
                                         {"aten::atan2", atan2},
                                         {"aten::tanh", unary<&kTanh>},
                                         {"aten::sigmoid", unary<&kSigmoid>},
                                         {"aten::softplus", softplus},
                                         {"aten::relu", unary<&kRelu>},
                                         {"aten::elu", elu},
                                         {"aten::leaky_relu", leaky_relu},
                                         {"aten::hardtanh", clamp},
                                         {"aten::clamp", clamp},
                                         {"aten::clamp_min", binary<&kMax>},
                                         {"aten::clamp_max", binary<&kMin>},
                                         {"aten::maximum", binary<&kMax>},
                                         {"aten::minimum", binary<&kMin>},
                                         {"aten::lt", compare<&kLess>},
                                         {"aten::gt", compare<&kGreater>},
                                         {"aten::le", compare<&kLessEqual>},
                                         {"aten::ge", compare<&kGreaterEqual>},
                                         {"aten::eq", compare<&kEqual>},
                                         {"aten::ne", not_equal},
                                         {"aten::logical_and", binary<&kAnd>},
                                         {"aten::__and__", binary<&kAnd>},
                                         {"aten::bitwise_and", binary<&kAnd>},
                                         {"aten::logical_or", binary<&kOr>},
                                         {"aten::__or__", binary<&kOr>},
                                         {"aten::logical_not", unary<&kNot>},
                                         {"aten::bitwise_not", unary<&kNot>},
                                         {"aten::isfinite", is_finite},
                                         {"aten::where", where}};
  return table;
}

}  // namespace doppel
