#include "doppel/actor/export/script_file.h"

#include <torch/csrc/jit/frontend/tracer.h>

#include <limits>
#include <sstream>

#include "doppel/actor/export/script_check.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/json_bounds.h"
#include "doppel/core/npy.h"
#include "doppel/core/scratch_folder.h"
#include "doppel/core/tensor/reference_scope.h"

namespace doppel {
namespace {

using torch::jit::Stack;

constexpr const char* kFusedFile = "fused.pt";  // the same methods with Doppel's ops, without parameters

struct KindWords {
  const char* type;      ///< of the TorchScript module
  const char* key;       ///< of metadata.json: the version
  const char* name;      ///< in messages
  const char* contents;  ///< explanation for users who expected the other kind
};
const KindWords& words_of(ScriptKind kind) {
  static const KindWords actor{"Actor", "doppel_actor", "actor",
                               "an actor, which takes a motion; files that take images come from `doppel export` on a "
                               "run of posenet or deepcap"};
  static const KindWords pose{"Pose", "doppel_pose", "pose file",
                              "a pose file, which takes images of a person (examples/capture_person.py); motions drive "
                              "actors, which come from `doppel export` on a run of egnet or ddc"};
  return kind == ScriptKind::actor ? actor : pose;
}

/// TorchScript attribute names cannot contain dots, so the tree of modules becomes a tree of script modules.
torch::jit::script::Module mirror(const torch::nn::Module& module, const std::string& name,
                                  const std::shared_ptr<torch::jit::CompilationUnit>& unit) {
  torch::jit::script::Module result("__torch__.doppel." + name, unit);
  for (const auto& p : module.named_parameters(/*recurse=*/false))
    if (p.value().defined()) result.register_parameter(p.key(), p.value(), /*is_buffer=*/false);
  for (const auto& b : module.named_buffers(/*recurse=*/false))
    if (b.value().defined()) result.register_buffer(b.key(), b.value());
  for (const auto& child : module.named_children())
    result.register_module(child.key(), mirror(*child.value(), name + "_" + child.key(), unit));
  return result;
}

void check_operations(const torch::jit::Block* block) {
  for (const torch::jit::Node* node : block->nodes()) {
    const std::string name = node->kind().toQualString();
    if (name.starts_with("doppel::")) fail("exporting: the traced function calls {}, which needs Doppel", name);
    if (!is_script_operator(name))
      fail("exporting: the traced function calls {}, which readers of the file refuse (script_check.cpp)", name);
    for (const torch::jit::Block* inner : node->blocks()) check_operations(inner);
  }
}

/// Several results as one tuple.
Stack packed(const Stack& results) {
  if (results.size() == 1) return results;
  return {c10::ivalue::Tuple::create(std::vector<torch::jit::IValue>(results.begin(), results.end()))};
}

template <typename Rows>
std::string index_bytes(const Rows& rows) {
  return npy_bytes(rows.data(), "<i4", {static_cast<std::int64_t>(rows.size()), 3});
}

/// The largest difference; infinite between tensors of different shapes or types.
double difference(const torch::Tensor& found, const torch::Tensor& expected) {
  if (!found.sizes().equals(expected.sizes()) || found.scalar_type() != expected.scalar_type())
    return std::numeric_limits<double>::infinity();
  return (found.to(torch::kFloat64) - expected.to(torch::kFloat64)).abs().max().item<double>();
}

}  // namespace

std::unordered_map<std::string, std::string> mesh_files(const TriangleMesh& mesh) {
  std::unordered_map<std::string, std::string> files;
  files["faces.npy"] = index_bytes(mesh.faces);
  if (mesh.uvs.empty()) return files;
  std::vector<float> uvs;
  for (const Eigen::Vector2d& uv : mesh.uvs) {
    uvs.push_back(static_cast<float>(uv.x()));
    uvs.push_back(static_cast<float>(uv.y()));
  }
  files["uvs.npy"] = npy_bytes(uvs.data(), "<f4", {static_cast<std::int64_t>(uvs.size() / 2), 2});
  files["face_uvs.npy"] = index_bytes(mesh.face_uvs);
  return files;
}

namespace {

torch::jit::script::Module module_of(ScriptKind kind, const ScriptModules& modules) {
  torch::jit::script::Module all(std::string("__torch__.doppel.") + words_of(kind).type,
                                 std::make_shared<torch::jit::CompilationUnit>());
  for (const auto& [name, module] : modules)
    all.register_module(name, mirror(*module, name, all._ivalue()->compilation_unit()));
  all.eval();
  return all;
}

void add_trace(torch::jit::script::Module& module, const std::string& name, const Stack& inputs,
               const ScriptFileWriter::Function& function) {
  if (module.hasattr(name)) fail("exporting: a method and a module are both named {}; readers would mix them up", name);
  const torch::NoGradGuard no_grad;
  const auto [state, outputs] = torch::jit::tracer::trace(
      inputs, [&](const Stack& given) { return packed(function(given)); },
      [](const torch::autograd::Variable&) { return std::string(); }, /*strict=*/true, /*force_outplace=*/false,
      &module);
  const auto full_name = c10::QualifiedName(*module.type()->name(), name);
  module.type()->addMethod(module._ivalue()->compilation_unit()->create_function(full_name, state->graph));
}

void check_method(torch::jit::script::Module& module, const std::string& name, const Stack& unseen,
                  const Stack& expected, const std::vector<double>& tolerances,
                  const ScriptFileWriter::Compared& compared) {
  const torch::NoGradGuard no_grad;
  const torch::jit::IValue found = module.get_method(name)(unseen);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const torch::Tensor result = expected.size() == 1 ? found.toTensor() : found.toTuple()->elements()[i].toTensor();
    const torch::Tensor wanted = expected[i].toTensor();
    const double found_difference =
        compared ? difference(compared(result), compared(wanted)) : difference(result, wanted);
    if (!(found_difference <= tolerances.at(i)))
      fail(
          "exporting: result {} of the traced `{}` differs from the model's by {:.2g} on other input; {:.2g} "
          "is allowed",
          i + 1, name, found_difference, tolerances.at(i));
  }
}

/// Parameters and buffers of `to` become those of `from`, which has the same tree of modules.
void share_tensors(torch::jit::script::Module& to, const torch::jit::script::Module& from) {
  for (const auto& value : from.named_attributes(/*recurse=*/false))
    if (value.value.isTensor()) to.setattr(value.name, value.value);
  for (const auto& child : from.named_children()) {
    torch::jit::script::Module inner = to.attr(child.name).toModule();
    share_tensors(inner, child.value);
  }
}

void drop_tensors(torch::jit::script::Module& module) {
  for (const auto& value : module.named_attributes(/*recurse=*/false))
    if (value.value.isTensor()) module.setattr(value.name, torch::empty({0}, value.value.toTensor().options()));
  for (const auto& child : module.named_children()) {
    torch::jit::script::Module inner = child.value;
    drop_tensors(inner);
  }
}

}  // namespace

