#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/capture.h"
#include "doppel/eval/flicker.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/image_metrics.h"
#include "doppel/eval/lpips.h"
#include "doppel/eval/pose_evaluation.h"
#include "doppel/eval/tracked_evaluation.h"
#include "doppel/train/stage_chain.h"
#include "doppel/train/stage_table.h"
#include "number_checks.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kEvaluateExample[] =
    "Example:\n"
    "  doppel evaluate --run runs/anna --split test --json\n"
    "Without --run, only skinning is evaluated: doppel evaluate --capture prepared/anna";

struct EvaluateArguments {
  fs::path out;
  std::string run, capture, tracked, split = "test";
  std::string scan_unit = "mm";
  std::vector<std::string> lpips;
  TrackedEvaluationOptions options;
};

/// Whether a split has one of these frames, or any when none is named.
bool has_frames(const Dataset& dataset, Split split, const std::vector<long>& frames) {
  const std::vector<SampleId> samples = dataset.samples(split);
  return std::any_of(samples.begin(), samples.end(), [&](const SampleId& sample) {
    return frames.empty() || std::find(frames.begin(), frames.end(), sample.frame) != frames.end();
  });
}

/// @param frames rows of the motions; empty: all. `all` stands for the splits that have one of them.
std::vector<Split> splits_to_evaluate(const Dataset& dataset, const std::string& word,
                                      const std::vector<long>& frames) {
  if (word != "all") return {parse_split(word)};
  std::vector<Split> all, chosen;
  for (const Split split : {Split::train, Split::validation, Split::test}) {
    if (has_frames(dataset, split, {})) all.push_back(split);
    if (has_frames(dataset, split, frames)) chosen.push_back(split);
  }
  return chosen.empty() ? all : chosen;  // the protocol names the frame that is nowhere
}

/// The subject of an evaluation: a trained actor, a trained pose network, tracked sequences, or a character alone.
struct Subject {
  std::optional<TrainedActor> actor;
  std::optional<TrainedPose> pose;
  std::optional<Character> untrained;
  std::optional<TrackedRun> tracked;  ///< of the character `untrained`
  CharacterSurface surface{nullptr};
  const Character& character() const { return actor ? actor->character : pose ? pose->character : *untrained; }
};

bool compares_images(const TrainedActor& actor) {
  return actor.lighting || actor.deltanet || actor.texnet || actor.gaussians;
}

/// Sorts rows: surfaces first, then images.
Json surfaces_first(const Json& rows) {
  Json sorted = Json::object();
  for (const bool surfaces : {true, false})
    for (const auto& [name, row] : rows.items())
      if (row.contains("AMVIoU") == surfaces) sorted[name] = row;
  return sorted;
}

/// Measures one method on one split, and adds its rows. Rows of earlier methods may be there.
struct Measurement {
  Split split;
  std::function<void(Json& rows)> measure;
};

void measure_skinning(const Dataset& dataset, Subject& subject, Split split, const EvaluationOptions& options,
                      Json& rows) {
  const auto skinned = [&](const std::vector<SampleId>& samples) {
    return subject.surface->skinned(dataset.dof_windows(samples, 0).squeeze(1));
  };
  rows["skinning"] =
      evaluate_surface(dataset, split, subject.character(), skinned, options, "skinning, " + to_string(split))
          .to_json();
}

/// The measurements of a split, in the order of their rows.
void add_measurements(const Dataset& dataset, Subject& subject, Split split, const TrackedEvaluationOptions& options,
                      std::vector<Measurement>& all) {
  // Captured and tracked poses can be evaluated without known poses; everything else fails here.
  if (!(subject.pose || subject.tracked) || poses_are_known(dataset, split))
    all.push_back({split, [&, split](Json& rows) { measure_skinning(dataset, subject, split, options, rows); }});
  if (subject.tracked)
    all.push_back({split, [&, split](Json& rows) {
                     rows.update(evaluate_tracked(dataset, subject.character(), *subject.tracked, split, options));
                   }});
  if (subject.pose)
    all.push_back(
        {split, [&, split](Json& rows) { rows.update(evaluate_pose_run(dataset, *subject.pose, split, options)); }});
  if (!subject.actor) return;
  for (const StageEntry& entry : stage_table())
    if (entry.evaluate && subject.actor->steps.count(entry.name))
      all.push_back({split, [&, split](Json& rows) {
                       entry.evaluate({dataset, *subject.actor, split, options}, rows);
                     }});
}

