#include "doppel/detect/blazepose/network_edits.h"

#include <algorithm>

namespace doppel {

namespace {

constexpr int kNoOperator = -1;

/// How often each tensor is read, by operators or as an output.
std::vector<int> count_uses(const NetworkModel& model) {
  std::vector<int> uses(model.tensors.size(), 0);
  for (const int output : model.outputs) ++uses[output];
  for (const NetworkOperator& step : model.operators) {
    for (const int input : step.inputs) ++uses[input];
  }
  return uses;
}

/// Whether an operator adds zeros to rows and columns only.
bool pads_rows_and_columns(const NetworkOperator& step) {
  const auto none = [&](std::size_t axis) { return step.pad_before[axis] == 0 && step.pad_after[axis] == 0; };
  return step.op == NetworkOp::pad && step.pad_before.size() == 4 && none(0) && none(3);
}

bool takes_borders(const NetworkOperator& step) {
  const bool convolution = step.op == NetworkOp::conv_2d || step.op == NetworkOp::depthwise_conv_2d;
  return convolution && !step.same_padding && step.pad_before.empty();
}

}  // namespace

NetworkModel fold_padding(const NetworkModel& model) {
  const std::vector<int> uses = count_uses(model);
  std::vector<int> pad_of(model.tensors.size(), kNoOperator);  // by tensor: the pad that may be folded
  for (std::size_t i = 0; i < model.operators.size(); ++i) {
    const NetworkOperator& step = model.operators[i];
    if (pads_rows_and_columns(step) && uses[step.output] == 1) pad_of[step.output] = static_cast<int>(i);
  }
  NetworkModel result = model;
  std::vector<bool> folded(model.operators.size(), false);
  for (NetworkOperator& step : result.operators) {
    const int found = pad_of[step.inputs[0]];
    if (found == kNoOperator || !takes_borders(step)) continue;
    const NetworkOperator& pad = model.operators[found];
    step.inputs[0] = pad.inputs[0];
    step.pad_before = pad.pad_before;
    step.pad_after = pad.pad_after;
    folded[found] = true;
  }
  std::size_t number = 0;
  std::erase_if(result.operators, [&](const NetworkOperator&) { return folded[number++]; });
  return result;
}

NetworkModel keep_outputs(const NetworkModel& model, const std::vector<std::size_t>& outputs) {
  NetworkModel result = model;
  result.outputs.clear();
  for (const std::size_t output : outputs) result.outputs.push_back(model.outputs.at(output));
  std::vector<bool> needed(model.tensors.size(), false);
  for (const int output : result.outputs) needed[output] = true;
  result.operators.clear();
  for (auto step = model.operators.rbegin(); step != model.operators.rend(); ++step) {
    if (!needed[step->output]) continue;
    for (const int input : step->inputs) needed[input] = true;
    result.operators.push_back(*step);
  }
  std::reverse(result.operators.begin(), result.operators.end());
  return result;
}

}  // namespace doppel
