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
#include "detect_sources.h"
#include "detected_capture.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kDetectExample[] =
    "Examples:\n"
    "  doppel detect street.mp4 --out street/detected\n"
    "  doppel detect recordings/anna --out recordings/anna/detected --model heavy --masks";
constexpr std::chrono::milliseconds kPollInterval{100};

struct DetectArguments {
  std::string source, model = "full";
  fs::path out;
  std::vector<double> person;
  bool masks = false;
};

BlazePoseModel parse_model(const std::string& word) {
  for (const BlazePoseModel model : {BlazePoseModel::lite, BlazePoseModel::full, BlazePoseModel::heavy})
    if (to_string(model) == word) return model;
  fail<UsageError>("--model is \"{}\"; expected lite, full or heavy", word);
}

/// Works on several cameras at a time: more threads for one camera gain less than one thread for each camera.
class DetectJob {
 public:
  DetectJob(const DetectArguments& arguments, int threads)
      : arguments_(arguments), sources_(detect_sources(arguments.source)), reports_(sources_.size()) {
    for (const DetectSource& source : sources_) sequences_ += source.sequence != sources_[0].sequence;
    if (!arguments.person.empty() && sources_.size() != 1)
      fail<UsageError>("--person states a pixel of one camera; {} has {} cameras", arguments.source, sources_.size());
    const int workers = std::clamp(static_cast<int>(sources_.size()), 1, threads);
    const BodyDetectorOptions options{
        parse_model(arguments.model), std::clamp(threads / workers, 1, 8), arguments.masks, {}};
    for (int i = 0; i < workers; ++i) detectors_.push_back(std::make_unique<BodyDetector>(options));
  }

  /// @return whether all cameras are done; otherwise the user has stopped the job
  bool run() {
    std::vector<std::thread> workers;
    for (const auto& detector : detectors_) workers.emplace_back([&] { work(*detector); });
    show_progress();
    for (std::thread& worker : workers) worker.join();
    if (error_) std::rethrow_exception(error_);
    return std::all_of(reports_.begin(), reports_.end(), [](const auto& report) { return report.has_value(); });
  }

  Json report() const {
    Json json{{"layout", "mediapipe33"}, {"model", arguments_.model}, {"package", kModelPackage}};
    json["cameras"] = Json::array();
    for (std::size_t i = 0; i < sources_.size(); ++i) {
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
  DetectFiles files_of(const DetectSource& source) const {
    const fs::path folder = sequences_ > 0 ? arguments_.out / source.sequence : arguments_.out;
    return {folder / (source.camera + ".csv"), folder / (source.camera + "_joints3d.csv"),
            arguments_.masks ? folder / "masks" / source.camera : fs::path()};
  }

  void work(BodyDetector& detector) {
    std::optional<Eigen::Vector2d> person;
    if (!arguments_.person.empty()) person = Eigen::Vector2d(arguments_.person[0], arguments_.person[1]);
    const auto advance = [&] {
      ++frames_done_;
      return !stop_requested() && !failed_;
    };
    try {
      for (std::size_t i = next_++; i < sources_.size() && !stop_requested() && !failed_; i = next_++)
        reports_[i] = detect_camera(sources_[i], files_of(sources_[i]), detector, person, advance);
    } catch (...) {
      const std::lock_guard lock(error_mutex_);
      if (!error_) error_ = std::current_exception();
      failed_ = true;
    }
    ++workers_done_;
  }

  void show_progress() {
    long total = 0, shown = 0;
    for (const DetectSource& source : sources_) total += static_cast<long>(source.frames.size());
    Progress progress("detect", total);
    for (bool ended = false; !ended;) {
      ended = workers_done_ == detectors_.size();
      if (!ended) std::this_thread::sleep_for(kPollInterval);
      const long done = frames_done_;
      progress.advance(done - shown);
      shown = done;
    }
  }

  DetectArguments arguments_;
  std::vector<DetectSource> sources_;
  int sequences_ = 0;  ///< sources of another sequence than the first
  std::vector<std::optional<DetectReport>> reports_;
  std::vector<std::unique_ptr<BodyDetector>> detectors_;
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
  check_detect_out(arguments.source, arguments.out);
  DetectJob job(arguments, resolve_threads(common.threads));
  if (!job.run()) {
    log::warn("stopped; cameras that were not finished have no tables");
    return std::nullopt;
  }
  const Json report = job.report();
  write_atomically(arguments.out / "detect.json", report.dump(2) + "\n");
  write_detected_capture(arguments.source, arguments.out, report);
  return report;
}

int run(const DetectArguments& arguments, const CommonOptions& common) {
  const std::optional<Json> found = detect(arguments, common);
  if (!found) return 1;
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
  app->add_option("--model", arguments->model, "Network: larger ones are slower and more accurate")
      ->check(CLI::IsMember({"lite", "full", "heavy"}))
      ->capture_default_str();
  app->add_flag("--masks", arguments->masks, "Also write masks: probability of the person times 255");
  app->add_option("--person", arguments->person,
                  "Of several people, follow the one whose hips are nearest to this pixel in the first frame (x y)")
      ->expected(2);
  app->footer(kDetectExample);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
