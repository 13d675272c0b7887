#include "doppel/train/adapt.h"

#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <limits>
#include <vector>

#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/stored_stage.h"
#include "doppel/actor/trained_pose.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/eval/silhouette_overlap.h"
#include "doppel/train/def_net_stage.h"
#include "doppel/train/pose_net_stage.h"
#include "doppel/train/stage_chain.h"

namespace doppel {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr const char* kStages[] = {"posenet", "defnet"};

/// The weights of DefNet's losses that the configuration states, by name.
std::vector<std::pair<std::string, double>> stated_weights(const AdaptDefNet& stage) {
  std::vector<std::pair<std::string, double>> weights;
  if (stage.silhouette) weights.emplace_back("silhouette", *stage.silhouette);
  if (stage.keypoints) weights.emplace_back("keypoints", *stage.keypoints);
  if (stage.arap) weights.emplace_back("arap", *stage.arap);
  return weights;
}

/// How the network of a stage is fine-tuned.
const AdaptStage& stage_of(const AdaptConfig& config, const std::string& kind) {
  if (kind == "posenet") return config.posenet;
  return config.defnet;
}

/// The settings that determine the result; a repeated call must have the same.
std::string settings_of(const AdaptOptions& options, const Dataset& dataset, const std::string& camera) {
  const AdaptConfig& config = options.config;
  YAML::Node settings;
  settings["run"] = fs::weakly_canonical(options.run).string();
  settings["clip"] = fs::weakly_canonical(dataset.folder()).string();
  settings["camera"] = camera;
  settings["seed"] = config.seed;
  settings["held_out"] = config.held_out;
  settings["validation"] = config.validation;
  settings["check_every"] = config.check_every;
  for (const std::string kind : kStages) {
    const AdaptStage& stage = stage_of(config, kind);
    YAML::Node keys = settings[kind];
    keys["iterations"] = stage.iterations;
    keys["learning_rate"] = stage.learning_rate;
    keys["batch_size"] = stage.batch_size;
    if (kind == "posenet") keys["keypoints"] = config.posenet.keypoints;
    if (kind == "defnet")
      for (const auto& [name, weight] : stated_weights(config.defnet)) keys[name] = weight;
    keys["freeze_norm"] = stage.freeze_norm;
  }
  return YAML::Dump(settings) + "\n";
}

class Adaptation {
 public:
  explicit Adaptation(const AdaptOptions& options)
      : options_(options), dataset_(Dataset::open(fs::absolute(options.capture))) {
    camera_ = options.camera.empty() ? dataset_.cameras().front().name : options.camera;
    dataset_.camera_index(camera_);
    const AdaptConfig& config = options.config;
    if (config.held_out > 0.0) dataset_.hold_out(config.held_out, Split::test);
    // The share is one of all frames; `hold_out` takes it of those that are left.
    if (config.validation > 0.0) dataset_.hold_out(config.validation / (1.0 - config.held_out), Split::validation);
    has_defnet_ = find_stage(options.run, "defnet").has_value();
  }

  ordered_json run() {
    const FolderLock lock(options_.out);
    open_out();
    const fs::path result = options_.out / "adapt.json";
    if (fs::exists(result)) {
      log::info("{} already exists", result.string());
      return ordered_json::parse(read_file(result));
    }
    TrainedPose studio = TrainedPose::load(options_.run, dataset_.folder());
    ordered_json report = protocol();
    judge(studio, "before", report);
    tune_posenet();
    if (has_defnet_) tune_defnet();
    TrainedPose adapted = TrainedPose::load(options_.out);
    report["protocol"]["steps"] = adapted.steps;
    judge(adapted, "after", report);
    write_atomically(RunFolder(options_.out).evaluation(), report.dump(2) + "\n");
    write_run_report(options_.out);
    write_atomically(result, report.dump(2) + "\n");
    return report;
  }

 private:
  const AdaptStage& wanted(const std::string& kind) const { return stage_of(options_.config, kind); }
  bool tuned(const std::string& kind) const {
    return wanted(kind).iterations > 0 && (kind == "posenet" || has_defnet_);
  }
  RunFolder folder(const std::string& kind) const { return RunFolder(options_.out / kind); }

