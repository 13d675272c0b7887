#include <algorithm>
#include <atomic>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.h"
#include "detect_camera.h"
#include "detect_masks.h"
#include "detect_network.h"
#include "detect_people.h"
#include "detect_sources.h"
#include "detected_capture.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/core/workers.h"
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
constexpr char kPeople[] = "people";  ///< key of the report and of the results of shards

struct DetectArguments {
  std::string source, model, network, config, layout;  ///< model empty: chosen by the number of cameras
  fs::path out;
  std::vector<std::string> person;  ///< words of --person
  bool face = false, masks = false, raw_masks = false, keep_keypoints = false;
  std::optional<bool> mirror, hands;  ///< nothing: as the model was chosen

  bool has_network() const { return !network.empty() || !config.empty(); }
};

/// Whether the sources are several cameras. These are no live recording, so accuracy counts more than time.
bool several_cameras(const std::vector<DetectSource>& sources) {
  return std::any_of(sources.begin(), sources.end(),
                     [&](const DetectSource& source) { return source.camera != sources[0].camera; });
}

/// @param accurate whether accuracy counts more than time
PersonPoints chosen_points(const DetectArguments& arguments, bool accurate) {
  if (arguments.face) return PersonPoints::body_face_hands;
  return arguments.hands.value_or(accurate) ? PersonPoints::body_hands : PersonPoints::body;
}

/// Searches the images of one camera.
using CameraWorker = std::function<std::optional<DetectReport>(
    const DetectSource&, const DetectFiles&, const PersonGuide&, const std::function<bool()>& advance)>;

CameraWorker worker_of(const DetectNetwork& chosen) {
  const auto network = std::make_shared<PersonNetwork>(chosen.options, static_cast<int>(chosen.layout.points.size()));
  return [=](const DetectSource& source, const DetectFiles& files, const PersonGuide& guide,
             const std::function<bool()>& advance) {
    return detect_camera_with(chosen, *network, source, files, guide.start(), advance);
  };
}

/// @param sharpen whether masks become sharp
CameraWorker worker_of(const BodyDetectorOptions& options, PersonPoints points, bool sharpen) {
  const auto detectors = std::make_shared<PersonDetectors>(PersonDetectors{BodyDetector(options), {}, {}});
  if (points != PersonPoints::body) detectors->hands.emplace(options.threads);
  if (points == PersonPoints::body_face_hands) detectors->face.emplace(options.threads);
  return [=](const DetectSource& source, const DetectFiles& files, const PersonGuide& guide,
             const std::function<bool()>& advance) {
    return detect_camera(source, files, *detectors, guide, sharpen, advance);
  };
}

