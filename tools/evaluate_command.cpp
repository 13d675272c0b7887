#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/eval/cloud_metrics.h"
#include "doppel/eval/image_metrics.h"
#include "doppel/eval/silhouette_overlap.h"
#include "doppel/losses/chamfer.h"
#include "doppel/render/buffers.h"
#include "doppel/render/face_tensor.h"
#include "doppel/render/shading/shading.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/stage_chain.h"
#include "doppel/train/trained_actor.h"
#include "pose_evaluation.h"
#include "pose_run.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kExample[] =
    "Example:\n"
    "  doppel evaluate --run runs/anna --split test --json\n"
    "Without --run, pure skinning is evaluated alone: doppel evaluate --capture prepared/anna";

struct Arguments {
  std::string run, capture, split = "test";
  EvaluationOptions options;
};

std::vector<Split> splits_to_evaluate(const Dataset& dataset, const std::string& word) {
  if (word != "all") return {parse_split(word)};
  std::vector<Split> splits;
  for (Split split : {Split::train, Split::test})
    if (!dataset.samples(split).empty()) splits.push_back(split);
  return splits;
}

/// DoF windows of samples, [B,F+1,D].
torch::Tensor windows(const Dataset& dataset, const std::vector<SampleId>& samples, int window) {
  std::vector<torch::Tensor> all;
  for (const SampleId& sample : samples) all.push_back(dataset.dof_window(sample, window));
  return torch::stack(all);
}

/// What is evaluated: a character, and, with a run, its trained model: one of the two.
struct Subject {
  std::optional<TrainedActor> actor;
  std::optional<TrainedPose> pose;
  std::optional<Character> untrained;
  CharacterSurface surface{nullptr};
  const Character& character() const { return actor ? actor->character : pose ? pose->character : *untrained; }
};

/// The ways to colour the finished geometry that the actor knows. One that was trained on silhouettes alone has none:
/// its pictures would only say that nobody learnt from pictures.
std::vector<std::string> picture_methods(const TrainedActor& actor) {
  std::vector<std::string> methods;
  if (!actor.lighting && !actor.deltanet && !actor.texnet) return methods;
  if (actor.static_texture.defined()) methods.push_back("static");
  if (actor.static_texture.defined() && actor.lighting) methods.push_back("lit");
  if (actor.texnet) methods.push_back("texnet");
  if (actor.hybrid) methods.push_back("radiance");
  if (actor.nerf) methods.push_back("nerf");
  return methods;
}

/// What the camera of a request sees of a radiance field in one of its frames.
FieldPicture field_picture(const Dataset& dataset, TrainedActor& actor, const std::string& method,
                           const ImageRequest& request, std::size_t b) {
  const torch::Tensor projection = request.projection[static_cast<std::int64_t>(b)][0];
  if (method == "nerf") return actor.nerf->draw(projection, request.size, request.size);
  const torch::Tensor window = windows(dataset, {request.samples[b]}, actor.window());
  return actor.radiance(window, projection, request.size, request.size);
}

/// Covered is what is more than half there; its colour is that of the person alone.
ImageFunction field_function(const Dataset& dataset, TrainedActor& actor, const std::string& method) {
  return [&dataset, &actor, method](const ImageRequest& request) {
    std::vector<torch::Tensor> colour, covered;
    for (std::size_t b = 0; b < request.samples.size(); ++b) {
      const FieldPicture seen = field_picture(dataset, actor, method, request, b);
      colour.push_back(seen.colour / seen.opacity.clamp_min(0.5).unsqueeze(2));
      covered.push_back(seen.opacity > 0.5);
    }
    return RenderedImages{torch::stack(colour), torch::stack(covered)};
  };
}

CloudFunction cloud_function(const Dataset& dataset, TrainedActor& actor) {
  return [&dataset, &actor](const ImageRequest& request) {
    const FieldPicture seen = field_picture(dataset, actor, "radiance", request, 0);
    const torch::Tensor pixels = (seen.opacity > 0).nonzero().flip({1});
    const PixelRays rays = pixel_rays(request.projection[0][0], pixels);
    RenderedRays points;
    points.opacity = seen.opacity.masked_select(seen.opacity > 0);
    points.depth = seen.depth.masked_select(seen.opacity > 0);
    return point_cloud(points, rays.origin, rays.direction);
  };
}

