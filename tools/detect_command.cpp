#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "command.h"
#include "detect_camera.h"
#include "detect_masks.h"
#include "detect_network.h"
#include "detect_sources.h"
#include "detected_capture.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/data/capture/find_capture.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kDetectExample[] =
    "Examples:\n"
    "  doppel detect street.mp4 --out street/detected\n"
    "  doppel detect recordings/anna --out recordings/anna/detected --model heavy --masks\n"
    "  doppel detect street.mp4 --out street/detected --network rtmpose.onnx --config rtmpose --layout coco17";
constexpr std::chrono::milliseconds kPollInterval{100};

struct DetectArguments {
  std::string source, model, network, config, layout;  ///< model empty: chosen by the number of cameras
  fs::path out;
  std::vector<double> person;
  bool masks = false, raw_masks = false, keep_keypoints = false;
  std::optional<bool> mirror;  ///< nothing: as the model was chosen

  bool has_network() const { return !network.empty() || !config.empty(); }
};

/// Whether the sources are several cameras. These are no live recording, so accuracy counts more than time.
bool several_cameras(const std::vector<DetectSource>& sources) {
  return std::any_of(sources.begin(), sources.end(),
                     [&](const DetectSource& source) { return source.camera != sources[0].camera; });
}

/// Searches the images of one camera.
using CameraWorker = std::function<std::optional<DetectReport>(const DetectSource&, const DetectFiles&,
                                                               const std::function<bool()>& advance)>;

std::optional<Eigen::Vector2d> person_hint(const DetectArguments& arguments) {
  if (arguments.person.empty()) return std::nullopt;
  return Eigen::Vector2d(arguments.person[0], arguments.person[1]);
}

CameraWorker worker_of(const DetectNetwork& chosen, std::optional<Eigen::Vector2d> person) {
  const auto network = std::make_shared<PersonNetwork>(chosen.options, static_cast<int>(chosen.layout.points.size()));
  return [=](const DetectSource& source, const DetectFiles& files, const std::function<bool()>& advance) {
    return detect_camera_with(chosen, *network, source, files, person, advance);
  };
}

/// @param sharpen whether masks become sharp
CameraWorker worker_of(const BodyDetectorOptions& options, std::optional<Eigen::Vector2d> person, bool sharpen) {
  const auto detector = std::make_shared<BodyDetector>(options);
  return [=](const DetectSource& source, const DetectFiles& files, const std::function<bool()>& advance) {
    auto report = detect_camera(source, files, *detector, person, advance);
    if (report && sharpen && !sharpen_masks(source, files.masks, advance)) report.reset();
    return report;
  };
}

void copy_if_written(const fs::path& from, const fs::path& to) {
  if (from.empty()) return;
  fs::create_directories(to.parent_path());
  fs::copy(from, to, fs::copy_options::recursive);
}

/// The counts of one camera in the results of its shard. @param unit number of the camera
DetectReport report_of(const Json& results, std::size_t unit, const fs::path& folder) {
  try {
    const Json& counts = results.at(std::to_string(unit));
    return {counts.at(0).get<long>(), counts.at(1).get<long>(), counts.at(2).get<double>()};
  } catch (const Json::exception& e) {
    fail<UsageError>("{}: the counts of camera {} cannot be read ({}); run this shard again into an empty folder",
                     (folder / kShardFile).string(), unit, e.what());
  }
}

/// What a detection reads of a capture. A film or a folder of images stands among the arguments.
std::vector<std::string> detect_inputs(const fs::path& source) {
  const std::optional<CaptureGuess> recognised = recognise_capture(source);
  return recognised ? capture_inputs(recognised->capture) : std::vector<std::string>();
}

/// Works on several cameras at a time: more threads for one camera gain less than one thread for each camera.
class DetectJob {
 public:
  DetectJob(const DetectArguments& arguments, const CommonOptions& common)
      : arguments_(arguments),
        shard_(common.shard.value_or(Shard())),
        sources_(detect_sources(arguments.source)),
        reports_(sources_.size()) {
    const int threads = resolve_threads(common.threads);
    for (const DetectSource& source : sources_) sequences_ += source.sequence != sources_[0].sequence;
    if (!arguments.person.empty() && sources_.size() != 1)
      fail<UsageError>("--person states a pixel of one camera; {} has {} cameras", arguments.source, sources_.size());
    const bool accurate = arguments.model.empty() && several_cameras(sources_);
    if (arguments_.model.empty()) arguments_.model = accurate ? "heavy" : "full";
    const int workers = std::clamp(static_cast<int>(sources_.size()) / shard_.count, 1, threads);
    if (arguments.has_network())
      network_ = choose_network(arguments.network, arguments.config, arguments.layout, arguments.masks);
    const BodyDetectorOptions options{.model = parse_blazepose_model(arguments_.model),
                                      .threads = std::clamp(threads / workers, 1, 8),
                                      .masks = arguments.masks,
                                      .mirror = arguments.mirror.value_or(accurate),
                                      .models = {}};
    const auto person = person_hint(arguments);
    sharpen_ = arguments.masks && !arguments.raw_masks && !network_;
    for (int i = 0; i < workers && common.merged.empty(); ++i)
      workers_.push_back(network_ ? worker_of(*network_, person) : worker_of(options, person, sharpen_));
  }