/// To find out who is who, neither masks nor the larger network are needed.
BodyDetectorOptions looking_options(BodyDetectorOptions options) {
  if (options.model == BlazePoseModel::heavy) options.model = BlazePoseModel::full;
  options.masks = options.mirror = false;
  return options;
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
        merging_(!common.merged.empty()),
        sources_(detect_sources(arguments.source)),
        crew_(std::clamp(static_cast<int>(sources_.size()) / shard_.count, 1, resolve_threads(common.threads))),
        guides_(sources_.size()),
        reports_(sources_.size()) {
    const int threads = resolve_threads(common.threads);
    for (const DetectSource& source : sources_) sequences_ += source.sequence != sources_[0].sequence;
    const bool several = several_cameras(sources_), accurate = arguments.model.empty() && several;
    if (arguments_.model.empty()) arguments_.model = accurate ? "heavy" : "full";
    if (arguments.has_network())
      network_ = choose_network(arguments.network, arguments.config, arguments.layout, arguments.masks);
    options_ = {.model = parse_blazepose_model(arguments_.model),
                .threads = std::clamp(threads / crew_.count(), 1, 8),
                .masks = arguments.masks,
                .mirror = arguments.mirror.value_or(accurate),
                .models = {}};
    if (!network_) points_ = chosen_points(arguments, accurate);
    choose_person(several);
    sharpen_ = arguments.masks && !arguments.raw_masks && !network_;
    // A shard has not the masks of all cameras.
    compare_ = sharpen_ && shard_.count == 1;
    for (int i = 0; i < crew_.count() && !merging_; ++i)
      workers_.push_back(network_ ? worker_of(*network_) : worker_of(options_, points_, sharpen_));
  }

  /// @return whether all cameras are done; otherwise the user has stopped the job
  bool run() {
    with_progress([&] {
      find_people();
      follow_cameras();
      if (compare_) compare_views();
    });
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (shard_.owns(i) && !reports_[i]) return false;
    return !stop_requested();
  }

  /// The counts of the cameras of this shard, for `merge`.
  Json results() const {
    Json results = Json::object();
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (reports_[i])
        results[std::to_string(i)] = {reports_[i]->frames, reports_[i]->with_person, reports_[i]->mean_confidence};
    if (!people_.empty()) results[kPeople] = people_;
    return results;
  }

  /// Does the work of `run` with the files and counts of shards. @return false: the user has stopped it
  bool merge(const ShardSet& shards) {
    for (const auto& shard : shards.files) add_people(shard.results);
    for (std::size_t i = 0; i < sources_.size() && !stop_requested(); ++i) {
      const std::size_t shard = i % shards.folders.size();
      const DetectFiles from = files_of(sources_[i], shards.folders[shard]), to = files_of(sources_[i]);
      copy_if_written(from.keypoints, to.keypoints);
      copy_if_written(from.joints, to.joints);
      copy_if_written(from.masks, to.masks);
      reports_[i] = report_of(shards.files[shard].results, i, shards.folders[shard]);
    }
    if (compare_ && !stop_requested()) with_progress([&] { compare_views(); });
    return !stop_requested();
  }

  Json report() const {
    Json json;
    if (network_)
      json = {{"layout", network_->layout.name}, {"network", network_->options.network.model.string()}};
    else
      json = {{"layout", mediapipe_layout(points_).name}, {"model", arguments_.model}, {"package", kModelPackage.name}};
    if (points_ != PersonPoints::body) json["hand_package"] = kHandPackage.name;
    if (points_ == PersonPoints::body_face_hands) json["face_package"] = kFacePackage.name;
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
    if (!people_.empty()) json[kPeople] = people_;
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
            arguments_.masks || only_masks ? folder / "masks" / source.camera : fs::path(),
            sharpen_ && is_compared(source, sources_)};
  }

  /// Reads whom the user names. The only camera needs no search.
  void choose_person(bool several) {
    if (network_ && several && !arguments_.person.empty())
      fail<UsageError>(
          "--person: with --network it is a pixel of one camera, and {} has several; run the command for "
          "each video",
          arguments_.source);
    wish_ = read_person_wish(arguments_.person, sources_, arguments_.source);
    if (!several) std::fill(guides_.begin(), guides_.end(), PersonGuide(wish_.pixel));
    if (network_ || merging_) return;
    for (PeopleSearch& search : plan_searches(sources_))
      if (std::any_of(search.sources.begin(), search.sources.end(), [&](std::size_t i) { return shard_.owns(i); }))
        searches_.push_back(std::move(search));
  }

  /// Finds out who is who in each sequence, from all of its cameras. A shard does it for all cameras too, so that the
  /// shards follow the same person.
  void find_people() {
    std::vector<std::unique_ptr<BodyDetector>> detectors(as_size(crew_.count()));
    for (const PeopleSearch& search : searches_) {
      std::vector<std::optional<CameraPeople>> seen(search.sources.size());
      crew_.share(seen.size(), [&](std::size_t worker, std::size_t c) {
        if (!detectors[worker]) detectors[worker] = std::make_unique<BodyDetector>(looking_options(options_));
        seen[c] =
            look_at_people(sources_[search.sources[c]], search.rows, *detectors[worker], [&] { return advance(); });
      });
      if (stop_requested()) return;
      std::vector<CameraPeople> all;
      for (std::optional<CameraPeople>& camera : seen) all.push_back(std::move(*camera));
      const FollowedPerson followed = choose_followed(search, sources_, all, wish_);
      for (std::size_t c = 0; c < search.sources.size(); ++c) guides_[search.sources[c]] = followed.guides[c];
      if (!followed.report.is_null()) people_.push_back(followed.report);
    }
  }

  /// People of sequences that are not known yet, from the results of a shard.
  void add_people(const Json& results) {
    const auto found = results.find(kPeople);
    if (found == results.end()) return;
    for (const Json& people : *found)
      if (std::find(people_.begin(), people_.end(), people) == people_.end()) people_.push_back(people);
  }

  void follow_cameras() {
    crew_.share(sources_.size(), [&](std::size_t worker, std::size_t i) {
      if (!shard_.owns(i)) return;
      reports_[i] = workers_[worker](sources_[i], files_of(sources_[i]), guides_[i], [&] { return advance(); });
    });
  }

  void compare_views() {
    if (stop_requested()) return;
    std::vector<fs::path> folders;
    for (const DetectSource& source : sources_) folders.push_back(files_of(source).masks);
    const auto [removed, added] = compare_masks(sources_, folders, [&] { return advance(); });
    if (removed > 0) log::info("{} pixels of masks were contradicted by the other cameras and are removed", removed);
    if (added > 0)
      log::info("{} pixels that the network had missed are added: other cameras see the person there", added);
  }

  /// Called before or after each step of the work. @return whether to go on
  bool advance() {
    ++steps_done_;
    return crew_.wanted();
  }

  /// All steps: images in which people are looked for, images that are searched, and moments in which masks are
  /// compared.
  long num_steps() const {
    long steps = compare_ ? num_compared_moments(sources_) : 0;
    if (merging_) return steps;
    for (const PeopleSearch& search : searches_) steps += static_cast<long>(search.rows.size() * search.sources.size());
    for (std::size_t i = 0; i < sources_.size(); ++i)
      if (shard_.owns(i)) steps += static_cast<long>(sources_[i].frames.size());
    return steps;
  }

  /// Does the work beside the line that shows its progress.
  void with_progress(const std::function<void()>& work) {
    Progress progress("detect", num_steps());
    long shown = 0;
    const auto show = [&] {
      const long steps = steps_done_;
      progress.advance(steps - shown);
      shown = steps;
    };
    Workers(1).share(
        1, [&](std::size_t, std::size_t) { work(); }, show);
  }

  DetectArguments arguments_;
  Shard shard_;  ///< camera c of sequence s is unit s*C + c
  bool merging_;
  std::vector<DetectSource> sources_;
  Workers crew_;
  int sequences_ = 0;  ///< sources of another sequence than the first
  PersonPoints points_ = PersonPoints::body;
  bool sharpen_ = false;  ///< whether masks become sharp
  bool compare_ = false;  ///< whether they are compared between the cameras
  PersonWish wish_;
  std::vector<PeopleSearch> searches_;
  std::vector<PersonGuide> guides_;  ///< of each source
  Json people_ = Json::array();      ///< of the sequences with several people
  std::vector<std::optional<DetectReport>> reports_;
  std::optional<DetectNetwork> network_;  ///< not given: BlazePose
  BodyDetectorOptions options_;
  std::vector<CameraWorker> workers_;
  std::atomic<long> steps_done_{0};
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
    fail<UsageError>(
        "--layout belongs to --network; BlazePose has the layout mediapipe33, with --hands mediapipe75, with --face "
        "mediapipe543");
  if (arguments.has_network() && (arguments.hands.value_or(false) || arguments.face))
    fail<UsageError>(
        "--hands and --face belong to BlazePose, and --network takes its place; a network of your own may find hands "
        "and faces");
  if (arguments.face && !arguments.hands.value_or(true))
    fail<UsageError>("--face with --no-hands: no layout has a face without hands; leave out --no-hands");
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