  /// The studio's configuration of a stage, with the clip as its capture.
  ConfigDocument stage_config(const std::string& kind) const {
    const AdaptStage& stage = wanted(kind);
    std::vector<std::string> changes{text_override("capture", dataset_.folder().string()),
                                     fmt::format("seed={}", options_.config.seed),
                                     fmt::format("data.cameras=[\"{}\"]", camera_),
                                     "data.cameras_per_sample=0",
                                     "data.frames=[]",
                                     "data.split=train",
                                     fmt::format("data.batch_size={}", stage.batch_size),
                                     fmt::format("model.freeze_norm={}", stage.freeze_norm),
                                     "train.max_minutes=0",
                                     "train.keep=last",
                                     "validation={}",
                                     "train.mean_weights=0",
                                     fmt::format("train.checkpoint_every={}", options_.config.check_every),
                                     fmt::format("train.keep_every={}", options_.config.check_every)};
    if (kind == "posenet") {
      changes.push_back(fmt::format("phases=[{{iterations: {}, learning_rate: {}, keypoints: {}}}]", stage.iterations,
                                    stage.learning_rate, options_.config.posenet.keypoints));
    } else {
      changes.push_back(fmt::format("train.iterations={}", stage.iterations));
      changes.push_back(fmt::format("train.learning_rate={}", stage.learning_rate));
      changes.emplace_back("train.schedule=constant");
      changes.emplace_back("train.warmup=0");
      for (const auto& [name, weight] : stated_weights(options_.config.defnet))
        changes.push_back(fmt::format("loss.{}={}", name, weight));
    }
    return ConfigDocument::load(RunFolder(stage_folder(options_.run, kind)).config(), changes);
  }

  /// A chain whose stages are fine-tuned here or borrowed from the studio run.
  std::string chain_config() const {
    YAML::Node root;
    root["stage"] = "deepcap";
    root["capture"] = dataset_.folder().string();
    root["seed"] = options_.config.seed;
    for (const std::string kind : kStages) {
      if (kind == "defnet" && !has_defnet_) continue;
      YAML::Node stage = YAML::Load(stage_config(kind).resolved());
      if (stage["character"]) root["character"] = stage["character"];
      for (const char* shared : {"stage", "capture", "seed", "character", "validation"}) stage.remove(shared);
      if (tuned(kind))
        root[kind] = stage;
      else
        root[kind]["run"] = fs::absolute(options_.run).lexically_normal().string();
    }
    return YAML::Dump(root) + "\n";
  }

  void open_out() const {
    const fs::path file = options_.out / "adapt.yaml";
    const std::string settings = settings_of(options_, dataset_, camera_);
    if (fs::exists(file)) {
      const std::vector<std::string> differences = config_differences(read_file(file), settings);
      if (!differences.empty())
        fail<UsageError>("--out {}: the folder holds an adaptation with other settings: {}; choose another one",
                         options_.out.string(), fmt::join(differences, ", "));
    } else if (fs::exists(RunFolder(options_.out).config())) {
      fail<UsageError>("--out {}: the folder holds another run; choose another one", options_.out.string());
    }
    open_chain_folder(options_.out, chain_config());
    write_atomically(file, settings);
  }

  /// Trains a stage from the studio's weights on, and keeps every state that is to be judged, the first included.
  void train(CaptureStage& stage, const std::string& kind, TrainerOptions trainer) {
    const auto studio = find_stage(options_.run, kind);
    load_evaluation_weights(stage.model(), studio->checkpoint);
    for (torch::Tensor& parameter : stage.model().parameters()) parameter.requires_grad_(true);
    trainer.keep_start = true;
    folder(kind).open(stage_config(kind).resolved(), RunMode::automatic);
    if (Trainer(stage, trainer, folder(kind)).run().reason == StopReason::interrupted)
      fail("stopped while adapting {}; run the same command again to resume", kind);
  }

  void tune_posenet() {
    if (!tuned("posenet")) return;
    PoseNetRunConfig config = PoseNetRunConfig::read(stage_config("posenet"));
    // A run of an earlier version does not list the DoFs that it predicts.
    config.dofs = TrainedPose::load(options_.run, std::nullopt, /*with_defnet=*/false).pose->names();
    const Character character = load_character(dataset_.character_path(), config.subject.character);
    PoseNetStage stage(dataset_, character, config);
    train(stage, "posenet", config.trainer);
    keep_best("posenet", [&](TrainedPose& trained, const std::string&) {
      return -keypoint_error(trained, Split::validation, /*deformed=*/false);
    });
  }

