#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "command.h"
#include "doppel/character/character.h"
#include "doppel/character/character_folder.h"
#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/hold_out.h"
#include "make_chain.h"
#include "make_recipe.h"
#include "make_report.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Adjusted cameras are used if keypoints are then at most this share of the distance from the projections of their
// points, and if each camera has moved a little only. With an exact calibration the share is .97, as the adjustment
// also follows errors of the detector. With few poses, adjusted cameras can be far from the true ones
// (docs/results/bodies.md).
constexpr double kMaxDistanceShare = 0.7, kMaxTurn = 2.0, kMaxShift = 100.0;  // degrees, mm
// Of the minutes: training ends where evaluation, export and film begin, and takes at least a quarter.
constexpr double kTrainingEnd = 0.9, kMinTraining = 0.25;
constexpr double kMinFilmSeconds = 6.0;  // in which the camera of the film turns by 216 degrees
constexpr char kMakeExample[] =
    "Examples:\n"
    "  doppel make recordings/anna --out anna\n"
    "  doppel make recordings/anna --out anna --minutes 20\n"
    "  doppel make recordings/anna --out anna --stop-after track\n"
    "FOLDER holds a video of each camera and a calibration of any known format (docs/calibration.md), and perhaps a "
    "capture.yaml,\nkeypoints, masks, images of the empty scene or a character. Stopped or killed, the same "
    "command goes on.";
const std::vector<std::string> kSteps{"describe", "detect",  "doctor",  "calibrate", "split",    "fit",    "track",
                                      "refine",   "prepare", "measure", "train",     "evaluate", "export", "animate"};

struct MakeArguments {
  fs::path folder, out;
  std::string scan, stop_after;
  double minutes = 60.0;
  bool keep_going = false;
};

/// Images of all cameras and sequences, and what they are worth.
struct FootageSize {
  long frames = 0, train_frames = 0, cameras = 0;
  int longer_side = 0;
  double images() const { return static_cast<double>(frames * cameras); }
};

FootageSize size_of(const Capture& capture) {
  const CaptureCameras filmed = filmed_cameras(capture);
  FootageSize size;
  size.cameras = static_cast<long>(filmed.cameras.size());
  for (const Camera& camera : filmed.cameras)
    size.longer_side = std::max({size.longer_side, camera.width, camera.height});
  for (const SequenceEntry& sequence : capture.sequences) {
    const RowRange rows = rows_of_sequence(capture, sequence, filmed);
    size.frames += rows.last - rows.first + 1;
    if (sequence.split == Split::train) size.train_frames += rows.last - rows.first + 1;
  }
  return size;
}

/// Guesses of a core of 2.4 GHz; MakeChain corrects them by the machine.
std::vector<PlannedStep> plan_of(const FootageSize& size, double minutes) {
  const double images = size.images(), frames = static_cast<double>(size.frames);
  std::vector<PlannedStep> plan{{"describe", 1.0},
                                {"detect", 0.3 * images},
                                {"doctor", 20.0 + 0.01 * images},
                                {"calibrate", 60.0},
                                {"split", 1.0},
                                {"fit", 120.0},
                                {"track", 0.05 * frames * static_cast<double>(size.cameras)},
                                {"refine", 60.0 + 0.2 * images},
                                {"prepare", 0.02 * images},
                                {"measure", 60.0}};
  plan.push_back({"train", kMinTraining * minutes * 60.0, kTrainingEnd * minutes * 60.0});
  plan.push_back({"evaluate", 60.0});
  plan.push_back({"export", 15.0});
  plan.push_back({"animate", 60.0});
  return plan;
}

/// A motion, and where it is too short, the same backwards and forwards until it has enough frames.
/// @pre the motion has a frame
Motion to_and_fro(const Motion& motion, std::size_t min_frames) {
  Motion longer = motion;
  const std::size_t last = motion.frames.size() - 1;
  for (std::size_t i = 1; last > 0 && longer.frames.size() < min_frames; ++i) {
    const std::size_t turn = i % (2 * last);
    longer.frames.push_back(motion.frames[turn < last ? last - turn : turn - last]);
    longer.ids.push_back(longer.ids.back() + 1);
  }
  return longer;
}

