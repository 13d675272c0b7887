#include "doppel/detect/networks/onnx_edits.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/detect/networks/onnx_message.h"

namespace doppel {

namespace {

using onnx::Node;
using onnx::Tensor;

constexpr std::int64_t kMaxRow = 2048;            ///< numbers of a row that becomes a diagonal matrix: 16 MB
constexpr std::size_t kMaxAddedBytes = 40 << 20;  ///< bytes of these matrices; what comes after them stays as it is

/// Edits the nodes of a graph one by one.
class GraphEdit {
 public:
  explicit GraphEdit(std::string_view graph) : graph_(graph), constants_(onnx::constants_of(graph)) {
    for (const onnx::Field& part : onnx::fields_of(graph)) {
      if (part.id != onnx::kNode) continue;
      const Node node = onnx::read_node(part.bytes);
      if (node.type == "Unsqueeze" && node.outputs.size() == 1) unsqueezed_.emplace(node.outputs[0], node);
    }
  }

  /// @return nothing when no node is to be edited
  std::optional<std::string> run() {
    std::string text;
    bool edited = false;
    for (const onnx::Field& part : onnx::fields_of(graph_)) {
      const bool changed = part.id == onnx::kNode && edit(onnx::read_node(part.bytes), text);
      if (!changed) text += part.whole;
      edited |= changed;
    }
    for (const std::string& tensor : added_) onnx::append_bytes(text, onnx::kInitializer, tensor);
    return edited ? std::optional(text) : std::nullopt;
  }

 private:
  /// @param text of the new graph, which gets the nodes instead of `node` @return whether there are such nodes
  bool edit(const Node& node, std::string& text) {
    if (node.type == "Clip") return edit_clip(node, text);
    if (node.type != "Mul" || node.inputs.size() != 2 || node.outputs.size() != 1) return false;
    for (const std::size_t i : {0, 1})
      if (const auto rows = constant(node.inputs[i]); rows && !rows->floats.empty())
        return edit_product(node, node.inputs[1 - i], *rows, text);
    return false;
  }

  std::optional<Tensor> constant(const std::string& name) const {
    const auto found = constants_.find(name);
    return found == constants_.end() ? std::nullopt : onnx::read_tensor(found->second);
  }

  static void append(const Node& node, std::string& text) {
    onnx::append_bytes(text, onnx::kNode, onnx::write_node(node));
  }

  bool edit_clip(Node node, std::string& text) const {
    if (node.inputs.size() < 2) return false;
    for (std::size_t i = 1; i < node.inputs.size(); ++i) {
      if (node.inputs[i].empty()) continue;  // no limit
      const auto limit = constant(node.inputs[i]);
      if (!limit || limit->floats.size() != 1) return false;
      node.add_number(i == 1 ? "min" : "max", limit->floats[0]);
    }
    node.inputs.resize(1);
    append(node, text);
    return true;
  }

  /// @param other the factor that is not constant
  bool edit_product(const Node& node, const std::string& other, const Tensor& constant, std::string& text) {
    const auto& dims = constant.dims;
    const std::size_t rank = dims.size();
    if (rank == 0) return false;
    const std::int64_t row = dims[rank - 1], count = rank > 1 ? dims[rank - 2] : 1;
    const bool only_rows = std::all_of(dims.begin(), dims.end() - std::min<std::ptrdiff_t>(2, std::ssize(dims)),
                                       [](std::int64_t size) { return size == 1; });
    if (!only_rows || row < 2 || row * count > kMaxRow) return false;
    if (added_bytes_ + sizeof(float) * as_size(row * row * count) > kMaxAddedBytes) return false;
    if (count == 1) {
      append({"MatMul", node.name, {other, add_diagonals(node, constant, row, 1)}, node.outputs, {}}, text);
      return true;
    }
    const auto unsqueezed = unsqueezed_.find(other);
    const auto axis = unsqueezed == unsqueezed_.end() ? std::nullopt : unsqueezed->second.integers("axes");
    // The new axis stands before the last one: [..., s] became [..., 1, s].
    if (!axis || axis->size() != 1 || axis->front() != static_cast<std::int64_t>(rank) - 2) return false;
    if (unsqueezed->second.inputs.empty()) return false;
    const std::string rows = node.outputs[0] + "/rows", shape = node.outputs[0] + "/shape";
    Tensor sizes{{static_cast<std::int64_t>(rank)}, {}, std::vector<std::int64_t>(rank - 2, 0)};  // 0: as it is
    sizes.integers.insert(sizes.integers.end(), {count, row});
    added_.push_back(onnx::write_tensor(shape, sizes));
    append({"MatMul", rows, {unsqueezed->second.inputs[0], add_diagonals(node, constant, row, count)}, {rows}, {}},
           text);
    append({"Reshape", node.name, {rows, shape}, node.outputs, {}}, text);
    return true;
  }

  /// Adds the matrix [row, count * row] whose columns i * row + j have constant(i, j) in row j. @return its name
  std::string add_diagonals(const Node& node, const Tensor& constant, std::int64_t row, std::int64_t count) {
    Tensor matrix{{row, count * row}, std::vector<float>(row * row * count, 0.0f), {}};
    for (std::int64_t i = 0; i < count; ++i)
      for (std::int64_t j = 0; j < row; ++j) matrix.floats[(j * count + i) * row + j] = constant.floats[i * row + j];
    added_bytes_ += sizeof(float) * matrix.floats.size();
    const std::string name = node.outputs[0] + "/diagonals";
    added_.push_back(onnx::write_tensor(name, matrix));
    return name;
  }

  std::string_view graph_;
  std::map<std::string, std::string_view> constants_;
  std::map<std::string, Node> unsqueezed_;  ///< by output
  std::vector<std::string> added_;          ///< constants
  std::size_t added_bytes_ = 0;             ///< of matrices
};

}  // namespace

std::string readable_onnx(const std::string& onnx) {
  try {
    std::string text;
    bool edited = false;
    for (const onnx::Field& part : onnx::fields_of(onnx)) {
      const bool is_graph = part.id == onnx::kGraph && part.has_bytes;
      const auto graph = is_graph ? GraphEdit(part.bytes).run() : std::nullopt;
      if (graph)
        onnx::append_bytes(text, onnx::kGraph, *graph);
      else
        text += part.whole;
      edited |= graph.has_value();
    }
    return edited ? text : onnx;
  } catch (const onnx::NoMessage&) {
    return onnx;  // OpenCV says what is wrong
  }
}

}  // namespace doppel