  /// @return whether all cameras are done; otherwise the user has stopped the job
  bool run() {
    std::vector<std::thread> workers;
    for (const CameraWorker& worker : workers_) workers.emplace_back([&] { work(worker); });
    show_progress();
    for (std::thread& worker : workers) worker.join();
    if (error_) std::rethrow_exception(error_);
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (shard_.owns(i) && !reports_[i]) return false;
    // A shard has not the masks of all cameras.
    if (sharpen_ && shard_.count == 1) compare_views();
    return !stop_requested();
  }

  /// The counts of the cameras of this shard, for `merge`.
  Json results() const {
    Json results = Json::object();
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (reports_[i])
        results[std::to_string(i)] = {reports_[i]->frames, reports_[i]->with_person, reports_[i]->mean_confidence};
    return results;
  }

  /// Does the work of `run` with the files and counts of shards. @return false: the user has stopped it
  bool merge(const ShardSet& shards) {
    for (std::size_t i = 0; i < sources_.size() && !stop_requested(); ++i) {
      const std::size_t shard = i % shards.folders.size();
      const DetectFiles from = files_of(sources_[i], shards.folders[shard]), to = files_of(sources_[i]);
      copy_if_written(from.keypoints, to.keypoints);
      copy_if_written(from.joints, to.joints);
      copy_if_written(from.masks, to.masks);
      reports_[i] = report_of(shards.files[shard].results, i, shards.folders[shard]);
    }
    if (sharpen_ && !stop_requested()) compare_views();
    return !stop_requested();
  }

  Json report() const {
    Json json;
    if (network_)
      json = {{"layout", network_->layout.name}, {"network", network_->options.network.model.string()}};
    else
      json = {{"layout", "mediapipe33"}, {"model", arguments_.model}, {"package", kModelPackage.name}};
    json["cameras"] = Json::array();
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      if (!reports_[i]) continue;
      const DetectFiles files = files_of(sources_[i]);
      json["cameras"].push_back({{"sequence", sources_[i].sequence},
                                 {"camera", sources_[i].camera},
                                 {"frames", reports_[i]->frames},
                                 {"frames_with_person", reports_[i]->with_person},
                                 {"mean_confidence", reports_[i]->mean_confidence},
                                 {"keypoints", files.keypoints.string()},
                                 {"joints3d", files.joints.string()},
                                 {"masks", files.masks.string()}});
    }
    return json;
  }

 private:
  /// The files of several sequences are in a folder each.
  DetectFiles files_of(const DetectSource& source) const { return files_of(source, arguments_.out); }
  DetectFiles files_of(const DetectSource& source, const fs::path& out) const {
    const fs::path folder = sequences_ > 0 ? out / source.sequence : out;
    const bool only_masks = network_ && network_->layout.points.empty();
    return {only_masks ? fs::path() : folder / (source.camera + ".csv"),
            network_ ? fs::path() : folder / (source.camera + "_joints3d.csv"),
            arguments_.masks || only_masks ? folder / "masks" / source.camera : fs::path()};
  }

  void work(const CameraWorker& worker) {
    const auto advance = [&] {
      ++frames_done_;
      return !stop_requested() && !failed_;
    };
    try {
      for (std::size_t i = next_++; i < sources_.size() && !stop_requested() && !failed_; i = next_++)
        if (shard_.owns(i)) reports_[i] = worker(sources_[i], files_of(sources_[i]), advance);
    } catch (...) {
      const std::lock_guard lock(error_mutex_);
      if (!error_) error_ = std::current_exception();
      failed_ = true;
    }
    ++workers_done_;
  }

  void compare_views() const {
    std::vector<fs::path> folders;
    for (const DetectSource& source : sources_) folders.push_back(files_of(source).masks);
    const long dropped = compare_masks(sources_, folders, [] { return !stop_requested(); });
    if (dropped > 0) log::info("{} pixels of masks were contradicted by the other cameras and are removed", dropped);
  }

  void show_progress() {
    long total = 0, shown = 0;
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (shard_.owns(i)) total += static_cast<long>(sources_[i].frames.size()) * (sharpen_ ? 2 : 1);
    Progress progress("detect", total);
    for (bool ended = false; !ended;) {
      ended = workers_done_ == workers_.size();
      if (!ended) std::this_thread::sleep_for(kPollInterval);
      const long done = frames_done_;
      progress.advance(done - shown);
      shown = done;
    }
  }

  DetectArguments arguments_;
  Shard shard_;  ///< camera c of sequence s is unit s*C + c
  std::vector<DetectSource> sources_;
  int sequences_ = 0;     ///< sources of another sequence than the first
  bool sharpen_ = false;  ///< whether masks become sharp
  std::vector<std::optional<DetectReport>> reports_;
  std::optional<DetectNetwork> network_;  ///< not given: BlazePose
  std::vector<CameraWorker> workers_;
  std::atomic<std::size_t> next_{0}, workers_done_{0};
  std::atomic<long> frames_done_{0};
  std::atomic<bool> failed_{false};
  std::mutex error_mutex_;
  std::exception_ptr error_;
};