  void tune_defnet() {
    if (!tuned("defnet")) return;
    TrainedPose pose = TrainedPose::load(options_.out, std::nullopt, /*with_defnet=*/false);
    const DefNetRunConfig config = DefNetRunConfig::read(stage_config("defnet"));
    DefNetStage stage(dataset_, pose, config);
    train(stage, "defnet", config.trainer);
    keep_best("defnet", [&](TrainedPose& trained, const std::string& title) {
      return overlap(trained, Split::validation, /*deformed=*/true, title).AMVIoU;
    });
  }

  /// Keeps the best of all checkpoints on disk, among equals the earliest; without validation frames the last.
  /// @param merit of the networks on the validation frames; larger is better
  template <typename Merit>
  void keep_best(const std::string& kind, const Merit& merit) {
    CheckpointFolder checkpoints(folder(kind).checkpoints());
    if (dataset_.samples(Split::validation).empty()) {
      checkpoints.keep_only(checkpoints.steps().back());
      return;
    }
    std::optional<double> best;
    std::int64_t best_step = 0;
    TrainedPose trained = TrainedPose::load(options_.out, std::nullopt, kind == "defnet");
    torch::nn::Module& network = kind == "defnet" ? static_cast<torch::nn::Module&>(*trained.defnet)
                                                  : static_cast<torch::nn::Module&>(*trained.posenet);
    for (const std::int64_t step : checkpoints.steps()) {
      load_evaluation_weights(network, Checkpoint::load(checkpoints.path(step)));
      const double value = merit(trained, fmt::format("{} {}", kind, step));
      if (best && !(value > *best)) continue;
      best = value;
      best_step = step;
    }
    checkpoints.keep_only(best_step);
    if (best_step == 0)
      log::warn("{}: no checkpoint is better on the validation frames than the studio's network, which is kept", kind);
    else
      log::info("{}: step {} is best on the validation frames", kind, best_step);
  }

  /// The surfaces that the networks predict for samples, in the order of the methods: skinned and deformed.
  torch::Tensor surface(TrainedPose& trained, const Batch& batch, bool deformed) const {
    const torch::Tensor dofs = trained.dofs(trained.capture(person_view(batch)));
    if (!deformed) return trained.surface->skinned(dofs);
    const auto [A, T] = trained.deformation(batch.person.select(1, 0));
    return trained.surface->deformed(dofs, A, T);
  }

  Batch seen(const TrainedPose& trained, const std::vector<SampleId>& samples) const {
    return person_batch(dataset_, samples, {dataset_.camera_index(camera_)}, trained.input_size());
  }

  /// IoU of the drawn surface with the masks.
  SurfaceResult overlap(TrainedPose& trained, Split split, bool deformed, const std::string& title) const {
    const torch::NoGradGuard no_grad;
    EvaluationOptions options;
    options.cameras = {camera_};
    const auto drawn = [&](const std::vector<SampleId>& samples) {
      return surface(trained, seen(trained, samples), deformed);
    };
    const auto skinned = [&](const std::vector<SampleId>& samples) {
      return surface(trained, seen(trained, samples), false);
    };
    return evaluate_surface(dataset_, split, trained.character, drawn, options, title, skinned);
  }

  /// Keypoint error of the pose's landmarks or of those on the deformed graph; mean over frames, reference pixels. A
  /// frame in which no pose is found counts as one whose landmarks left the image.
  double keypoint_error(TrainedPose& trained, Split split, bool deformed) const {
    const torch::NoGradGuard no_grad;
    GraphLandmarks graph_landmarks(trained.character, trained.landmarks);
    double sum = 0.0, frames = 0.0;
    for (const SampleId& sample : dataset_.samples(split)) {
      const Batch batch = seen(trained, {sample});
      const CapturedPose captured = trained.capture(person_view(batch));
      if (!batch.person_valid.item<bool>()) continue;
      const bool found = captured.valid.item<bool>();
      torch::Tensor landmarks = captured.landmarks;
      if (!found) landmarks = torch::full_like(landmarks, std::numeric_limits<double>::quiet_NaN());
      if (found && deformed) {
        const auto [A, T] = trained.deformation(batch.person.select(1, 0));
        landmarks = graph_landmarks->forward(A, T, trained.surface->node_transforms(trained.dofs(captured)));
      }
      const KeypointTarget target = keypoint_target(batch, batch.person_valid);
      sum += doppel::keypoint_error(landmarks, target, trained.detections.loss).item<double>();
      ++frames;
    }
    if (frames == 0.0)
      fail("{}: camera {} shows no person in the {} frames", dataset_.folder().string(), camera_, to_string(split));
    return sum / frames;
  }