/// Behind `--person X Y`, the source may be taken for a third word of the option.
void find_source(DetectArguments& arguments) {
  if (arguments.source.empty() && arguments.person.size() == 3) {
    arguments.source = arguments.person.back();
    arguments.person.pop_back();
  }
  if (arguments.source.empty())
    fail<UsageError>("detect: a source is required: a video, a folder of images or a capture");
}

int run(DetectArguments arguments, const CommonOptions& common) {
  find_source(arguments);
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
  app->add_option("source", arguments->source,
                  "Video file, folder of images, capture folder or capture.yaml (required)");
  app->add_option("--out", arguments->out, "Folder to write into")->required();
  CLI::Option* model =
      app->add_option(
             "--model", arguments->model,
             "Network: larger ones are slower and more accurate (default: heavy for a capture of several cameras, "
             "full otherwise)")
          ->check(CLI::IsMember({"lite", "full", "heavy"}));
  CLI::Option* mirror = app->add_flag_function(
      "--mirror,!--no-mirror", [arguments](std::int64_t count) { arguments->mirror = count > 0; },
      "Read each image in a mirror too and take the mean: more accurate, twice the time (default: for a capture of "
      "several cameras without --model)");
  app->add_flag_function(
      "--hands,!--no-hands", [arguments](std::int64_t count) { arguments->hands = count > 0; },
      "Also find 21 points of each hand (default: for a capture of several cameras without --model)");
  app->add_flag("--face,!--no-face", arguments->face, "Also find hands and 468 points of the face (default: no)");
  CLI::Option* masks = app->add_flag("--masks", arguments->masks, "Also write masks: 255 on the person, 0 elsewhere");
  app->add_flag("--raw-masks", arguments->raw_masks, "With --masks: the network's probability of the person times 255")
      ->needs(masks);
  app->add_flag("--keep-keypoints", arguments->keep_keypoints,
                "The capture that is written keeps the keypoints that the capture has");
  app->add_option(
         "--person", arguments->person,
         "Of several people, follow the one whose hips are nearest to this pixel: X Y in the first frame of one "
         "camera; CAMERA X Y in a capture; or X Y Z, a position in the world, metres")
      ->expected(2, 3);
  app->add_option("--network", arguments->network, "A network of your own (.onnx) instead of BlazePose")
      ->excludes(model)
      ->excludes(mirror);
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