ScriptFileWriter::ScriptFileWriter(ScriptKind kind, const ScriptModules& modules)
    : kind_(kind), module_(module_of(kind, modules)) {
  if (!in_reference_scope()) fused_ = module_of(kind, modules);
}

void ScriptFileWriter::add(const std::string& name, const Stack& inputs, const Function& function) {
  add_trace(module_, name, inputs, function);
  check_operations(module_.get_method(name).graph()->block());
  if (!fused_) return;
  const KernelTraceScope kernels;
  add_trace(*fused_, name, inputs, function);
}

void ScriptFileWriter::check(const std::string& name, const Stack& unseen, const Function& function,
                             const std::vector<double>& tolerances, const Compared& compared) {
  const torch::NoGradGuard no_grad;
  const Stack expected = function(unseen);
  check_method(module_, name, unseen, expected, tolerances, compared);
  if (fused_) check_method(*fused_, name, unseen, expected, tolerances, compared);
}

void ScriptFileWriter::save(const std::filesystem::path& path, const Character& character,
                            const nlohmann::ordered_json& metadata) {
  nlohmann::ordered_json all{{words_of(kind_).key, kScriptVersion}};
  all.update(metadata);
  torch::jit::ExtraFilesMap files = mesh_files(character.mesh);
  files["metadata.json"] = all.dump(1);
  if (fused_) {
    drop_tensors(*fused_);
    std::ostringstream fused;
    fused_->save(fused);
    files[kFusedFile] = fused.str();
  }
  // Not into a file at once: where a write fails, LibTorch ends the process, and it misses a failure of the last one.
  std::ostringstream bytes;
  module_.save(bytes, files);
  write_atomically(path, bytes.str());
}