/// The chain of commands from a folder of footage to an actor.
class Make {
 public:
  Make(const MakeArguments& arguments, const CommonOptions& common) : arguments_(arguments), common_(common) {
    // A slash at the end would make other commands of the same steps.
    for (fs::path* folder : {&arguments_.folder, &arguments_.out}) *folder = folder_path(*folder);
    if (fs::weakly_canonical(arguments_.folder) == fs::weakly_canonical(arguments_.out))
      fail<UsageError>("--out: {} is the folder of the footage; choose another one", arguments_.out.string());
    fs::create_directories(arguments_.out);
    const std::optional<CaptureGuess> recognised = recognise_capture(arguments_.folder);
    described_ = recognised.has_value();
    capture_ = described_ ? arguments_.folder.string() : out("capture.yaml");
    const CaptureGuess guess = recognised ? *recognised : guess_folder(arguments_.folder);
    if (!guess.complete) fail_incomplete(guess);
    size_ = size_of(guess.capture);
    std::vector<std::string> inputs = capture_inputs(guess.capture);
    inputs.push_back(fmt::format("--minutes {}", arguments_.minutes));
    if (!arguments_.scan.empty())
      inputs.push_back(fmt::format("--scan {}, {} bytes", arguments_.scan, fs::file_size(arguments_.scan)));
    chain_.emplace(arguments_.out, common, std::move(inputs), plan_of(size_, arguments_.minutes));
  }

  /// @return whether all steps were run
  bool run() {
    using Step = void (Make::*)();
    const std::array<std::pair<const char*, Step>, 14> steps{{{"describe", &Make::describe},
                                                              {"detect", &Make::detect},
                                                              {"doctor", &Make::examine},
                                                              {"calibrate", &Make::calibrate},
                                                              {"split", &Make::split},
                                                              {"fit", &Make::find_body},
                                                              {"track", &Make::track},
                                                              {"refine", &Make::refine},
                                                              {"prepare", &Make::prepare},
                                                              {"measure", &Make::measure_speed},
                                                              {"train", &Make::train},
                                                              {"evaluate", &Make::evaluate},
                                                              {"export", &Make::export_actor},
                                                              {"animate", &Make::animate}}};
    for (const auto& [name, step] : steps) {
      (this->*step)();
      if (arguments_.stop_after == name) return &step == &steps.back().second;
    }
    return true;
  }

  /// What was made, for --json. Also writes `report.html`.
  Json finish(bool complete) {
    Json report{{"out", arguments_.out.string()},
                {"complete", complete},
                {"seconds", chain_->seconds()},
                {"steps", chain_->steps()}};
    for (const char* file : {"actor.pt", "actor.glb", "evaluation.json"})
      if (complete) report["files"][file] = out(file);
    write_make_report(arguments_.out, arguments_.folder.filename().string(), chain_->steps(), results_);
    report["report"] = out("report.html");
    return report;
  }

 private:
  std::string out(const std::string& name) const { return (arguments_.out / name).string(); }

  [[noreturn]] void fail_incomplete(const CaptureGuess& guess) const {
    for (const std::string& sentence : guess.missing)
      if (!sentence.starts_with("no character")) fmt::print(stderr, "missing: {}\n", sentence);
    fail("{} is not enough for an actor: calibration or footage is missing (see above)", arguments_.folder.string());
  }

  template <typename Property>
  static bool any_sequence(const Capture& capture, Property has) {
    return std::any_of(capture.sequences.begin(), capture.sequences.end(), has);
  }

  Json step(const std::string& name, const std::vector<std::string>& words, int failing = 0) {
    return results_[name] = chain_->run(name, words, failing);
  }

  void describe() {
    if (!described_)
      step("describe", {"capture", "init", arguments_.folder.string(), "--out", out("capture.yaml"), "--force"});
  }

  void detect() {
    const Capture capture = find_capture(capture_);
    // A capture has one layout of keypoints, so those that are found replace those of the folder.
    const bool points = !capture.detector &&
                        any_sequence(capture, [](const SequenceEntry& sequence) { return sequence.keypoints.empty(); });
    const bool masks = any_sequence(capture, [](const SequenceEntry& sequence) { return !sequence.has_masks(); });
    if (!points && !masks) return chain_->skip("detect", "the folder has keypoints and masks");
    std::vector<std::string> words{"detect", capture_, "--out", out("detected")};
    if (masks) words.emplace_back("--masks");
    if (!points) words.emplace_back("--keep-keypoints");
    step("detect", words);
    capture_ = out("detected/capture.yaml");
  }

  /// The names of the faults in what `doctor` has printed, once for each camera.
  static std::multiset<std::string> faults_of(const Json& examination) {
    std::multiset<std::string> faults;
    for (const Json& finding : examination.at("findings"))
      if (finding.at("severity") == "fault") faults.insert(finding.at("fault").get<std::string>());
    return faults;
  }

