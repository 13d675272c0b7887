#include "doppel/actor/export/script_check.h"

#include <caffe2/serialize/inline_container.h>
#include <minizip/unzip.h>
#include <torch/csrc/jit/ir/ir.h>

#include <memory>
#include <set>
#include <string_view>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr std::uint64_t kMaxUnpackedBytes = std::uint64_t{256} << 20;

/// Operators without a namespace: they read and write tensors and nothing else.
const std::set<std::string, std::less<>>& computing_operators() {
  // clang-format would put each name on a line of its own.
  // clang-format off
  static const std::set<std::string, std::less<>> names{
      "Bool", "Float", "Int", "IntImplicit", "ScalarImplicit", "__and__", "__getitem__", "__not__", "__or__",
      "_convolution", "abs", "acos", "adaptive_avg_pool2d", "add", "add_", "addmm", "alias", "all", "amax", "any",
      "arange", "argmax", "asin", "atan", "atan2", "baddbmm", "batch_norm", "bitwise_and", "bitwise_not", "bmm",
      "cat", "ceil", "clamp", "clamp_", "clamp_max", "clamp_min", "clamp_min_", "clone", "constant_pad_nd",
      "contiguous", "copy_", "cos", "cross", "cumsum", "detach", "div", "div_", "dropout", "elu", "elu_",
      "embedding_bag", "empty", "empty_like", "eq", "exp", "expand", "expand_as", "eye", "fill_", "flatten", "flip",
      "floor", "full", "full_like", "gather", "ge", "grid_sampler", "gt", "hardtanh", "hardtanh_", "index",
      "index_add", "index_add_", "index_copy", "index_copy_", "index_select", "isfinite", "le", "leaky_relu",
      "leaky_relu_", "linalg_cross", "linalg_det", "linalg_inv", "linalg_vector_norm", "linear", "log", "logical_and",
      "logical_not", "logical_or", "lt", "matmul", "max", "max_pool2d", "maximum", "mean", "min", "minimum", "mm",
      "mul", "mul_", "narrow", "ne", "neg", "neg_", "norm", "ones", "ones_like", "permute", "pixel_shuffle", "pow",
      "reciprocal", "relu", "relu_", "repeat", "reshape", "rsqrt", "rsub", "scatter_add", "scatter_add_", "select",
      "sigmoid", "sigmoid_", "sign", "sin", "size", "slice", "softmax", "softplus", "sqrt", "square", "squeeze",
      "stack", "sub", "sub_", "sum", "t", "tanh", "tanh_", "tensor", "to", "transpose", "type_as", "unbind",
      "unflatten", "unsqueeze", "upsample_bilinear2d", "upsample_nearest2d", "view", "where", "zero_", "zeros",
      "zeros_like"};
  // clang-format on
  return names;
}

const std::set<std::string, std::less<>>& primitives() {
  // clang-format would put each name on a line of its own.
  // clang-format off
  static const std::set<std::string, std::less<>> names{
      "CallMethod", "Constant", "GetAttr", "If", "ListConstruct", "ListUnpack", "NumToTensor", "TupleConstruct",
      "TupleIndex", "TupleUnpack", "unchecked_cast", "device", "dtype", "min", "max", "Loop", "Uninitialized"};
  // clang-format on
  return names;
}

/// The bytes that the compressed parts take in memory; parts that are not compressed take their share of the file.
std::uint64_t unpacked_bytes(const std::filesystem::path& path, const FileLocation& where) {
  const std::unique_ptr<void, int (*)(void*)> archive(unzOpen64(path.c_str()), unzClose);
  if (!archive) fail_at(where, "is not a TorchScript file, or is damaged");
  std::uint64_t total = 0;
  for (int state = unzGoToFirstFile(archive.get()); state == UNZ_OK; state = unzGoToNextFile(archive.get())) {
    unz_file_info64 info{};
    if (unzGetCurrentFileInfo64(archive.get(), &info, nullptr, 0, nullptr, 0, nullptr, 0) != UNZ_OK)
      fail_at(where, "its list of parts is damaged");
    if (info.compression_method == 0 && info.uncompressed_size == info.compressed_size) continue;
    if (info.uncompressed_size > kMaxUnpackedBytes) return info.uncompressed_size;
    total += info.uncompressed_size;
  }
  return total;
}

[[noreturn]] void refuse_script(const std::filesystem::path& shown, const std::string& fault) {
  fail_at({shown.string()}, "{}; no file of `doppel export` does so, and the file was not run", fault);
}

void check_part(const std::string& name, std::string_view content, const std::filesystem::path& shown) {
  for (const char* method : {"__setstate__", "__getstate__"})
    if (content.find(method) != std::string_view::npos)
      refuse_script(shown,
                    fmt::format("its part {} holds {}, which runs while a file is loaded or saved", name, method));
  constexpr std::string_view kClasses = "torch.classes.";
  for (std::size_t at = content.find(kClasses); at != std::string_view::npos; at = content.find(kClasses, at + 1))
    if (content.substr(at + kClasses.size(), 7) != "doppel.")
      refuse_script(shown, fmt::format("its part {} uses a class of another library", name));
}

void check_block(const torch::jit::Block* block, const std::filesystem::path& shown) {
  for (const torch::jit::Node* node : block->nodes()) {
    const std::string name = node->kind().toQualString();
    if (!is_script_operator(name)) refuse_script(shown, fmt::format("a function calls {}", name));
    for (const torch::jit::Block* inner : node->blocks()) check_block(inner, shown);
  }
}

}  // namespace

bool is_script_operator(const std::string& name) {
  const auto rest_of = [&](std::string_view space) {
    return name.starts_with(space) ? std::string_view(name).substr(space.size()) : std::string_view();
  };
  return !rest_of("doppel::").empty() || computing_operators().contains(rest_of("aten::")) ||
         primitives().contains(rest_of("prim::"));
}

void check_script_archive(const std::filesystem::path& path, const std::filesystem::path& shown) {
  const FileLocation where{shown.string()};
  const std::uint64_t bytes = unpacked_bytes(path, where);
  if (bytes > kMaxUnpackedBytes)
    refuse_script(shown, fmt::format("its compressed parts take more than {} MB", kMaxUnpackedBytes >> 20));
  try {
    // The same reader as that of torch::jit::load, so that both see the same parts.
    caffe2::serialize::PyTorchStreamReader reader(path.string());
    for (const std::string& name : reader.getAllRecords()) {
      if (!name.starts_with("code/") && !name.ends_with(".pkl")) continue;
      const auto [data, size] = reader.getRecord(name);
      check_part(name, {static_cast<const char*>(data.get()), size}, shown);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    fail_at(where, "is not a TorchScript file, or is damaged");
  }
}

void check_script_functions(const torch::jit::Module& module, const std::filesystem::path& shown) {
  for (const torch::jit::Module& part : module.modules()) {
    if (!part.type()->getForwardHooks().empty() || !part.type()->getForwardPreHooks().empty())
      refuse_script(shown, "it has hooks");
    for (const torch::jit::Method& method : part.get_methods()) check_block(method.graph()->block(), shown);
  }
}

}  // namespace doppel