  /// Measures the surfaces of both methods against masks and keypoints of the clip.
  ordered_json score(TrainedPose& trained, Split split, const std::string& title) const {
    const auto method = [&](bool deformed) {
      ordered_json json = overlap(trained, split, deformed, title).to_json();
      json["keypoint_error_px"] = keypoint_error(trained, split, deformed);
      return json;
    };
    ordered_json json{{"posenet", method(false)}};
    if (has_defnet_) json["defnet"] = method(true);
    return json;
  }

  void judge(TrainedPose& trained, const std::string& when, ordered_json& report) const {
    for (const auto& [name, split] : judged()) {
      const std::string title = fmt::format("{}, {}", name, when);
      report["splits"][title] = score(trained, split, title);
    }
  }

  /// The frames to report on: those that neither trained nor chose anything, if there are some, and those tuned on.
  std::vector<std::pair<const char*, Split>> judged() const {
    if (dataset_.samples(Split::test).empty()) return {{"tuned on", Split::train}};
    return {{"held out", Split::test}, {"tuned on", Split::train}};
  }

  ordered_json protocol() const {
    ordered_json frames;
    for (const char* when : {"before", "after"}) {
      for (const auto& [name, split] : judged())
        frames[fmt::format("{}, {}", name, when)] = dataset_.samples(split).size();
    }
    return {{"protocol",
             {{"metric", "IoU of the drawn surface and the clip's masks; keypoints in pixels of an image 1024 wide"},
              {"capture", dataset_.capture().name},
              {"frames", frames},
              {"cameras", {camera_}},
              {"run", fs::absolute(options_.run).lexically_normal().string()}}}};
  }

  AdaptOptions options_;
  Dataset dataset_;
  std::string camera_;
  bool has_defnet_ = false;
};

}  // namespace

namespace {

void describe_stage(const Keys& keys, AdaptStage& stage) {
  keys("iterations", stage.iterations, at_least<std::int64_t>(0), "steps; 0: the network is not changed");
  keys("learning_rate", stage.learning_rate, between(0.0, 1.0), "of all steps");
  keys("batch_size", stage.batch_size, at_least(1), "frames of a step");
  keys("freeze_norm", stage.freeze_norm, "batch normalisation keeps the statistics of the studio");
}

}  // namespace

void describe_keys(const Keys& keys, AdaptConfig& c) {
  keys("seed", c.seed, Range<std::int64_t>{}, "of the random numbers");
  keys("held_out", c.held_out, between(0.0, 0.9),
       "share of the clip's frames, the last ones, that are used only to evaluate");
  keys("validation", c.validation, between(0.0, 0.9),
       "share of the frames before these, which choose the checkpoint; 0: the last step is kept");
  keys.require("validation", c.held_out + c.validation <= 0.95,
               fmt::format("held_out and validation are {} and {} of the clip; too few frames are left to tune on",
                           c.held_out, c.validation));
  keys("check_every", c.check_every, at_least<std::int64_t>(1), "steps between the checkpoints that are evaluated");
  describe_stage(keys.section("posenet"), c.posenet);
  keys("posenet.keypoints", c.posenet.keypoints, at_least(0.0),
       "weight of the keypoint loss, squared pixels of an image 1024 wide");
  describe_stage(keys.section("defnet"), c.defnet);
  const std::string studio = "; without it, that of the studio run; thesis: ";
  keys("defnet.silhouette", c.defnet.silhouette, at_least(0.0), "weight of the silhouette loss" + studio + "1000");
  keys("defnet.keypoints", c.defnet.keypoints, at_least(0.0), "weight of the keypoint loss" + studio + "0.05");
  keys("defnet.arap", c.defnet.arap, at_least(0.0), "weight of ARAP" + studio + "1500");
}

AdaptConfig AdaptConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  const AdaptConfig config = read_options<AdaptConfig>(root);
  root.finish();
  return config;
}

ordered_json adapt(const AdaptOptions& options) { return Adaptation(options).run(); }

}  // namespace doppel
