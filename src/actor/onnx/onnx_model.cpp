#include "doppel/actor/onnx/onnx_model.h"

#include <torch/csrc/jit/ir/ir.h>
#include <torch/csrc/jit/passes/dead_code_elimination.h>
#include <torch/csrc/jit/passes/inliner.h>
#include <torch/csrc/jit/passes/remove_mutation.h>

#include <algorithm>
#include <unordered_map>

#include "doppel/actor/export/quantized_weights.h"
#include "doppel/actor/onnx/conversion.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

using torch::jit::IValue;
using torch::jit::Node;
using torch::jit::Stack;

/// Evaluates a graph on the samples and converts what depends on the inputs.
class GraphConverter {
 public:
  /// @param quantized may be null
  GraphConverter(OnnxGraph& onnx, std::size_t num_samples, const QuantizedWeights* quantized)
      : onnx_(onnx), num_samples_(num_samples), quantized_(quantized) {}

  void set(const torch::jit::Value* value, OnnxValue known) {
    uses_left_[value] = value->uses().size();
    values_[value] = std::move(known);
  }
  const OnnxValue& get(const torch::jit::Value* value) const { return values_.at(value); }

  void convert(const Node* node) {
    if (node->kind() == torch::jit::prim::Constant)
      set(node->output(), known_value(torch::jit::toIValue(node->output()).value()));
    else if (node->kind() == torch::jit::prim::ListConstruct)
      make_list(node);
    else if (node->kind() == torch::jit::prim::ListUnpack)
      unpack_list(node);
    else
      run(node);
    release_inputs(node);
  }

 private:
  static OnnxValue constant_of(IValue value) {
    OnnxValue result;
    result.constant = true;
    if (value.isTensor() && value.toTensor().defined()) describe(result, {value});
    result.samples = {std::move(value)};
    return result;
  }

  /// What does not depend on the inputs: a constant, but a quantized weight is the result of operators.
  OnnxValue known_value(IValue value) {
    const QuantizedWeight* weight = quantized_ && value.isTensor() ? quantized_->find(value.toTensor()) : nullptr;
    if (weight == nullptr) return constant_of(std::move(value));
    OnnxValue result;
    result.samples.assign(num_samples_, value);
    describe(result, result.samples);
    result.name = onnx_.cast(onnx_.parameter(weight->name, weight->values), torch::kFloat32);
    if (weight->scale.defined())
      result.name = onnx_.add("Mul", {result.name, onnx_.parameter(weight->scale_name(), weight->scale)});
    return result;
  }

  /// Type and sizes.
  static void describe(OnnxValue& result, const std::vector<IValue>& samples) {
    const torch::Tensor& first = samples.front().toTensor();
    result.type = first.scalar_type();
    result.sizes = first.sizes().vec();
    for (const IValue& sample : samples)
      for (std::size_t d = 0; d < result.sizes.size(); ++d)
        if (sample.toTensor().size(static_cast<std::int64_t>(d)) != first.size(static_cast<std::int64_t>(d)))
          result.sizes[d] = -1;
  }

  bool constant_inputs(const Node* node) const {
    return std::all_of(node->inputs().begin(), node->inputs().end(),
                       [&](const torch::jit::Value* input) { return get(input).constant; });
  }

  void make_list(const Node* node) {
    OnnxValue list;
    list.constant = constant_inputs(node);
    if (!list.constant)
      for (const torch::jit::Value* input : node->inputs()) list.items.push_back(get(input));
    for (std::size_t s = 0; s < (list.constant ? 1 : num_samples_); ++s) {
      c10::impl::GenericList values(node->output()->type()->expectRef<c10::ListType>().getElementType());
      for (const torch::jit::Value* input : node->inputs()) values.push_back(sample_of(get(input), s));
      list.samples.emplace_back(std::move(values));
    }
    set(node->output(), std::move(list));
  }

