#include "doppel/export/actor_file.h"

#include <fmt/ranges.h>
#include <torch/csrc/jit/frontend/tracer.h>

#include <nlohmann/json.hpp>
#include <unordered_map>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"

namespace doppel {
namespace {

constexpr int kActorVersion = 1;
constexpr double kTraceTolerance = 1e-5;  // metres: what a host may rely on

std::string metadata(const Character& character, const ActorDescription& d) {
  const nlohmann::ordered_json json = {
      {"doppel_actor", kActorVersion},
      {"name", d.name},
      {"input", "DoF window [batch, window, dofs], oldest frame first, in the units of the motion file"},
      {"output", "posed vertices [batch, vertices, 3]"},
      {"units", "metres"},
      {"world", "right-handed, y up"},
      {"window", d.window},
      {"frames_per_second", d.frames_per_second},
      {"num_vertices", character.num_vertices()},
      {"num_dofs", character.num_dofs()},
      {"dof_names", d.dof_names},
      {"joint_names", d.joint_names},
      {"fingerprint", d.fingerprint},
  };
  return json.dump(1);
}

template <typename Rows>
std::string index_bytes(const Rows& rows) {
  return npy_bytes(rows.data(), "<i4", {static_cast<std::int64_t>(rows.size()), 3});
}

torch::jit::ExtraFilesMap extra_files(const Character& character, const ActorDescription& description) {
  torch::jit::ExtraFilesMap files;
  files["metadata.json"] = metadata(character, description);
  files["faces.npy"] = index_bytes(character.mesh.faces);
  if (!character.mesh.uvs.empty()) {
    std::vector<float> uvs;
    for (const Eigen::Vector2d& uv : character.mesh.uvs) {
      uvs.push_back(static_cast<float>(uv.x()));
      uvs.push_back(static_cast<float>(uv.y()));
    }
    files["uvs.npy"] = npy_bytes(uvs.data(), "<f4", {static_cast<std::int64_t>(uvs.size() / 2), 2});
    files["face_uvs.npy"] = index_bytes(character.mesh.face_uvs);
  }
  return files;
}

/// TorchScript attribute names hold no dots; the tree of modules becomes a tree of script modules.
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

void trace_into(torch::jit::script::Module& actor, const ActorFunction& forward, const torch::Tensor& example) {
  const auto [state, outputs] = torch::jit::tracer::trace(
      {example}, [&](torch::jit::Stack inputs) -> torch::jit::Stack { return {forward(inputs.at(0).toTensor())}; },
      [](const torch::autograd::Variable&) { return std::string(); }, /*strict=*/true, /*force_outplace=*/false,
      &actor);
  const auto name = c10::QualifiedName(*actor.type()->name(), "forward");
  actor.type()->addMethod(actor._ivalue()->compilation_unit()->create_function(name, state->graph));
}

void check_operations(const torch::jit::Block* block) {
  for (const torch::jit::Node* node : block->nodes()) {
    const std::string space = node->kind().ns().toUnqualString();
    if (space != "aten" && space != "prim")
      fail("exporting an actor: the traced function calls {}, which no host without Doppel has",
           node->kind().toQualString());
    for (const torch::jit::Block* inner : node->blocks()) check_operations(inner);
  }
}

}  // namespace

void write_actor(const std::filesystem::path& path, const Character& character, const ActorDescription& description,
                 const ActorFunction& forward, const std::vector<std::pair<std::string, torch::nn::Module*>>& modules) {
  torch::NoGradGuard no_grad;
  const auto unit = std::make_shared<torch::jit::CompilationUnit>();
  torch::jit::script::Module actor("__torch__.doppel.Actor", unit);
  for (const auto& [name, module] : modules) actor.register_module(name, mirror(*module, name, unit));

  const auto window = [&](int batch, std::uint64_t seed) {
    auto generator = at::detail::createCPUGenerator(seed);
    return 0.3 * torch::randn({batch, description.window, character.num_dofs()}, generator);
  };
  trace_into(actor, forward, window(1, 1));
  check_operations(actor.get_method("forward").graph()->block());

  const torch::Tensor unseen = window(3, 2);
  const torch::Tensor traced = actor.forward({unseen}).toTensor(), expected = forward(unseen);
  if (!traced.sizes().equals(expected.sizes()) || !((traced - expected).abs().max().item<double>() <= kTraceTolerance))
    fail("exporting an actor: the traced function differs from the model on a window it has not seen");

  actor.eval();
  const torch::jit::ExtraFilesMap files = extra_files(character, description);
  write_atomically(path, [&](const std::filesystem::path& temporary) { actor.save(temporary.string(), files); });
}

ActorFile ActorFile::load(const std::filesystem::path& path) {
  const FileLocation where{path.string()};
  if (!std::filesystem::is_regular_file(path)) fail_at(where, "is not a file; `doppel export` writes actor files");
  ActorFile actor;
  torch::jit::ExtraFilesMap files{{"metadata.json", ""}};
  try {
    actor.module_ = torch::jit::load(path.string(), c10::nullopt, files);
  } catch (const std::exception&) {
    fail_at(where, "is not a TorchScript file, or is damaged; `doppel export` writes actor files");
  }
  try {
    const nlohmann::json json = nlohmann::json::parse(files.at("metadata.json"));
    if (json.at("doppel_actor") != kActorVersion)
      fail_at(where, "is an actor file of version {}; version {} can be read", json.at("doppel_actor").dump(),
              kActorVersion);
    ActorDescription& d = actor.description_;
    d.name = json.at("name");
    d.window = json.at("window");
    d.dof_names = json.at("dof_names").get<std::vector<std::string>>();
    d.joint_names = json.at("joint_names").get<std::vector<std::string>>();
    d.num_vertices = json.at("num_vertices");
    d.frames_per_second = json.at("frames_per_second");
    d.fingerprint = json.at("fingerprint");
  } catch (const nlohmann::json::exception& e) {
    fail_at(where, "is a TorchScript file, but not a Doppel actor: its metadata.json is missing or incomplete ({})",
            e.what());
  }
  actor.module_.eval();
  return actor;
}

torch::Tensor ActorFile::forward(const torch::Tensor& window) const {
  const auto dofs = static_cast<std::int64_t>(description_.dof_names.size());
  if (window.dim() != 3 || window.size(1) != description_.window || window.size(2) != dofs)
    fail("posing the actor {}: it takes windows of shape [batch, {}, {}], found {}", description_.name,
         description_.window, dofs, fmt::to_string(fmt::join(window.sizes().vec(), " x ")));
  torch::NoGradGuard no_grad;
  return module_.forward({window}).toTensor();
}

}  // namespace doppel