/// The rows of a measurement in the results of its shard. @param unit number of the measurement
Json rows_of_shard(const ShardSet& shards, std::size_t unit) {
  const std::size_t shard = unit % shards.folders.size();
  const Json& results = shards.files[shard].results;
  if (!results.is_object() || !results.contains(std::to_string(unit)) || !results[std::to_string(unit)].is_object())
    fail<UsageError>("{}: the rows of measurement {} are missing; run this shard again into an empty folder",
                     (shards.folders[shard] / kShardFile).string(), unit);
  return results[std::to_string(unit)];
}

/// All rows by split. Those of shards are taken instead of being measured.
Json evaluate_splits(const std::vector<Measurement>& measurements, const ShardSet& shards) {
  Json splits = Json::object();
  for (std::size_t unit = 0; unit < measurements.size(); ++unit) {
    Json& rows = splits[to_string(measurements[unit].split)];
    if (rows.is_null()) rows = Json::object();
    if (shards.empty())
      measurements[unit].measure(rows);
    else
      rows.update(rows_of_shard(shards, unit));
  }
  for (Json& rows : splits) rows = surfaces_first(rows);
  return splits;
}

/// The rows of the measurements of one shard, by their number.
Json evaluate_shard(const std::vector<Measurement>& measurements, const Shard& shard) {
  Json results = Json::object();
  for (std::size_t unit = 0; unit < measurements.size(); ++unit) {
    if (!shard.owns(unit)) continue;
    Json rows = Json::object();
    measurements[unit].measure(rows);
    results[std::to_string(unit)] = rows;
  }
  return results;
}

