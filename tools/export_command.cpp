#include <fmt/ranges.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.h"
#include "doppel/actor/export/actor_file.h"
#include "doppel/actor/export/actor_weights.h"
#include "doppel/actor/export/onnx_file.h"
#include "doppel/actor/export/pose_file.h"
#include "doppel/actor/export/quantized_export.h"
#include "doppel/actor/onnx/onnx_constants.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/actor/trained_pose.h"
#include "doppel/core/error.h"
#include "doppel/view/web_folder.h"

namespace doppel::tools {
namespace {

struct ExportArguments {
  std::string run, capture, out, motion, format = "torchscript";
  int quantize = 0;  ///< bits; 0: float32
  bool geometry_only = false, pose_only = false;
};

/// The quantized weights of some networks as --quantize wants them, and what a written file is compared on.
struct Quantization {
  QuantizedWeights weights;
  ModelSamples samples;

  /// @param make_samples called with --quantize alone
  Quantization(const ExportArguments& arguments, const ScriptModules& modules,
               const std::function<ModelSamples()>& make_samples) {
    if (arguments.quantize == 0) return;
    weights = QuantizedWeights(modules, arguments.quantize);
    samples = make_samples();
  }

  /// Prints the report of an export, with the error of what was written. If that cannot be used, it is removed.
  /// @param text for people, whole lines @param written files and folders @param read reads their tensors
  void report(const CommonOptions& common, nlohmann::ordered_json json, std::string text,
              const std::vector<std::filesystem::path>& written, const std::function<NamedWeights()>& read) const {
    if (weights.bits() > 0) {
      try {
        const QuantizationReport compared = compare_quantized(weights, read(), samples);
        json["quantized"] = compared.to_json();
        text += compared.to_text();
      } catch (...) {
        for (const std::filesystem::path& path : written) std::filesystem::remove_all(path);
        throw;
      }
    }
    if (common.json)
      std::cout << json << "\n";
    else
      std::cout << text;
  }
};

ActorDescription describe(const TrainedActor& trained) {
  ActorDescription description;
  description.name = trained.character.name;
  description.past_frames = trained.past_frames();
  for (const Dof& dof : trained.character.skeleton.dofs) description.dof_names.push_back(dof.name);
  for (const Joint& joint : trained.character.skeleton.joints) description.joint_names.push_back(joint.name);
  description.num_vertices = trained.character.num_vertices();
  description.frames_per_second = trained.frames_per_second;
  description.fingerprint = trained.character.fingerprint();
  if (trained.texnet) description.texture_size = trained.texnet->config().texture_size();
  if (trained.gaussians) description.num_gaussians = trained.gaussians->count();
  return description;
}

std::vector<std::pair<std::string, torch::nn::Module*>> modules_of(TrainedActor& trained) {
  std::vector<std::pair<std::string, torch::nn::Module*>> modules = {{"egnet", trained.egnet.get()},
                                                                     {"surface", trained.surface.get()}};
  if (trained.deltanet) modules.emplace_back("deltanet", trained.deltanet.get());
  if (trained.texnet) modules.emplace_back("texnet", trained.texnet.get());
  if (trained.gaussians) modules.emplace_back("surface_gaussians", trained.gaussians.get());
  return modules;
}

ActorFunctions functions_of(TrainedActor& trained) {
  ActorFunctions functions{[&](const torch::Tensor& window) { return trained.fine(window); }};
  if (trained.texnet)
    functions.texture = [&](const torch::Tensor& window, const torch::Tensor& projection,
                            const torch::Tensor& vertices) { return trained.texture(window, projection, vertices); };
  if (trained.gaussians)
    functions.gaussians = [&](const torch::Tensor& window, const torch::Tensor& projection,
                              const torch::Tensor& vertices) {
      return trained.gaussian_rows(window, projection, vertices);
    };
  return functions;
}

std::string extension_of(const std::string& format) { return format == "torchscript" ? "pt" : format; }

/// The output file; its default is in the run folder.
std::filesystem::path out_path(const ExportArguments& arguments, const std::string& name) {
  return arguments.out.empty() ? std::filesystem::path(arguments.run) / name : std::filesystem::path(arguments.out);
}

void export_actor(const ExportArguments& arguments, const std::optional<std::filesystem::path>& capture,
                  const CommonOptions& common) {
  if (arguments.pose_only)
    fail<UsageError>("--pose-only: {} has no DefNet to leave out; the option is for runs of deepcap", arguments.run);
  const std::filesystem::path out = out_path(arguments, "actor." + extension_of(arguments.format));
  const bool weights_alone = arguments.format == "safetensors";
  if (weights_alone && out.extension() == ".json")
    fail<UsageError>(
        "--out: {} is where the description of the weights is written; name another extension, such as "
        ".safetensors",
        out.string());
  TrainedActor trained = TrainedActor::load(arguments.run, capture);
  if (arguments.geometry_only) {
    trained.texnet = nullptr;
    trained.gaussians = nullptr;
  }
  const ActorFunctions functions = functions_of(trained);
  const ScriptModules modules = modules_of(trained);
  const Quantization quantization(arguments, modules, [&] {
    return actor_samples_of(trained.subject.open_dataset(), functions, trained.past_frames());
  });
  if (weights_alone)
    write_actor_weights(out, trained.character, describe(trained), modules, quantization.weights);
  else if (arguments.format == "onnx")
    write_actor_onnx(out, trained.character, describe(trained), functions, modules, quantization.weights);
  else
    write_actor(out, trained.character, describe(trained), functions, modules);
  const auto bytes = std::filesystem::file_size(out);
  std::vector<std::filesystem::path> written{out};
  if (weights_alone) written.push_back(std::filesystem::path(out).replace_extension(".json"));
  const std::string last = trained.gaussians ? "gaussians" : trained.texnet ? "texnet" : trained.geometry_name();
  quantization.report(common, {{"actor", out.string()}, {"bytes", bytes}, {"steps", trained.steps}},
                      fmt::format("actor {}: {} vertices from windows of {} poses, {} kB, up to {}\n", out.string(),
                                  trained.character.num_vertices(), trained.past_frames() + 1, bytes / 1000, last),
                      written, [&] { return weights_alone ? read_safetensors(out) : read_onnx_constants(out); });
}

/// What a page shows of an actor: the surface of its last stage, with its looks.
ActorFunctions functions_of(const ViewSubject& subject) {
  ActorFunctions functions{subject.stages.back().vertices};
  for (const ViewStage& stage : subject.stages) {
    if (stage.texture) functions.texture = stage.texture;
    if (stage.gaussians) functions.gaussians = stage.gaussians;
  }
  return functions;
}

void export_page(const ExportArguments& arguments, const CommonOptions& common) {
  ViewOptions options;
  options.motion = arguments.motion;
  options.capture = arguments.capture;
  options.geometry_only = arguments.geometry_only;
  if (arguments.pose_only)
    fail<UsageError>("--pose-only: a page has no PoseNet; the option is for runs of deepcap in other formats");
  if (arguments.out.empty() && !std::filesystem::is_directory(arguments.run))
    fail<UsageError>("--out: {} is no folder that could hold the page; name one", arguments.run);
  const ViewSubject subject = open_view_subject(arguments.run, options);
  if (subject.sequence) fail<UsageError>("--format web: {} has no character, and a page shows one", arguments.run);
  if (arguments.geometry_only && subject.networks.empty())
    fail<UsageError>("--geometry-only: {} has no network to leave out; the option is for runs of ddc", arguments.run);
  const std::filesystem::path out = out_path(arguments, "web");
  if (arguments.quantize > 0 && subject.networks.empty())
    fail<UsageError>("--quantize: the page of {} has no networks; the option is for runs of egnet and ddc",
                     arguments.run);
  const Quantization quantization(arguments, subject.networks, [&] {
    const std::filesystem::path capture =
        arguments.capture.empty() ? run_subject(arguments.run).capture : std::filesystem::path(arguments.capture);
    return actor_samples_of(Dataset::open(capture), functions_of(subject), subject.stages.back().past_frames);
  });
  write_web_folder(out, subject, quantization.weights);
  std::vector<std::string> stages;
  for (const ViewStage& stage : subject.stages) stages.push_back(stage.name);
  quantization.report(common, {{"page", out.string()}, {"stages", stages}},
                      fmt::format("page {0}: stages {1}, {2} frames. Any file server serves this folder, for example\n"
                                  "  python3 -m http.server --directory {0}\n",
                                  out.string(), fmt::join(stages, ", "), subject.motion.num_frames()),
                      {out}, [&] { return read_web_constants(out, subject); });
}

void export_pose(const ExportArguments& arguments, const std::optional<std::filesystem::path>& capture,
                 const CommonOptions& common) {
  if (arguments.geometry_only)
    fail<UsageError>(
        "--geometry-only: {} is a run of deepcap and has no TexNet to leave out; --pose-only leaves DefNet out",
        arguments.run);
  if (arguments.format == "safetensors")
    fail<UsageError>("--format safetensors: {} is a run of deepcap, which is exported as torchscript or onnx",
                     arguments.run);
  TrainedPose trained = TrainedPose::load(arguments.run, capture, /*with_defnet=*/!arguments.pose_only);
  const std::filesystem::path out = out_path(arguments, "pose." + extension_of(arguments.format));
  ScriptModules networks{{"posenet", trained.posenet.get()}};
  if (trained.defnet) networks.emplace_back("defnet", trained.defnet.get());
  const Quantization quantization(arguments, networks,
                                  [&] { return pose_samples_of(trained.subject.open_dataset(), trained); });
  if (arguments.format == "onnx")
    write_pose_onnx(out, trained, quantization.weights);
  else
    write_pose_file(out, trained);
  const auto bytes = std::filesystem::file_size(out);
  quantization.report(
      common, {{"pose", out.string()}, {"bytes", bytes}, {"steps", trained.steps}},
      fmt::format("pose {}: {} DoFs, {} landmarks, {} vertices from images of {} x {}, {} kB, up to {}\n", out.string(),
                  trained.character.num_dofs(), trained.landmarks.size(), trained.character.num_vertices(),
                  trained.input_size(), trained.input_size(), bytes / 1000, trained.defnet ? "defnet" : "posenet"),
      {out}, [&] { return read_onnx_constants(out); });
}

int run(const ExportArguments& arguments, const CommonOptions& common) {
  const auto capture =
      arguments.capture.empty() ? std::nullopt : std::make_optional<std::filesystem::path>(arguments.capture);
  if (!arguments.motion.empty() && arguments.format != "web")
    fail<UsageError>("--motion: a {} file holds no motion; the option is for --format web", arguments.format);
  if (arguments.quantize > 0 && arguments.format == "torchscript")
    fail<UsageError>(
        "--quantize: parameters of a torchscript file are float32, for gradients and for Doppel's kernels; the option "
        "is for --format onnx, safetensors and web");
  if (arguments.format == "web")
    export_page(arguments, common);
  else if (captures_poses(arguments.run))
    export_pose(arguments, capture, common);
  else
    export_actor(arguments, capture, common);
  return 0;
}

}  // namespace

Command add_export(CLI::App& program) {
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App* app = program.add_subcommand(
      "export", "Write a trained actor, or trained pose networks, for other programs and for browsers");
  app->add_option("--run", arguments->run, "Folder of a run")->required();
  app->add_option("--capture", arguments->capture, "Prepared capture, if it was moved after training");
  app->add_option("--out", arguments->out,
                  "The file or folder to write (default: actor.pt, actor.onnx, actor.safetensors, web, pose.pt or "
                  "pose.onnx in RUN)");
  app->add_option("--format", arguments->format,
                  "torchscript: networks for LibTorch and PyTorch; onnx: networks for ONNX Runtime, in programs and "
                  "browsers; safetensors: weights and character for a host of one's own, and a .json that describes "
                  "them; web: a folder with a page that shows the actor, for any file server")
      ->check(CLI::IsMember({"torchscript", "onnx", "safetensors", "web"}))
      ->capture_default_str();
  app->add_option("--motion", arguments->motion,
                  "web: the motion to play, as for `doppel animate` (default: a test sequence of the capture)");
  app->add_option("--quantize", arguments->quantize,
                  "onnx, safetensors, web: bits of the networks' weights, 16 or 8 instead of 32. The export measures "
                  "the error on poses of the capture")
      ->check(CLI::IsMember({8, 16}));
  app->add_flag("--geometry-only", arguments->geometry_only,
                "Actor: leave TexNet and the Gaussians out; the file is smaller and gives only vertices");
  app->add_flag("--pose-only", arguments->pose_only,
                "Run of deepcap: leave DefNet out; the file is smaller and gives skinned vertices");
  app->footer(
      "Examples:\n"
      "  doppel export --run runs/anna --out anna.pt               # motion -> vertices, texture, Gaussians\n"
      "  doppel export --run runs/anna --format onnx --out anna.onnx\n"
      "  doppel export --run runs/anna --format onnx --quantize 8 --out small.onnx\n"
      "  doppel export --run runs/anna --format safetensors --out anna.safetensors\n"
      "  doppel export --run runs/anna --format web --out page      # a page without a server of its own\n"
      "  doppel export --run runs/anna-deepcap --out pose.pt       # image, keypoints -> pose, landmarks, vertices");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
