#include "doppel/view/web_folder.h"

#include <torch/script.h>

#include <algorithm>
#include <set>

#include "doppel/actor/onnx/onnx_constants.h"
#include "doppel/actor/onnx/onnx_model.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/fetch/package_files.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/scratch_folder.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/view/view_files.h"
#include "doppel/view/view_page.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;
using torch::jit::Stack;

const Package kRuntime = {
    "onnxruntime-web@1.30.0",
    {{"dist/ort.wasm.min.mjs", "219e6a1fc8a9938268d18efca3c91d310bd2f4a59bbd13744df5b2b7fc6cee3b"},
     {"dist/ort-wasm-simd-threaded.mjs", "e13f7f94fc51b4ca72b12faeb1ee95f4ace6dfbc8939bc718aabdc0a27c4299b"},
     {"dist/ort-wasm-simd-threaded.wasm", "3398c10d07d229bd91b364548e130e0e51a8e5704b88c7c083ebbeb78842dee2"}}};

/// A function as an ONNX model of any batch size. @param sample makes its inputs of a batch size from a seed
std::string traced_model(const ScriptFileWriter::Function& function,
                         const std::function<Stack(int, std::uint64_t)>& sample, const OnnxSignature& signature,
                         double tolerance, const QuantizedWeights& quantized,
                         const ScriptFileWriter::Compared& compared = nullptr) {
  ScriptFileWriter traced(ScriptKind::actor, {});
  traced.add("forward", sample(1, 1), function);
  traced.check("forward", sample(2, 2), function, {tolerance}, compared);
  return onnx_model(traced.module(), "forward", signature, {sample(1, 3), sample(2, 3)}, {}, &quantized);
}

std::string geometry_model(const ViewStage& stage, const ActorDescription& sizes, const QuantizedWeights& quantized) {
  const auto function = [&](const Stack& inputs) -> Stack { return {stage.vertices(inputs.at(0).toTensor())}; };
  const auto sample = [&](int batch, std::uint64_t seed) -> Stack { return {random_windows(sizes, batch, seed)}; };
  return traced_model(function, sample, {{"window"}, {"vertices"}}, kTraceTolerance, quantized);
}

/// The stage's texture or Gaussians. @param output their name @param compared as ScriptFileWriter::check
std::string look_model(const ViewStage& stage, const LookFunction& look, const char* output,
                       const ActorDescription& sizes, const QuantizedWeights& quantized,
                       const ScriptFileWriter::Compared& compared = nullptr) {
  const auto sample = [&](int batch, std::uint64_t seed) { return look_inputs(sizes, stage.vertices, batch, seed); };
  return traced_model(look_method(look), sample, {{"window", "projection", "vertices"}, {output}},
                      kTraceColourTolerance, quantized, compared);
}

std::string stage_model(const ViewStage& stage, const ActorDescription& sizes, const QuantizedWeights& quantized) {
  if (stage.gaussians) return look_model(stage, stage.gaussians, "gaussians", sizes, quantized, comparable_gaussians);
  if (stage.texture) return look_model(stage, stage.texture, "texture", sizes, quantized);
  return geometry_model(stage, sizes, quantized);
}

std::string joint_model(const Character& character, const ActorDescription& sizes) {
  Kinematics kinematics(character);
  const auto function = [&](const Stack& inputs) -> Stack {
    return {kinematics->joints(inputs.at(0).toTensor()).select(-1, 3)};
  };
  const auto sample = [&](int batch, std::uint64_t seed) -> Stack {
    return {random_windows(sizes, batch, seed).select(1, 0)};
  };
  return traced_model(function, sample, {{"dofs"}, {"joints"}}, kTraceTolerance, {});
}

void write_page(const fs::path& folder) {
  for (const ViewPageFile& file : kViewPage) {
    std::string text(file.content);
    // web/src/source.js reads this attribute.
    if (file.path == "/index.html") {
      const std::string mark = "data-source=\"server\"";
      text.replace(text.find(mark), mark.size(), "data-source=\"folder\"");
    }
    write_atomically(folder / fs::path(file.path).relative_path(), text);
  }
}

void write_models(const fs::path& folder, const ViewSubject& subject, const QuantizedWeights& quantized) {
  const torch::NoGradGuard no_grad;
  const ReferenceScope plain_operations;
  ActorDescription sizes;
  for (const Dof& dof : subject.character.skeleton.dofs) sizes.dof_names.push_back(dof.name);
  write_atomically(folder / "joints.onnx", joint_model(subject.character, sizes));
  for (const ViewStage& stage : subject.stages) {
    sizes.past_frames = stage.past_frames;
    write_atomically(folder / (stage.name + ".onnx"), stage_model(stage, sizes, quantized));
  }
}

void write_double(const fs::path& folder, const ViewSubject& subject, const QuantizedWeights& quantized) {
  const ViewFiles files = view_files(subject, subject.motion);
  write_atomically(folder / "description.json", files.description);
  write_atomically(folder / "mesh.bin", files.mesh);
  write_atomically(folder / "motion.bin", files.motion);
  if (!files.texture.empty()) write_atomically(folder / "texture.jpg", files.texture);
  write_models(folder, subject, quantized);
}

void copy_runtime(const fs::path& folder) {
  fs::create_directories(folder);
  for (const PackageFile& file : kRuntime.files) fs::copy_file(find_package_file(kRuntime, file), folder / file.name());
}

/// Whether a folder holds a page and nothing else, so that it can be replaced.
bool holds_a_page_alone(const fs::path& folder) {
  static const std::set<std::string> kOurs{"index.html", "assets", "double", "runtime"};
  return fs::exists(folder / "double" / "description.json") &&
         std::all_of(fs::directory_iterator(folder), {},
                     [](const auto& entry) { return kOurs.contains(entry.path().filename().string()); });
}

}  // namespace

void write_web_folder(const fs::path& folder, const ViewSubject& subject, const QuantizedWeights& quantized) {
  const fs::path target = folder_path(fs::absolute(folder));
  if (fs::exists(target) && !(fs::is_directory(target) && (fs::is_empty(target) || holds_a_page_alone(target))))
    fail<UsageError>("exporting a page: {} exists and holds other files than a page's; name another folder",
                     folder.string());
  fs::create_directories(target.parent_path());
  const ScratchFolder scratch(target.parent_path());
  const fs::path page = scratch.path() / "page";
  write_page(page);
  write_double(page / "double", subject, quantized);
  copy_runtime(page / "runtime");
  fs::remove_all(target);
  fs::rename(page, target);
}

NamedWeights read_web_constants(const fs::path& folder, const ViewSubject& subject) {
  NamedWeights all;
  for (const ViewStage& stage : subject.stages)
    for (auto& constant : read_onnx_constants(folder / "double" / (stage.name + ".onnx")))
      all.push_back(std::move(constant));
  return all;
}

}  // namespace doppel