  void examine() {
    examination_ = step("doctor", {"doctor", capture_, "--out", out("doctor.html")}, 1);
    if (examination_.at("verdict") == "faulty") mend();
    if (examination_.at("verdict") != "faulty") return;
    for (const Json& finding : examination_.at("findings"))
      fmt::print(stderr, "{}: {}{}: {}\n    {}\n", finding.at("severity").get<std::string>(),
                 finding.at("camera").is_string() ? "camera " + finding["camera"].get<std::string>() + ": " : "",
                 finding.at("fault").get<std::string>(), finding.at("figure").get<std::string>(),
                 finding.at("advice").get<std::string>());
    if (arguments_.keep_going) return log::warn("the recording is faulty; --keep-going goes on");
    fail(
        "the recording is faulty (see above, and {}); mend it and run the same command with a new --out, or add "
        "--keep-going",
        out("doctor.html"));
  }

  /// Mends what `calibrate sync` and `calibrate refine` can mend, and keeps the result if it has fewer faults.
  void mend() {
    const std::multiset<std::string> faults = faults_of(examination_);
    std::string mended = capture_;
    if (faults.count("out_of_sync") + faults.count("rolling_offset") > 0) {
      for (const SequenceEntry& sequence : find_capture(mended).sequences) {
        std::vector<std::string> words{"calibrate",       "sync", mended, "--sequence", sequence.name, "--out",
                                       out("synced.yaml")};
        if (faults.count("rolling_offset") > 0) words.emplace_back("--drift");
        step("sync " + sequence.name, words);
        mended = out("synced.yaml");
      }
    }
    if (faults.count("moved_camera") + faults.count("focal_length") > 0 &&
        !adjust_cameras(mended, faults.count("focal_length") > 0).empty())
      mended = with_adjusted_cameras(mended);
    if (mended != capture_) adopt(mended, "doctor_mended", faults.size() - 1);
  }

  /// @return what `calibrate refine` prints; empty if it found no calibration
  Json adjust_cameras(const std::string& capture, bool focal) {
    std::vector<std::string> words{"calibrate", "refine", capture, "--out", out("refined.yml")};
    if (focal) words.emplace_back("--focal");
    return step("calibrate", words, 1);
  }
  std::string with_adjusted_cameras(const std::string& capture) {
    step("calibrated",
         {"capture", "amend", capture, "--calibration", out("refined.yml"), "--out", out("refined.yaml")});
    return out("refined.yaml");
  }

  /// Goes on with a mended capture if `doctor` finds no more faults in it than are allowed.
  /// @param examination name of the step
  void adopt(const std::string& mended, const std::string& examination, std::size_t allowed) {
    Json after = step(examination, {"doctor", mended, "--out", out(examination + ".html")}, 1);
    if (faults_of(after).size() > allowed) return;
    capture_ = mended;
    examination_ = std::move(after);
  }

  /// Keeps the cameras of `calibrate refine` where the given ones are clearly off. `doctor` reports only errors by
  /// which a camera stands out.
  void calibrate() {
    const Capture capture = find_capture(capture_);
    if (results_.contains("calibrate")) return chain_->skip("calibrate", "`doctor` named the cameras to adjust");
    if (size_.cameras < 3) return chain_->skip("calibrate", "two cameras do not show which of them is off");
    if (any_sequence(capture, [](const SequenceEntry& sequence) { return !sequence.motion.empty(); }))
      return chain_->skip("calibrate", "the motion of the folder is that of its calibration");
    const Json adjusted = adjust_cameras(capture_, false);
    if (adjusted.empty()) return chain_->skip("calibrate", "the calibration stays as it is");
    const auto before = adjusted.at("median_before_px").get<double>(),
               after = adjusted.at("median_after_px").get<double>();
    double turn = 0.0, shift = 0.0;
    for (const Json& camera : adjusted.at("cameras")) {
      turn = std::max(turn, camera.at("rotation_change_deg").get<double>());
      shift = std::max(shift, camera.at("centre_change_mm").get<double>());
    }
    const std::string change = fmt::format(
        "keypoints are {:.1f} pixels from the projections of their points, {:.1f} after an adjustment by up to {:.2g} "
        "degrees and {:.0f} mm",
        before, after, turn, shift);
    if (!(after <= kMaxDistanceShare * before && turn <= kMaxTurn && shift <= kMaxShift))
      return chain_->skip("calibrate", change + ": the calibration stays as it is");
    log::info("{}: the adjusted cameras are used", change);
    adopt(with_adjusted_cameras(capture_), "doctor_calibrated", faults_of(examination_).size());
  }