  void unpack_list(const Node* node) {
    const OnnxValue list = get(node->input());
    for (std::size_t o = 0; o < node->outputs().size(); ++o)
      set(node->outputs()[o], list.constant ? constant_of(list.samples.front().toListRef()[o]) : list.items.at(o));
  }

  /// The parts of a tensor, one after the other along a dimension: unbind, chunk, split.
  OnnxValue parts_of(const Node* node, const std::vector<Stack>& results) {
    const bool unbinds = node->kind() == torch::jit::aten::unbind;
    const OnnxValue& whole = get(node->input(0));
    std::int64_t dimension = get(node->input(unbinds ? 1 : 2)).samples.front().toInt(), begin = 0;
    if (dimension < 0) dimension += static_cast<std::int64_t>(whole.sizes.size());
    OnnxValue list;
    for (std::size_t item = 0; item < results[0][0].toListRef().size(); ++item) {
      OnnxValue part;
      for (const Stack& result : results) part.samples.push_back(result[0].toListRef()[item]);
      describe(part, part.samples);
      if (!unbinds && part.sizes.at(dimension) < 0)
        fail("writing ONNX: {} cuts along the batch, which has no conversion", node->kind().toQualString());
      const std::int64_t end = begin + (unbinds ? 1 : part.sizes.at(dimension));
      part.name = unbinds
                      ? onnx_.add("Gather", {whole.name, onnx_.constant(torch::scalar_tensor(begin, torch::kInt64))},
                                  {{"axis", dimension}})
                      : onnx_.add("Slice", {whole.name, onnx_.integers({begin}), onnx_.integers({end}),
                                            onnx_.integers({dimension})});
      begin = end;
      list.items.push_back(std::move(part));
    }
    for (const Stack& result : results) list.samples.push_back(result[0]);
    return list;
  }

  static const IValue& sample_of(const OnnxValue& value, std::size_t s) {
    return value.constant ? value.samples.front() : value.samples.at(s);
  }

  /// The results of one operation for sample s.
  Stack evaluate(const Node* node, std::size_t s) const {
    Stack stack;
    for (const torch::jit::Value* input : node->inputs()) stack.push_back(sample_of(get(input), s));
    if (node->kind() == torch::jit::prim::GetAttr)
      return {stack.front().toObject()->getAttr(node->s(torch::jit::attr::name))};
    node->getOperation()(stack);
    return stack;
  }

  void run(const Node* node) {
    if (node->maybeOperator() == nullptr && node->kind() != torch::jit::prim::GetAttr)
      fail("writing ONNX: {} has no conversion", node->kind().toQualString());
    const bool constant = constant_inputs(node);
    std::vector<Stack> results;
    for (std::size_t s = 0; s < (constant ? 1 : num_samples_); ++s) results.push_back(evaluate(node, s));
    if (!constant && results[0][0].isTensorList()) {
      set(node->output(), parts_of(node, results));
      return;
    }
    for (std::size_t o = 0; o < node->outputs().size(); ++o) {
      if (constant || !results[0][o].isTensor()) {
        set(node->outputs()[o], known_value(same_in_all(node, results, o)));
        continue;
      }
      if (o > 0 && !node->outputs()[o]->uses().empty())
        fail("writing ONNX: result {} of {} has no conversion", o + 1, node->kind().toQualString());
      OnnxValue value;
      for (const Stack& result : results) value.samples.push_back(result[o]);
      describe(value, value.samples);
      if (o == 0) value.name = converted(node, value);
      set(node->outputs()[o], std::move(value));
    }
  }

  /// Result o, which is no tensor: it must not depend on the inputs.
  static IValue same_in_all(const Node* node, const std::vector<Stack>& results, std::size_t o) {
    for (const Stack& result : results)
      if (results.size() > 1 && result[o] != results[0][o])
        fail("writing ONNX: the model computes with a size that follows the batch ({})", node->kind().toQualString());
    return results[0][o];
  }