namespace {

torch::jit::script::Module load_fused(const std::filesystem::path& path, const std::string& bytes,
                                      const torch::jit::script::Module& module) {
  try {
    const ScratchFolder folder;
    const std::filesystem::path file = folder.path() / kFusedFile;
    write_atomically(file, bytes);
    check_script_archive(file, path);
    torch::jit::script::Module fused = torch::jit::load(file.string());
    check_script_functions(fused, path);
    share_tensors(fused, module);
    fused.eval();
    return fused;
  } catch (const FileError&) {
    throw;
  } catch (const std::exception&) {
    fail_at({path.string()}, "its part {} is damaged; export the run again", kFusedFile);
  }
}

/// For the whole process. With the fuser of LibTorch 2.6, the second call of these files does not return. LibTorch of
/// Debian 12 has no fuser for CPUs.
void switch_fuser_off() {
  torch::jit::FusionStrategy none;
  torch::jit::setFusionStrategy(none);
}

}  // namespace

ScriptFile load_script_file(const std::filesystem::path& path, ScriptKind kind) {
  const FileLocation where{path.string()};
  const KindWords& words = words_of(kind);
  if (!std::filesystem::is_regular_file(path))
    fail_at(where, "is not a file; `doppel export` writes {}s from runs", words.name);
  ScriptFile file;
  torch::jit::ExtraFilesMap extra{
      {"metadata.json", ""}, {kFusedFile, ""}, {"faces.npy", ""}, {"uvs.npy", ""}, {"face_uvs.npy", ""}};
  switch_fuser_off();
  try {
    check_script_archive(path, path);
    file.module = torch::jit::load(path.string(), c10::nullopt, extra);
    check_script_functions(file.module, path);
  } catch (const FileError&) {
    throw;
  } catch (const std::exception&) {
    fail_at(where, "is not a TorchScript file, or is damaged; `doppel export` writes {}s", words.name);
  }
  const ScriptKind other = kind == ScriptKind::actor ? ScriptKind::pose : ScriptKind::actor;
  constexpr std::size_t kMaxDepth = 50;  // what copies or prints a JSON value calls itself for each level
  if (is_json_deeper_than(extra.at("metadata.json"), kMaxDepth))
    fail_at(where, "its metadata.json nests lists and objects more than {} deep", kMaxDepth);
  try {
    file.metadata = nlohmann::json::parse(extra.at("metadata.json"));
    if (file.metadata.contains(words_of(other).key)) fail_at(where, "is {}", words_of(other).contents);
    if (file.metadata.at(words.key) != kScriptVersion)
      fail_at(where, "is of version {}; {}s of version {} can be read", excerpt(file.metadata.at(words.key).dump()),
              words.name, kScriptVersion);
  } catch (const nlohmann::json::exception& e) {
    fail_metadata(path, kind, e);
  }
  if (!extra.at(kFusedFile).empty()) file.fused = load_fused(path, extra.at(kFusedFile), file.module);
  for (const char* name : {"faces.npy", "uvs.npy", "face_uvs.npy"})
    if (!extra.at(name).empty()) file.mesh[name] = extra.at(name);
  file.module.eval();
  return file;
}

void fail_metadata(const std::filesystem::path& path, ScriptKind kind, const nlohmann::json::exception& error) {
  fail_at({path.string()},
          "is a TorchScript file, but not a Doppel {}: its metadata.json is missing or incomplete ({})",
          words_of(kind).name, excerpt(error.what(), 200));
}

int metadata_integer(const nlohmann::json& value, const std::filesystem::path& path, const char* key, int least,
                     int most) {
  if (!value.is_number_integer() || value < least || value > most)
    fail_at({path.string()}, "its metadata.json gives {} for `{}`, allowed are whole numbers from {} to {}",
            excerpt(value.dump()), key, least, most);
  return value.get<int>();
}

}  // namespace doppel
