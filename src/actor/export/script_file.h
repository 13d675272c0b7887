#pragma once

/// The common part of this module's TorchScript files: functions traced into methods of one script module, a
/// `metadata.json`, the template's faces, and reading such a file.

#include <torch/nn/module.h>
#include <torch/script.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

enum class ScriptKind {
  actor,  ///< a motion goes in (actor_file.h)
  pose    ///< images go in (pose_file.h)
};
inline constexpr int kScriptVersion = 1;  ///< of both kinds

/// Networks and layers, by the names of their parameters in the file.
using ScriptModules = std::vector<std::pair<std::string, torch::nn::Module*>>;

/// Builds and writes a TorchScript file.
class ScriptFileWriter {
 public:
  using Function = std::function<torch::jit::Stack(const torch::jit::Stack&)>;
  using Compared = std::function<torch::Tensor(const torch::Tensor&)>;

  /// @param modules the modules that the functions use; their parameters and buffers are saved in the file
  ScriptFileWriter(ScriptKind kind, const ScriptModules& modules);

  /// Adds a function as the method `name`: `function` must map `inputs` to tensors. Several results become a tuple.
  /// @throws Error when the trace contains an operation that is not aten's
  void add(const std::string& name, const torch::jit::Stack& inputs, const Function& function);
  /// Compares a method with the function it was traced from on other inputs. Another batch size detects sizes that the
  /// trace has fixed.
  /// @param tolerances largest allowed difference of each result
  /// @param compared what is compared of every result; nothing: the result itself
  /// @throws Error naming the method and the index of a result that differs more
  void check(const std::string& name, const torch::jit::Stack& unseen, const Function& function,
             const std::vector<double>& tolerances, const Compared& compared = nullptr);

  /// What was added, in evaluation mode.
  const torch::jit::script::Module& module() const { return module_; }

  /// Writes the file atomically. It contains `metadata.json` with the kind, the version and `metadata`; `faces.npy`
  /// [F,3] int32 and, where the template has them, `uvs.npy` [U,2] float32 and `face_uvs.npy` [F,3] int32.
  void save(const std::filesystem::path& path, const Character& character, const nlohmann::ordered_json& metadata);

 private:
  ScriptKind kind_;
  torch::jit::script::Module module_;  ///< plain aten operations
  /// The same methods with Doppel's ops; nothing in a ReferenceScope, where traces hold none.
  std::optional<torch::jit::script::Module> fused_;
};

/// The template's topology as the bytes of .npy files, by name: `faces.npy` and, where it has them, `uvs.npy`,
/// `face_uvs.npy`.
std::unordered_map<std::string, std::string> mesh_files(const TriangleMesh& mesh);

/// A file that was read.
struct ScriptFile {
  torch::jit::script::Module module;  ///< in evaluation mode; any batch size
  /// The same methods on Doppel's kernels: several times faster. Shares the parameters.
  std::optional<torch::jit::script::Module> fused;
  torch::jit::script::Module& fastest() { return fused ? *fused : module; }
  nlohmann::json metadata;
  std::unordered_map<std::string, std::string> mesh;  ///< as mesh_files
};
/// @throws FileError when it is not a file of this kind and version; for a file of the other kind, the message says so
ScriptFile load_script_file(const std::filesystem::path& path, ScriptKind kind);
/// @throws FileError that says which key of `metadata` is missing, as named by `error`
[[noreturn]] void fail_metadata(const std::filesystem::path& path, ScriptKind kind,
                                const nlohmann::json::exception& error);
/// A whole number of `metadata`. @throws FileError when `value` is none, or outside of least..most
int metadata_integer(const nlohmann::json& value, const std::filesystem::path& path, const char* key, int least,
                     int most);
/// Vertices of a file that is read.
inline constexpr int kMaxScriptVertices = 100'000'000;
/// Sides of images in pixels, and frames of a window, in a file that is read.
inline constexpr int kMaxScriptSide = 16384;

}  // namespace doppel