  void split() {
    step("split", {"capture", "amend", capture_, "--hold-out", "--out", out("split.yaml")});
    capture_ = out("split.yaml");
    const Capture capture = find_capture(capture_);
    for (const Split needed : {Split::train, Split::test})
      if (std::none_of(capture.sequences.begin(), capture.sequences.end(),
                       [needed](const SequenceEntry& sequence) { return sequence.split == needed; }))
        fail("{} has no sequence for the split {}; sequences of fewer than {} frames are not divided",
             arguments_.folder.string(), to_string(needed), kMinDividedRows);
  }

  void find_body() {
    if (!find_capture(capture_).character.empty()) return chain_->skip("fit", "the folder has a character");
    if (arguments_.scan.empty()) {
      step("fit", {"character", "fit", capture_, "--out", out("body")});
      track_config_ = out("body/track.yaml");
      capture_ = out("body/capture.yaml");
      return;
    }
    step("fit", {"character", "create", arguments_.scan, "--out", out("body")});
    step("body", {"capture", "amend", capture_, "--character", out("body/actor.character"), "--out", out("body.yaml")});
    capture_ = out("body.yaml");
    place_landmarks_ = true;
  }

  void track() {
    const Capture capture = find_capture(capture_);
    const bool posed = std::all_of(capture.sequences.begin(), capture.sequences.end(),
                                   [](const SequenceEntry& sequence) { return !sequence.motion.empty(); });
    if (posed) return chain_->skip("track", "the folder has the motion of every sequence");
    std::vector<std::string> words{"track", capture_, "--out", out("tracked")};
    if (!track_config_.empty()) words.insert(words.end(), {"--config", track_config_});
    if (place_landmarks_) words.emplace_back("--place-landmarks");
    step("track", words);
    capture_ = out("tracked");
    tracked_ = true;
  }

  void refine() {
    if (!tracked_) return chain_->skip("refine", "the motion of the folder stays as it is");
    if (load_character(find_capture(capture_).character_path()).mesh.uvs.empty())
      return chain_->skip("refine", "the character has no texture coordinates");
    std::vector<std::string> words{"track", "refine", capture_, "--out", out("refined")};
    if (!track_config_.empty()) words.insert(words.end(), {"--config", track_config_});
    step("refine", words);
    capture_ = out("refined");
  }

  void prepare() {
    const bool large = size_.longer_side >= 700;
    step("prepare", {"prepare", capture_, "--out", out("prepared"), "--mask-size", large ? "700" : "350",
                     "--image-size", large ? "512" : "256", "--overwrite"});
  }

  std::vector<std::string> training(const std::string& folder, const std::vector<std::string>& settings) const {
    std::vector<std::string> words{"train", out("recipe.yaml"), "--set", text_override("capture", out("prepared"))};
    for (const std::vector<std::string>& list : {recipe_.settings, settings})
      for (const std::string& setting : list) words.insert(words.end(), {"--set", setting});
    words.insert(words.end(), {"--out", out(folder)});
    return words;
  }

  /// Trains a few steps of each stage, which tells how many fit into the time.
  void measure_speed() {
    constexpr int kTried = 20;
    recipe_ = make_recipe(tracked_);
    write_atomically(out("recipe.yaml"), recipe_.text);
    std::vector<std::string> settings;
    for (const auto& [stage, steps] : recipe_.steps)
      settings.push_back(fmt::format("{}.train.iterations={}", stage, kTried));
    std::vector<std::string> words = training("speed", settings);
    words.emplace_back("--overwrite");
    const Json measured = step("measure", words);
    for (const auto& [stage, summary] : measured.at("stages").items())
      seconds_per_step_[stage] = summary.at("step_seconds").get<double>();
  }

  void train() {
    const double budget = std::max(kTrainingEnd * 60.0 * arguments_.minutes - chain_->seconds(),
                                   kMinTraining * 60.0 * arguments_.minutes);
    const long frames = size_of(find_capture(capture_)).train_frames;
    step("train", training("run", fit_recipe(recipe_, seconds_per_step_, frames, budget)));
  }

  void evaluate() {
    step("evaluate", {"evaluate", "--run", out("run"), "--split", "test", "--every",
                      std::to_string(std::max(1L, size_.frames / 200))});
    write_atomically(out("evaluation.json"), read_file(arguments_.out / "run" / "evaluation.json"));
  }