Subject load_subject(const EvaluateArguments& arguments, fs::path& capture) {
  Subject subject;
  if (!arguments.tracked.empty() && !arguments.run.empty())
    fail<UsageError>("--tracked and --run name two things to evaluate; give one of them");
  if (!arguments.tracked.empty() && arguments.capture.empty())
    fail<UsageError>("--tracked needs the prepared capture to compare with: --capture PREPARED");
  if (arguments.tracked.empty() && arguments.options.smoothing > 0.0)
    fail<UsageError>("--smoothing smooths tracked sequences; give --tracked DIR, or leave it out");
  if (arguments.tracked.empty() && !arguments.options.error_maps.empty())
    fail<UsageError>("--error-maps draws tracked surfaces; give --tracked DIR, or leave it out");
  if (arguments.run.empty()) {
    if (arguments.capture.empty()) fail<UsageError>("nothing to evaluate; give --run RUN or --capture PREPARED");
    capture = arguments.capture;
    subject.untrained = load_character(read_capture(capture).character_path());
    if (!arguments.tracked.empty()) subject.tracked = TrackedRun::load(arguments.tracked, *subject.untrained);
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

/// Sets the input camera of a run that captures poses: the first of the compared cameras, unless one is named.
TrackedEvaluationOptions with_input_camera(const Subject& subject, const Dataset& dataset,
                                           TrackedEvaluationOptions options) {
  if (!subject.pose && !subject.tracked && !options.input_camera.empty())
    fail<UsageError>("--input-camera: this run has no input camera; leave the option out");
  if (subject.pose && options.input_camera.empty())
    options.input_camera = dataset.camera(dataset.camera_indices(options.cameras).front()).name;
  return options;
}

/// Adds what the options of the program say in other words: the unit of scans, and the weights of LPIPS.
TrackedEvaluationOptions with_measurements(const Subject& subject, const EvaluateArguments& arguments,
                                           TrackedEvaluationOptions options) {
  options.scan_unit = arguments.scan_unit == "m" ? 1.0 : 0.001;
  const bool draws = subject.actor && (compares_images(*subject.actor) || subject.actor->hybrid || subject.actor->nerf);
  if ((options.whole_frames || options.flicker || !arguments.lpips.empty()) && !draws)
    fail<UsageError>(
        "--whole-frames, --flicker and --lpips measure drawings, and nothing here is drawn; give --run with a run "
        "that has colours (lighting, deltanet, texnet, hybrid or nerf), or leave them out");
  const std::vector<fs::path> weights(arguments.lpips.begin(), arguments.lpips.end());
  if (!weights.empty()) options.lpips = std::make_shared<const Lpips>(Lpips::load(weights));
  return options;
}

/// Adds the conditions of the trained model to the protocol.
void describe_run(const Subject& subject, const Dataset& dataset, const EvaluateArguments& arguments,
                  const EvaluationOptions& options, const std::vector<Split>& splits, Json& protocol) {
  if (subject.actor && compares_images(*subject.actor)) protocol["pictures"] = photometric_protocol(dataset, options);
  if (subject.pose) {
    protocol["input_camera"] = options.input_camera;
    protocol["keypoints"] = "of all compared cameras, in pixels of an image 1024 wide";
    for (Split split : splits)
      if (poses_are_known(dataset, split))
        protocol["poses"] =
            "14 joints against the capture's motion, bones rescaled; surfaces moved to the true position";
      else
        protocol["left_out"][to_string(split)] =
            "skinning in the true pose, GLE, 3DPCK, AUC and MPJPE: the capture has no motion; the positions of "
            "surfaces "
            "come from the keypoints of the input camera";
  }
  protocol["run"] = fs::absolute(arguments.run).lexically_normal().string();
  protocol["steps"] = subject.pose ? subject.pose->steps : subject.actor->steps;
  protocol["trained_on_cameras"] = subject.pose ? subject.pose->trained_on_cameras : subject.actor->trained_on_cameras;
}

/// Adds figures to those that are left out of a split.
void leave_out(Json& protocol, Split split, const std::string& what) {
  Json& text = protocol["left_out"][to_string(split)];
  text = text.is_string() ? text.get<std::string>() + "; " + what : what;
}

/// Leaves out the figures of true surfaces that belong to another character, and flicker without consecutive frames.
void leave_out_unmeasurable(const Subject& subject, const Dataset& dataset, const std::vector<Split>& splits,
                            TrackedEvaluationOptions& options, Json& protocol) {
  const std::string other = ground_truth_of_another_character(dataset, splits, subject.character().num_vertices());
  if (!other.empty()) {
    log::warn("{}; the figures of the true surface are left out", other);
    options.ground_truth = false;
  }
  for (const Split split : splits) {
    if (!other.empty()) leave_out(protocol, split, "vertex error and other figures of the true surface: " + other);
    if (options.flicker && !has_flicker(dataset, split, options))
      leave_out(protocol, split,
                "flicker: no evaluated frame has a frame before it in which a compared camera shows the person, too");
  }
}

/// Adds the conditions of tracked sequences to the protocol.
void describe_tracked(const EvaluateArguments& arguments, const Dataset& dataset, const TrackedRun& tracked,
                      const TrackedEvaluationOptions& options, const std::vector<Split>& splits, Json& protocol) {
  protocol["tracked"] = fs::absolute(arguments.tracked).lexically_normal().string();
  protocol["method"] = tracked.method;
  protocol["smoothing"] = options.smoothing;
  if (!options.input_camera.empty()) protocol["input_camera"] = options.input_camera;
  for (const Split split : splits)
    if (!poses_are_known(dataset, split))
      protocol["left_out"][to_string(split)] =
          "skinning in the true pose, GLE, 3DPCK, AUC and MPJPE: the capture has no motion; surfaces stay at their "
          "tracked positions";
  if (protocol.contains("left_out")) return;
  protocol["poses"] = "14 joints against the capture's motion, bones rescaled";
  if (!options.input_camera.empty()) protocol["surfaces"] = "moved to the true position";
}

/// What an evaluation depends on: its protocol, which names the trained steps, and the files of the capture.
std::vector<std::string> evaluation_inputs(const Json& protocol, const fs::path& capture) {
  std::vector<std::string> lines = capture_inputs(read_capture(capture));
  lines.push_back("protocol " + protocol.dump());
  return lines;
}

/// The rows of some measurements by split. @param results by the number of the measurement
Json rows_by_split(const std::vector<Measurement>& measurements, const Json& results) {
  Json splits = Json::object();
  for (const auto& [unit, rows] : results.items()) splits[to_string(measurements[std::stoul(unit)].split)].update(rows);
  return splits;
}

/// @throws UsageError for a word that is no split; before anything is read
void check_split_word(const std::string& word) {
  const std::vector<std::string>& words = split_words();
  if (word != "all" && std::find(words.begin(), words.end(), word) == words.end())
    fail<UsageError>("--split: '{}' is not a split; give train, validation, test or all", word);
}

/// @throws Error when a file could not be written; leaves what is there as it is
void check_file_writable(const fs::path& file) {
  struct Writable {};
  try {
    write_atomically(file, [&](const fs::path& temporary) {
      std::ofstream stream(temporary);
      if (!stream) fail("writing {}: {}", file.string(), std::strerror(errno));
      throw Writable();  // so that the file is not replaced
    });
  } catch (const Writable&) {
  }
}

/// Checks before the first measurement that the results can be written. Beside those of --out, the copy in the run's
/// folder may be missing.
void check_writable(const EvaluateArguments& arguments) {
  if (!arguments.out.empty()) return check_file_writable(arguments.out / "evaluation.json");
  if (arguments.run.empty()) return;
  try {
    check_file_writable(RunFolder(arguments.run).evaluation());
  } catch (const Error& e) {
    fail("{}; --run writes the results there. Give --out FOLDER to have them in another folder", e.what());
  }
}

/// Writes the results into the folder of the run, for its report.
void write_to_run(const EvaluateArguments& arguments, const Json& evaluation) {
  try {
    write_atomically(RunFolder(arguments.run).evaluation(), evaluation.dump(2) + "\n");
    write_run_report(arguments.run);
  } catch (const std::exception& e) {
    if (arguments.out.empty()) throw;
    log::warn("{} has no copy of the results: {}", arguments.run, e.what());
  }
}

void print_evaluation(const CommonOptions& common, const Json& evaluation) {
  std::printf("%s", common.json ? (evaluation.dump() + "\n").c_str() : evaluation_table(evaluation).c_str());
}

/// What is known to fail or to mislead is said before the first measurement.
void check_subject(const Subject& subject, const Dataset& dataset, const std::vector<Split>& splits,
                   const TrackedEvaluationOptions& options) {
  if (!subject.tracked) return;
  if (const std::string other = subject.tracked->other_capture(dataset.capture()); !other.empty())
    log::warn("--tracked: {}; the figures are right only if both are the same recording", other);
  for (const Split split : splits) check_tracked(dataset, *subject.tracked, split, options);
}

int run(const EvaluateArguments& arguments, const CommonOptions& common) {
  check_split_word(arguments.split);
  fs::path capture;
  Subject subject = load_subject(arguments, capture);
  const Dataset dataset = subject.pose    ? subject.pose->subject.open_dataset()
                          : subject.actor ? subject.actor->subject.open_dataset()
                                          : Dataset::open(capture);
  TrackedEvaluationOptions options =
      with_measurements(subject, arguments, with_input_camera(subject, dataset, arguments.options));
  const std::vector<Split> splits = splits_to_evaluate(dataset, arguments.split, options.frames);
  Json evaluation;
  evaluation["protocol"] = evaluation_protocol(dataset, splits, options);
  if (subject.tracked) describe_tracked(arguments, dataset, *subject.tracked, options, splits, evaluation["protocol"]);
  if (!subject.untrained) describe_run(subject, dataset, arguments, options, splits, evaluation["protocol"]);
  leave_out_unmeasurable(subject, dataset, splits, options, evaluation["protocol"]);
  check_subject(subject, dataset, splits, options);
  std::vector<Measurement> measurements;
  for (const Split split : splits) add_measurements(dataset, subject, split, options, measurements);
  begin_work(common, arguments.out, [&] { return evaluation_inputs(evaluation["protocol"], capture); });
  if (common.shard) {
    const Json results = evaluate_shard(measurements, *common.shard);
    finish_work(common, arguments.out, results);
    evaluation["splits"] = rows_by_split(measurements, results);
    print_evaluation(common, evaluation);
    return 0;
  }
  check_writable(arguments);
  evaluation["splits"] = evaluate_splits(measurements, common.merged);
  if (common.merged.empty()) print_evaluation(common, evaluation);  // first: a folder may turn out not to be writable
  if (!arguments.out.empty()) write_atomically(arguments.out / "evaluation.json", evaluation.dump(2) + "\n");
  if (!subject.untrained) write_to_run(arguments, evaluation);
  return 0;
}

}  // namespace

Command add_evaluate(CLI::App& program) {
  CLI::App* app = program.add_subcommand(
      "evaluate", "Measure a trained model, and skinning, against masks, images and known poses");
  app->footer(kEvaluateExample);
  auto arguments = std::make_shared<EvaluateArguments>();
  app->add_option("--run", arguments->run,
                  "Folder of a run; results are also written to its evaluation.json and report.html");
  app->add_option("--out", arguments->out, "Folder to write evaluation.json into, or the shard of --shard");
  app->add_option("--capture", arguments->capture, "Prepared capture (default: that of the training)");
  app->add_option("--tracked", arguments->tracked,
                  "Output folder of `doppel track` to evaluate against the poses, surfaces and masks of --capture");
  app->add_option("--error-maps", arguments->options.error_maps,
                  "With --tracked: folder for images of where the surface is nearer to the true one than skinning");
  app->add_option("--smoothing", arguments->options.smoothing,
                  "With --tracked: sigma, in frames, of the Gaussian over five frames (0: none)")
      ->capture_default_str()
      ->check(not_negative());
  app->add_option("--split", arguments->split, "train, validation, test or all")->capture_default_str();
  app->add_option("--cameras", arguments->options.cameras, "Names of cameras (default: all)")->delimiter(',');
  app->add_option(
      "--input-camera", arguments->options.input_camera,
      "Camera that the method saw: the images of PoseNet and DefNet (default: the first of --cameras), or of "
      "--tracked, whose surfaces are then compared at the true position");
  CLI::Option* frames = app->add_option("--frames", arguments->options.frames,
                                        "Frames to evaluate, as rows of the motions (default: set by --every)")
                            ->delimiter(',');
  app->add_option("--every", arguments->options.every, "Evaluate every n-th frame")
      ->capture_default_str()
      ->check(above_zero())
      ->excludes(frames);
  app->add_flag("--whole-frames", arguments->options.whole_frames,
                "Compare drawings with the whole images of the capture too, at the camera's resolution (slow)");
  app->add_flag("--flicker", arguments->options.flicker,
                "Measure how much the colours of the surface change from frame to frame, drawn and filmed");
  app->add_option("--lpips", arguments->lpips,
                  "Weights of LPIPS with AlexNet, one file or several (docs/evaluation.md): compare drawings by it too")
      ->delimiter(',');
  CLI::Option* scans = app->add_option("--scan", arguments->options.scans,
                                       "Folder of scans, <sequence>/<frame>.obj or <frame>.obj: measure surfaces "
                                       "against them");
  app->add_option("--scan-unit", arguments->scan_unit, "Unit of the scans: mm or m")
      ->capture_default_str()
      ->check(CLI::IsMember({"mm", "m"}))
      ->needs(scans);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }, true};
}

}  // namespace doppel::tools