constexpr int kFilmedSamples = 3;  // along each side of a camera's pixel

/// One frame as its camera would film it (RenderedImages::filmed).
torch::Tensor filmed(const RenderScene& scene, const RenderMesh& mesh, int side, const ShadingOptions& options) {
  const SupersampledImage image =
      render_supersampled(scene, mesh, side, side, RenderMode::colour, kFilmedSamples, options);
  return at::cat({image.image, image.alpha.unsqueeze(-1)}, -1)[0][0];
}

ImageFunction picture_function(const Dataset& dataset, TrainedActor& actor, const std::string& method) {
  if (method == "radiance" || method == "nerf") return field_function(dataset, actor, method);
  return [&dataset, &actor, method](const ImageRequest& request) {
    const torch::Tensor window = windows(dataset, request.samples, actor.window());
    ShadingOptions options;
    options.lit = method == "lit";
    torch::Tensor lighting;
    if (options.lit) lighting = actor.lighting->forward(torch::full({1, 1}, request.camera, torch::kInt64));
    const torch::Tensor texture =
        method == "texnet" ? actor.texture(window, request.projection.select(1, 0)) : actor.static_texture;
    const torch::Tensor vertices = actor.fine(window);
    const ShadedImage drawn =
        shade(vertices, texture, lighting, request.projection, *actor.mesh, request.size, request.size, options);
    const auto film = [&actor, request, vertices, texture, lighting, options](std::size_t b) {
      const auto i = static_cast<std::int64_t>(b);
      const torch::Tensor own = texture.size(0) == 1 ? texture : texture.narrow(0, i, 1);
      return filmed({vertices.narrow(0, i, 1), request.filmed_projection(b), own, lighting}, *actor.mesh,
                    request.sides[b], options);
    };
    return RenderedImages{drawn.colour, drawn.mask, film};
  };
}

Json evaluate_split(const Dataset& dataset, Subject& subject, Split split, const EvaluationOptions& options) {
  const torch::Tensor faces = face_tensor(subject.character().mesh);
  const auto skinned = [&](const std::vector<SampleId>& samples) {
    return subject.surface->skinned(windows(dataset, samples, 0).squeeze(1));
  };
  Json result = Json::object();
  // What captures poses needs none; whatever else stops here where there are none, and says so.
  if (!subject.pose || poses_are_known(dataset, split))
    result["skinning"] =
        evaluate_surface(dataset, split, faces, skinned, options, "skinning, " + to_string(split)).to_json();
  if (subject.pose) result.update(evaluate_pose_run(dataset, *subject.pose, split, options));
  if (!subject.actor) return result;
  TrainedActor& actor = *subject.actor;
  const auto measure = [&](const std::string& name, torch::Tensor (TrainedActor::*surface)(const torch::Tensor&)) {
    const auto deformed = [&](const std::vector<SampleId>& samples) {
      return (actor.*surface)(windows(dataset, samples, actor.window()));
    };
    result[name] = evaluate_surface(dataset, split, faces, deformed, options, name + ", " + to_string(split)).to_json();
  };
  measure("egnet", &TrainedActor::coarse);
  if (actor.deltanet) measure("deltanet", &TrainedActor::fine);
  if (actor.hybrid) measure("refined", &TrainedActor::refined);
  for (const std::string& method : picture_methods(actor)) {
    // A field without a mesh knows one frame alone.
    if (method == "nerf" && evaluated_samples(dataset, split, options) != std::vector<SampleId>{*actor.nerf_frame})
      continue;
    result[method] = evaluate_images(dataset, split, picture_function(dataset, actor, method), options,
                                     method + ", " + to_string(split))
                         .to_json();
  }
  if (actor.hybrid)
    if (const auto clouds = evaluate_clouds(dataset, split, faces, actor.character.num_vertices(),
                                            cloud_function(dataset, actor), options, "cloud, " + to_string(split)))
      result["cloud"] = clouds->to_json();
  return result;
}

