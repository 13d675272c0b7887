#pragma once

/// What the TorchScript files of this room have in common: functions traced into methods of one module, a
/// `metadata.json`, the template's faces; and the way back.

#include <torch/script.h>
#include <torch/torch.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "doppel/character/character.h"

namespace doppel {

enum class ScriptKind {
  actor,  ///< a motion goes in (actor_file.h)
  pose    ///< images go in (pose_file.h)
};
inline constexpr int kScriptVersion = 1;  ///< of both kinds

/// Networks and layers by the name that their parameters get in the file.
using ScriptModules = std::vector<std::pair<std::string, torch::nn::Module*>>;

/// A file in the making.
class ScriptFileWriter {
 public:
  using Function = std::function<torch::jit::Stack(const torch::jit::Stack&)>;

  /// @param modules what the functions compute with; their parameters and buffers become the file's
  ScriptFileWriter(ScriptKind kind, const ScriptModules& modules);

  /// Adds a function as the method `name`: `function` must map `inputs` to tensors. Several results become a tuple.
  /// @throws Error when it holds an operation that is not aten's
  void add(const std::string& name, const torch::jit::Stack& inputs, const Function& function);
  /// Holds a method against the function it was traced from, on other inputs: another batch size shows sizes that the
  /// trace has baked in.
  /// @param tolerances of each result: the largest difference allowed
  /// @throws Error naming the method and the number of the result that differs more
  void check(const std::string& name, const torch::jit::Stack& unseen, const Function& function,
             const std::vector<double>& tolerances) const;

  /// Writes the file whole: `metadata.json` with `metadata` after the kind and version; `faces.npy` [F,3] int32 and,
  /// where the template has them, `uvs.npy` [U,2] float32 and `face_uvs.npy` [F,3] int32.
  void save(const std::filesystem::path& path, const Character& character, const nlohmann::ordered_json& metadata);

 private:
  ScriptKind kind_;
  torch::jit::script::Module module_;
};

/// A file that was read back.
struct ScriptFile {
  torch::jit::script::Module module;  ///< in evaluation mode
  nlohmann::json metadata;
};
/// @throws FileError when it is not a file of that kind and version; for one of the other kind, with what it is
ScriptFile load_script_file(const std::filesystem::path& path, ScriptKind kind);
/// @throws FileError: `metadata` lacks what `error` names
[[noreturn]] void fail_metadata(const std::filesystem::path& path, ScriptKind kind,
                                const nlohmann::json::exception& error);

}  // namespace doppel