void print_table(const Json& report) {
  fmt::print("{:<24} {:>8} {:>12} {:>16}\n", "camera", "frames", "with person", "mean confidence");
  for (const Json& camera : report["cameras"]) {
    const std::string sequence = camera["sequence"].get<std::string>();
    fmt::print("{:<24} {:>8} {:>12} {:>16.3f}\n",
               sequence + (sequence.empty() ? "" : " ") + camera["camera"].get<std::string>(),
               camera["frames"].get<long>(), camera["frames_with_person"].get<long>(),
               camera["mean_confidence"].get<double>());
  }
}

/// The files of all cameras, and for a capture its description with these files. @return nothing: stopped
std::optional<Json> detect(const DetectArguments& arguments, const CommonOptions& common) {
  if (!arguments.has_network() && !arguments.layout.empty())
    fail<UsageError>("--layout belongs to --network; BlazePose has the layout mediapipe33");
  check_detect_out(arguments.source, arguments.out);
  begin_work(common, arguments.out, [&] { return detect_inputs(arguments.source); });
  const FolderLock lock(arguments.out);
  DetectJob job(arguments, common);
  if (!(common.merged.empty() ? job.run() : job.merge(common.merged))) {
    log::warn("stopped; cameras that were not finished have no tables");
    return std::nullopt;
  }
  const Json report = job.report();
  finish_work(common, arguments.out, job.results());
  if (common.shard) return report;
  write_atomically(arguments.out / "detect.json", report.dump(2) + "\n");
  write_detected_capture(arguments.source, arguments.out, report, arguments.keep_keypoints);
  return report;
}

int run(const DetectArguments& arguments, const CommonOptions& common) {
  const std::optional<Json> found = detect(arguments, common);
  if (!found) return 1;
  if (!common.merged.empty()) return 0;
  const Json& report = *found;
  if (common.json)
    fmt::print("{}\n", report.dump(2));
  else
    print_table(report);
  return 0;
}

}  // namespace

bool detect_capture(const fs::path& capture, const fs::path& out, bool masks, const CommonOptions& common) {
  DetectArguments arguments;
  arguments.source = capture.string();
  arguments.out = out;
  arguments.masks = masks;
  return detect(arguments, common).has_value();
}

Command add_detect(CLI::App& program) {
  auto arguments = std::make_shared<DetectArguments>();
  CLI::App* app = program.add_subcommand(
      "detect", "Find a person's keypoints, joints in space and masks in videos with MediaPipe's BlazePose");
  app->add_option("source", arguments->source, "Video file, folder of images, capture folder or capture.yaml")
      ->required();
  app->add_option("--out", arguments->out, "Folder to write into")->required();
  app->add_option("--model", arguments->model,
                  "Network: larger ones are slower and more accurate (default: heavy for a capture of several cameras, "
                  "full otherwise)")
      ->check(CLI::IsMember({"lite", "full", "heavy"}));
  app->add_flag_function(
      "--mirror,!--no-mirror", [arguments](std::int64_t count) { arguments->mirror = count > 0; },
      "Read each image in a mirror too and take the mean: more accurate, twice the time (default: for a capture of "
      "several cameras without --model)");
  app->add_flag("--masks", arguments->masks, "Also write masks: 255 on the person, 0 elsewhere");
  app->add_flag("--raw-masks", arguments->raw_masks, "With --masks: the network's probability of the person times 255");
  app->add_flag("--keep-keypoints", arguments->keep_keypoints,
                "The capture that is written keeps the keypoints that the capture has");
  app->add_option("--person", arguments->person,
                  "Of several people, follow the one whose hips are nearest to this pixel in the first frame (x y)")
      ->expected(2);
  app->add_option("--network", arguments->network, "A network of your own (.onnx) instead of BlazePose");
  app->add_option("--config", arguments->config,
                  "Its input and outputs: rtmpose, hrnet, vitpose or a YAML file (docs/detect.md)");
  app->add_option(
      "--layout", arguments->layout,
      "Its points: a built-in layout (coco17, halpe26, ...) or the file of a keypoint map; without a layout "
      "the network finds masks");
  app->footer(kDetectExample);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }, true};
}

}  // namespace doppel::tools