  void export_actor() { step("export", {"export", "--run", out("run"), "--out", out("actor.pt")}); }

  /// The rows of the first test sequence, which no stage was trained on.
  Motion unseen_motion(const Capture& capture) const {
    const auto test = std::find_if(capture.sequences.begin(), capture.sequences.end(),
                                   [](const SequenceEntry& sequence) { return sequence.split == Split::test; });
    if (test == capture.sequences.end()) fail("{} has no test sequence to film", capture_);
    const Character character = load_character(capture.character_path());
    const Motion motion = read_motion(capture.resolve(test->motion), character.num_dofs());
    const RowRange rows = rows_of_sequence(capture, *test, filmed_cameras(capture));
    Motion cut;
    for (long row = rows.first; row <= std::min<long>(rows.last, motion.num_frames() - 1); ++row) {
      cut.frames.push_back(motion.frames[static_cast<std::size_t>(row)]);
      cut.ids.push_back(row - rows.first);
    }
    if (cut.frames.empty()) fail("the motion of {} ends before the rows of its test sequence {}", capture_, test->name);
    return cut;
  }

  /// Writes a motion and names its file.
  std::string written(const std::string& name, const Motion& motion) const {
    write_motion(out(name), motion, true);
    return out(name);
  }

  void animate() {
    const Capture capture = find_capture(capture_);
    const Motion motion = unseen_motion(capture);
    step("figure", {"animate", "--run", out("run"), "--motion", written("unseen.motion", motion), "--format", "glb",
                    "--out", out("animation")});
    const auto frames = static_cast<std::size_t>(std::ceil(kMinFilmSeconds * capture.fps));
    step("animate", {"animate", "--run", out("run"), "--renderer", "gaussians", "--motion",
                     written("film.motion", to_and_fro(motion, frames)), "--format", "mp4", "--out", out("animation")});
    fs::copy_file(arguments_.out / "animation" / "animation.glb", arguments_.out / "actor.glb",
                  fs::copy_options::overwrite_existing);
    // A character of the user may lie in this very folder.
    const fs::path character = capture.character_path(), folder = arguments_.out / "character";
    if (!fs::exists(folder) || !fs::equivalent(folder, character.parent_path()))
      write_character(folder, load_character(character));
  }

  MakeArguments arguments_;
  const CommonOptions& common_;
  bool described_ = false, place_landmarks_ = false, tracked_ = false;
  std::string capture_, track_config_;
  FootageSize size_;
  MakeRecipe recipe_;
  std::optional<MakeChain> chain_;
  std::map<std::string, double> seconds_per_step_;
  Json results_ = Json::object();
  Json examination_;  ///< what `doctor` says of the capture
};

int run_make(const MakeArguments& arguments, const CommonOptions& common) {
  if (!fs::is_directory(arguments.folder)) fail<UsageError>("{} is not a folder", arguments.folder.string());
  if (!arguments.scan.empty() && !fs::exists(arguments.scan))
    fail<UsageError>("--scan: {} does not exist", arguments.scan);
  const FolderLock lock(arguments.out);
  Make make(arguments, common);
  try {
    const Json report = make.finish(make.run());
    if (common.json) {
      fmt::print("{}\n", report.dump(2));
    } else {
      for (const Json& step : report["steps"]) fmt::print("{}\n", step["command"].get<std::string>());
      fmt::print("report: {}\n", report["report"].get<std::string>());
    }
    return 0;
  } catch (const StepFailed& failed) {
    return failed.exit_code;
  }
}

}  // namespace

Command add_make(CLI::App& program) {
  auto arguments = std::make_shared<MakeArguments>();
  CLI::App* app = program.add_subcommand("make", "Make an actor from a folder of videos and a calibration: all steps");
  app->add_option("folder", arguments->folder, "Folder with the footage")->required();
  app->add_option("--out", arguments->out, "Folder to write into")->required();
  app->add_option("--minutes", arguments->minutes,
                  "Time for the whole chain; training gets what the steps before leave")
      ->check(CLI::Range(1.0, 100000.0))
      ->capture_default_str();
  app->add_option("--scan", arguments->scan,
                  "A scan of the person, from which the character is made (default: from the videos)");
  app->add_option("--stop-after", arguments->stop_after, "The last step to run")->check(CLI::IsMember(kSteps));
  app->add_flag("--keep-going", arguments->keep_going, "Go on when `doppel doctor` finds a fault");
  app->footer(kMakeExample);
  return {app, [arguments](const CommonOptions& common) { return run_make(*arguments, common); }};
}

}  // namespace doppel::tools