Subject load_subject(const Arguments& arguments, fs::path& capture) {
  Subject subject;
  if (arguments.run.empty()) {
    if (arguments.capture.empty()) fail<UsageError>("nothing to evaluate: give --run RUN or --capture PREPARED");
    capture = arguments.capture;
    subject.untrained = load_character(read_capture(capture).character_path());
  } else {
    const auto other = arguments.capture.empty() ? std::nullopt : std::make_optional<fs::path>(arguments.capture);
    if (captures_poses(arguments.run))
      subject.pose = TrainedPose::load(arguments.run, other);
    else
      subject.actor = TrainedActor::load(arguments.run, other);
    capture = subject.pose ? subject.pose->subject.capture : subject.actor->subject.capture;
  }
  subject.surface = CharacterSurface(subject.character());
  return subject;
}

/// The camera that a capture from one camera is given: the first of those compared, unless one is named.
EvaluationOptions with_input_camera(const Subject& subject, const Dataset& dataset, EvaluationOptions options) {
  if (!subject.pose && !options.input_camera.empty())
    fail<UsageError>("--input-camera: this run does not capture from one camera; leave the option out");
  if (subject.pose && options.input_camera.empty())
    options.input_camera = dataset.camera(dataset.camera_indices(options.cameras).front()).name;
  return options;
}

/// The conditions that the trained model adds.
void describe_run(const Subject& subject, const Dataset& dataset, const Arguments& arguments,
                  const EvaluationOptions& options, const std::vector<Split>& splits, Json& protocol) {
  if (subject.actor && !picture_methods(*subject.actor).empty()) protocol["pictures"] = photometric_protocol(dataset);
  if (subject.pose) {
    protocol["input_camera"] = options.input_camera;
    protocol["keypoints"] = "of all cameras compared, in pixels of a picture 1024 wide";
    for (Split split : splits)
      if (poses_are_known(dataset, split))
        protocol["poses"] = "14 joints against the capture's motion, bones rescaled; surfaces moved to the true place";
      else
        protocol["left_out"][to_string(split)] =
            "skinning in the true pose, GLE, 3DPCK, AUC and MPJPE: the capture has no motion; surfaces stand where the "
            "keypoints of the input camera put them";
  }
  protocol["run"] = fs::absolute(arguments.run).lexically_normal().string();
  protocol["steps"] = subject.pose ? subject.pose->steps : subject.actor->steps;
  protocol["trained_on_cameras"] = subject.pose ? subject.pose->trained_on_cameras : subject.actor->trained_on_cameras;
}

int run(const Arguments& arguments, const CommonOptions& common) {
  fs::path capture;
  Subject subject = load_subject(arguments, capture);
  const Dataset dataset = Dataset::open(capture);
  const EvaluationOptions options = with_input_camera(subject, dataset, arguments.options);
  const std::vector<Split> splits = splits_to_evaluate(dataset, arguments.split);
  Json evaluation;
  evaluation["protocol"] = evaluation_protocol(dataset, splits, options);
  if (!subject.untrained) describe_run(subject, dataset, arguments, options, splits, evaluation["protocol"]);
  for (Split split : splits) evaluation["splits"][to_string(split)] = evaluate_split(dataset, subject, split, options);
  if (!subject.untrained) {
    write_atomically(RunFolder(arguments.run).evaluation(), evaluation.dump(2) + "\n");
    write_run_report(arguments.run);
  }
  std::printf("%s", common.json ? (evaluation.dump() + "\n").c_str() : evaluation_table(evaluation).c_str());
  return 0;
}

}  // namespace

Command add_evaluate(CLI::App& program) {
  CLI::App* app = program.add_subcommand(
      "evaluate", "Measure how well skinning and a trained model fill the masks, and captured poses");
  app->footer(kExample);
  auto arguments = std::make_shared<Arguments>();
  app->add_option("--run", arguments->run, "Folder of a run; results also go into its evaluation.json and report.html");
  app->add_option("--capture", arguments->capture, "Prepared capture (default: the one the run was trained on)");
  app->add_option("--split", arguments->split, "train, test or all")->capture_default_str();
  app->add_option("--cameras", arguments->options.cameras, "Names of cameras (default: all)")->delimiter(',');
  app->add_option("--input-camera", arguments->options.input_camera,
                  "The camera that PoseNet and DefNet see (default: the first of --cameras)");
  app->add_option("--frames", arguments->options.frames, "Rows of the motions to evaluate (default: as --every says)")
      ->delimiter(',');
  app->add_option("--every", arguments->options.every, "Each n-th frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
