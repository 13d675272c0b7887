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
constexpr double kTraceTolerance = 1e-5;   // metres: what a host may rely on
constexpr double kColourTolerance = 1e-4;  // of 1

std::string metadata(const Character& character, const ActorDescription& d) {
  nlohmann::ordered_json json = {
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
  if (d.texture_size > 0)
    json["texture"] = {
        {"size", d.texture_size},
        {"method", "textured(window, projection [batch, 3, 4], pixels from world metres) -> (vertices, texture)"},
        {"output", "RGB [batch, size, size, 3], 0..1, row 0 at v = 1"}};
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

/// Adds `function`, traced on `inputs`, to the actor as the method `name`.
void trace_into(torch::jit::script::Module& actor, const std::string& name, const torch::jit::Stack& inputs,
                const std::function<torch::jit::IValue(const torch::jit::Stack&)>& function) {
  const auto [state, outputs] = torch::jit::tracer::trace(
      inputs, [&](torch::jit::Stack given) -> torch::jit::Stack { return {function(given)}; },
      [](const torch::autograd::Variable&) { return std::string(); }, /*strict=*/true, /*force_outplace=*/false,
      &actor);
  const auto full_name = c10::QualifiedName(*actor.type()->name(), name);
  actor.type()->addMethod(actor._ivalue()->compilation_unit()->create_function(full_name, state->graph));
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

/// Random poses around the one where all DoFs are 0. @return [batch, window, D]
torch::Tensor random_windows(const ActorDescription& description, int num_dofs, int batch, std::uint64_t seed) {
  return 0.3 * torch::randn({batch, description.window, num_dofs}, at::detail::createCPUGenerator(seed));
}

/// Cameras some metres away that look at the origin, more or less. @return [batch,3,4]
torch::Tensor random_projections(int batch, std::uint64_t seed) {
  torch::Tensor projection = 0.1 * torch::randn({batch, 3, 4}, at::detail::createCPUGenerator(seed));
  projection +=
      torch::tensor({500.0f, 0.0f, 256.0f, 900.0f, 0.0f, 500.0f, 256.0f, 700.0f, 0.0f, 0.0f, 1.0f, 3.0f}).view({3, 4});
  return projection;
}

void check_equal(const torch::Tensor& traced, const torch::Tensor& expected, double tolerance, const char* what) {
  if (!traced.sizes().equals(expected.sizes()) || !((traced - expected).abs().max().item<double>() <= tolerance))
    fail("exporting an actor: the traced {} differs from the model on input it has not seen", what);
}

void add_geometry(torch::jit::script::Module& actor, const ActorDescription& description, int num_dofs,
                  const ActorFunction& geometry) {
  trace_into(actor, "forward", {random_windows(description, num_dofs, 1, 1)},
             [&](const torch::jit::Stack& inputs) { return geometry(inputs.at(0).toTensor()); });
  check_operations(actor.get_method("forward").graph()->block());
  const torch::Tensor unseen = random_windows(description, num_dofs, 3, 2);
  check_equal(actor.forward({unseen}).toTensor(), geometry(unseen), kTraceTolerance, "geometry");
}

void add_texture(torch::jit::script::Module& actor, const ActorDescription& description, int num_dofs,
                 const ActorFunctions& functions) {
  trace_into(actor, "textured", {random_windows(description, num_dofs, 1, 3), random_projections(1, 3)},
             [&](const torch::jit::Stack& inputs) {
               const torch::Tensor window = inputs.at(0).toTensor();
               const torch::Tensor texture = functions.texture(window, inputs.at(1).toTensor());
               return c10::ivalue::Tuple::create({functions.geometry(window), texture});
             });
  check_operations(actor.get_method("textured").graph()->block());
  const torch::Tensor window = random_windows(description, num_dofs, 2, 4), projection = random_projections(2, 4);
  const auto traced = actor.get_method("textured")({window, projection}).toTuple();
  check_equal(traced->elements()[0].toTensor(), functions.geometry(window), kTraceTolerance, "geometry");
  check_equal(traced->elements()[1].toTensor(), functions.texture(window, projection), kColourTolerance, "texture");
}

}  // namespace

void write_actor(const std::filesystem::path& path, const Character& character, const ActorDescription& description,
                 const ActorFunctions& functions,
                 const std::vector<std::pair<std::string, torch::nn::Module*>>& modules) {
  torch::NoGradGuard no_grad;
  const auto unit = std::make_shared<torch::jit::CompilationUnit>();
  torch::jit::script::Module actor("__torch__.doppel.Actor", unit);
  for (const auto& [name, module] : modules) actor.register_module(name, mirror(*module, name, unit));
  add_geometry(actor, description, character.num_dofs(), functions.geometry);
  if (functions.texture) add_texture(actor, description, character.num_dofs(), functions);
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
    if (json.contains("texture")) d.texture_size = json.at("texture").at("size");
  } catch (const nlohmann::json::exception& e) {
    fail_at(where, "is a TorchScript file, but not a Doppel actor: its metadata.json is missing or incomplete ({})",
            e.what());
  }
  actor.module_.eval();
  return actor;
}

void ActorFile::check_window(const torch::Tensor& window) const {
  const auto dofs = static_cast<std::int64_t>(description_.dof_names.size());
  if (window.dim() != 3 || window.size(1) != description_.window || window.size(2) != dofs)
    fail("posing the actor {}: it takes windows of shape [batch, {}, {}], found {}", description_.name,
         description_.window, dofs, fmt::to_string(fmt::join(window.sizes().vec(), " x ")));
}

torch::Tensor ActorFile::forward(const torch::Tensor& window) const {
  check_window(window);
  torch::NoGradGuard no_grad;
  return module_.forward({window}).toTensor();
}

std::pair<torch::Tensor, torch::Tensor> ActorFile::textured(const torch::Tensor& window,
                                                            const torch::Tensor& projection) const {
  check_window(window);
  if (description_.texture_size == 0)
    fail("dressing the actor {}: the file holds its geometry only; export a run whose TexNet is trained",
         description_.name);
  if (projection.dim() != 3 || projection.size(0) != window.size(0) || projection.size(1) != 3 ||
      projection.size(2) != 4)
    fail("dressing the actor {}: it takes a projection of shape [{}, 3, 4], found {}", description_.name,
         window.size(0), fmt::to_string(fmt::join(projection.sizes().vec(), " x ")));
  torch::NoGradGuard no_grad;
  const auto result = module_.get_method("textured")({window, projection}).toTuple();
  return {result->elements()[0].toTensor(), result->elements()[1].toTensor()};
}

}  // namespace doppel