  std::string converted(const Node* node, const OnnxValue& expected) {
    const std::string name = node->kind().toQualString();
    const OnnxConversion conversion = find_onnx_conversion(name);
    if (conversion == nullptr)
      fail("writing ONNX: the operation {} has no conversion; --format torchscript writes every model", name);
    std::vector<OnnxValue> arguments;
    for (const torch::jit::Value* input : node->inputs()) arguments.push_back(get(input));
    return conversion({onnx_, name, std::move(arguments), expected});
  }

  /// Frees the samples that no later operation reads: those of a dynamic texture are large.
  void release_inputs(const Node* node) {
    for (const torch::jit::Value* input : node->inputs()) {
      OnnxValue& value = values_.at(input);
      if (--uses_left_.at(input) > 0 || value.constant) continue;
      value.samples.clear();
      value.items.clear();
    }
  }

  OnnxGraph& onnx_;
  std::size_t num_samples_;
  const QuantizedWeights* quantized_;
  std::unordered_map<const torch::jit::Value*, OnnxValue> values_;
  std::unordered_map<const torch::jit::Value*, std::size_t> uses_left_;
};

/// The method without calls and without changes in place.
std::shared_ptr<torch::jit::Graph> plain_graph(const torch::jit::script::Module& module, const std::string& method) {
  std::shared_ptr<torch::jit::Graph> graph = module.get_method(method).graph()->copy();
  torch::jit::Inline(*graph);
  torch::jit::RemoveTensorMutation(graph);
  torch::jit::EliminateDeadCode(graph);
  for (const Node* node : graph->nodes())
    if (const auto* schema = node->maybeSchema(); schema != nullptr && schema->is_mutable())
      fail("writing ONNX: {} changes a tensor in place, which has no conversion", node->kind().toQualString());
  return graph;
}

OnnxValue input_value(const std::string& name, const std::vector<Stack>& samples, std::size_t i) {
  OnnxValue value;
  value.name = name;
  value.type = samples.front().at(i).toTensor().scalar_type();
  value.sizes = samples.front().at(i).toTensor().sizes().vec();
  value.sizes.at(0) = -1;
  for (const Stack& sample : samples) value.samples.push_back(sample.at(i));
  return value;
}

/// The values of the results: those of a tuple, or the only one.
std::vector<const torch::jit::Value*> results_of(const torch::jit::Graph& graph) {
  const torch::jit::Value* result = graph.outputs().at(0);
  if (result->node()->kind() != torch::jit::prim::TupleConstruct) return {result};
  return {result->node()->inputs().begin(), result->node()->inputs().end()};
}

}  // namespace

std::string onnx_model(const torch::jit::script::Module& module, const std::string& method,
                       const OnnxSignature& signature, const std::vector<Stack>& samples,
                       const std::map<std::string, std::string>& metadata, const QuantizedWeights* quantized) {
  const torch::NoGradGuard no_grad;
  const std::shared_ptr<torch::jit::Graph> graph = plain_graph(module, method);
  OnnxGraph onnx;
  GraphConverter converter(onnx, samples.size(), quantized);
  OnnxValue self;
  self.constant = true;
  self.samples = {IValue(module._ivalue())};
  converter.set(graph->inputs().at(0), self);
  for (std::size_t i = 0; i < signature.inputs.size(); ++i) {
    const OnnxValue value = input_value(signature.inputs[i], samples, i);
    onnx.add_input(value.name, value.type, value.sizes);
    converter.set(graph->inputs().at(i + 1), value);
  }
  for (const Node* node : graph->nodes())
    if (node->kind() != torch::jit::prim::TupleConstruct) converter.convert(node);
  const std::vector<const torch::jit::Value*> results = results_of(*graph);
  for (std::size_t o = 0; o < signature.outputs.size(); ++o) {
    const OnnxValue& value = converter.get(results.at(o));
    onnx.add_output(signature.outputs[o], value.name, value.type, value.sizes);
  }
  return onnx.bytes(method, metadata);
}

}  // namespace doppel
