#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/hold_out.h"
#include "info_files.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr char kInitExample[] =
    "Example:\n"
    "  doppel capture init recordings/anna\n"
    "FOLDER holds one video (or folder of images) for each camera and a calibration of any known format\n"
    "(docs/calibration.md), and perhaps keypoints, masks, videos of the empty scene, a character and motions.\n"
    "Nothing is asked: the guesses are printed, and written as comments into the file. Correct them there.";

struct InitArguments {
  std::string folder;
  fs::path out;
  bool force = false;
};

std::vector<std::string> comments_of(const CaptureGuess& guess) {
  std::vector<std::string> comments{"Written by `doppel capture init`. docs/capture.md explains the keys."};
  comments.insert(comments.end(), guess.found.begin(), guess.found.end());
  for (const std::string& sentence : guess.missing) comments.push_back("missing: " + sentence);
  return comments;
}

void print_guess(const CaptureGuess& guess, const fs::path& written, std::size_t num_cameras, bool json) {
  if (json) {
    nlohmann::ordered_json report{
        {"written", written.string()}, {"found", guess.found}, {"missing", guess.missing}, {"cameras", num_cameras}};
    report["sequences"] = nlohmann::ordered_json::array();
    for (const SequenceEntry& sequence : guess.capture.sequences) report["sequences"].push_back(sequence.name);
    fmt::print("{}\n", report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));  // names of files
    return;
  }
  for (const std::string& sentence : guess.found) fmt::print("{}\n", sentence);
  for (const std::string& sentence : guess.missing) fmt::print("missing: {}\n", sentence);
  if (!written.empty()) fmt::print("written: {}\n", written.string());
}

bool holds_footage(const fs::path& folder) {
  const fs::recursive_directory_iterator files(folder, fs::directory_options::skip_permission_denied);
  return std::any_of(begin(files), end(files), [](const fs::directory_entry& file) { return is_footage(file.path()); });
}

int init(const InitArguments& arguments, const CommonOptions& common) {
  const fs::path folder = arguments.folder;
  if (!fs::is_directory(folder)) fail("{} is not a folder", folder.string());
  const fs::path out = arguments.out.empty() ? folder / "capture.yaml" : arguments.out;
  if (fs::exists(out) && !arguments.force)
    fail<UsageError>("{} exists; --force replaces it, --out FILE writes another file", out.string());
  CaptureGuess guess = guess_folder(folder);
  if (!guess.complete) {
    // Without a calibration the footage has not been looked at.
    if (guess.capture.calibration.empty() && !holds_footage(folder))
      guess.missing.emplace_back(
          "no videos and no images; put a video, or a folder of images, of each camera into the folder");
    print_guess(guess, {}, 0, common.json);
    fail("{}: no capture.yaml was written, because the calibration or the footage is missing (see above)",
         folder.string());
  }
  write_capture(out, guess.capture, comments_of(guess));
  print_guess(guess, out, choose_cameras(read_capture(out)).cameras.size(), common.json);
  return 0;
}

constexpr char kAmendExample[] =
    "Examples:\n"
    "  doppel capture amend recordings/anna --calibration refined.yml --out refined.yaml\n"
    "  doppel capture amend recordings/anna --hold-out --out split.yaml";

struct AmendArguments {
  std::string capture, calibration, character, landmarks;
  std::vector<std::string> cameras;
  fs::path out;
  bool hold_out = false;
  HoldOutOptions shares;
};

/// The absolute path of a file that must exist.
std::string existing(const std::string& option, const std::string& file) {
  if (!fs::exists(file)) fail<UsageError>("{}: {} does not exist", option, file);
  return fs::absolute(file).lexically_normal().string();
}

std::string names_of(const std::vector<Camera>& cameras) {
  std::string names;
  for (const Camera& camera : cameras) names += (names.empty() ? "" : ", ") + camera.name;
  return names;
}

/// Uses the named cameras alone, or all of the calibration. @throws UsageError for an unknown name
void choose(const std::vector<std::string>& cameras, Capture& capture) {
  capture.cameras.clear();
  if (cameras == std::vector<std::string>{"all"}) return;
  capture.cameras = cameras;
  static_cast<void>(choose_cameras(capture));
}

/// Whether two calibrations give each camera that both have the same index, by which paths name it.
bool have_same_indices(const std::vector<Camera>& before, const std::vector<Camera>& after) {
  for (std::size_t i = 0; i < after.size(); ++i)
    for (std::size_t k = 0; k < before.size(); ++k)
      if (after[i].name == before[k].name && i != k) return false;
  return true;
}

/// Paths with `{camera}` become a path for each camera, by its index in the calibration before.
void keep_footage(CameraPaths& paths, const std::vector<Camera>& before, const std::vector<Camera>& after) {
  if (paths.empty() || !paths.by_camera().empty() || paths.sample().find("{camera") == std::string::npos) return;
  std::map<std::string, std::string> by_camera;
  for (std::size_t k = 0; k < before.size(); ++k)
    if (std::any_of(after.begin(), after.end(), [&](const Camera& camera) { return camera.name == before[k].name; }))
      by_camera[before[k].name] = expand_camera(paths.sample(), static_cast<int>(k), before[k].name);
  paths = CameraPaths(std::move(by_camera));
}

/// @param key that can have one path alone
void refuse_numbers(const std::string& key, const std::string& path, const std::string& calibration) {
  if (path.find("{camera") != std::string::npos)
    fail<UsageError>(
        "--calibration: {} has the cameras in another order, and `{}` names them by their numbers; name the files "
        "after the cameras, and use {{name}}",
        calibration, key);
}

/// Names another calibration. The cameras keep their footage, whatever their order in the file.
void change_calibration(const std::string& file, Capture& capture) {
  const std::vector<Camera> before = calibrated_cameras(capture);
  capture.calibration = existing("--calibration", file);
  capture.calibration_options = {};  // unit and axis of the file before
  const std::vector<Camera> after = calibrated_cameras(capture);
  const auto is_known = [&](const Camera& camera) {
    return std::any_of(before.begin(), before.end(), [&](const Camera& old) { return old.name == camera.name; });
  };
  if (std::none_of(after.begin(), after.end(), is_known))
    fail<UsageError>("--calibration: {} has none of the cameras of {}: it has {}, and the capture {}", file,
                     capture.name, names_of(after), names_of(before));
  if (have_same_indices(before, after)) return;
  for (SequenceEntry& sequence : capture.sequences) {
    for (CameraPaths* paths : {&sequence.videos, &sequence.masks, &sequence.keypoints})
      keep_footage(*paths, before, after);
    if (sequence.subtraction) keep_footage(sequence.subtraction->empty, before, after);
    refuse_numbers("joints3d", sequence.joints3d, file);
  }
  refuse_numbers("background", capture.background, file);
}

int amend(const AmendArguments& arguments, const CommonOptions& common) {
  Capture capture = find_capture(arguments.capture);
  if (fs::exists(arguments.out) && fs::weakly_canonical(arguments.out) == fs::weakly_canonical(capture.file))
    fail<UsageError>("--out: {} is the capture that is read; choose another file", arguments.out.string());
  if (!arguments.calibration.empty()) change_calibration(arguments.calibration, capture);
  if (!arguments.character.empty()) capture.character = existing("--character", arguments.character);
  if (!arguments.landmarks.empty()) capture.landmarks = existing("--landmarks", arguments.landmarks);
  if (!arguments.cameras.empty()) choose(arguments.cameras, capture);
  if (arguments.hold_out) capture = hold_out(capture, filmed_cameras(capture), arguments.shares);
  write_capture(arguments.out, capture, {"Written by `doppel capture amend` from " + arguments.capture + "."});
  nlohmann::ordered_json report{{"written", arguments.out.string()}, {"sequences", nlohmann::ordered_json::array()}};
  for (const SequenceEntry& sequence : capture.sequences) {
    report["sequences"].push_back({{"name", sequence.name},
                                   {"split", to_string(sequence.split)},
                                   {"first_frame", sequence.first_frame},
                                   {"last_frame", sequence.last_frame ? nlohmann::ordered_json(*sequence.last_frame)
                                                                      : nlohmann::ordered_json(nullptr)}});
    if (!common.json)
      fmt::print("{:<32} {:<10} rows {} to {}\n", sequence.name, to_string(sequence.split), sequence.first_frame,
                 sequence.last_frame ? std::to_string(*sequence.last_frame) : "the end");
  }
  if (common.json) fmt::print("{}\n", report.dump(2));
  return 0;
}

void add_amend(CLI::App& capture, const std::shared_ptr<AmendArguments>& arguments) {
  CLI::App* app =
      capture.add_subcommand("amend", "Write the description of a capture anew, with other files or splits");
  app->fallthrough();
  app->add_option("capture", arguments->capture, "Capture folder or capture.yaml")->required();
  app->add_option("--out", arguments->out, "capture.yaml to write")->required();
  app->add_option("--calibration", arguments->calibration, "Calibration to use instead of the capture's");
  app->add_option("--character", arguments->character, "The .character file to use");
  app->add_option("--landmarks", arguments->landmarks, "Placement file of the landmarks to use");
  app->add_option("--cameras", arguments->cameras, "Names of the cameras to use; `all` of the calibration")
      ->delimiter(',');
  CLI::Option* hold_out = app->add_flag(
      "--hold-out", arguments->hold_out,
      "Keep back the end of each training sequence for validation and tests, where the capture has no such sequences");
  app->add_option("--validation-share", arguments->shares.validation, "Share of a sequence's rows for validation")
      ->needs(hold_out)
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app->add_option("--test-share", arguments->shares.test, "Share of a sequence's rows for tests")
      ->needs(hold_out)
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app->footer(kAmendExample);
}

}  // namespace

Command add_capture(CLI::App& program) {
  CLI::App* app = program.add_subcommand("capture", "Describe a folder of footage as a capture");
  app->require_subcommand(1);
  auto arguments = std::make_shared<InitArguments>();
  CLI::App* init_app = app->add_subcommand("init", "Look at a folder and write its capture.yaml");
  init_app->fallthrough();
  init_app->add_option("folder", arguments->folder, "Folder with the footage")->required();
  init_app->add_option("--out", arguments->out, "File to write (default: FOLDER/capture.yaml)");
  init_app->add_flag("--force", arguments->force, "Replace the file if it exists");
  init_app->footer(kInitExample);
  app->footer("Example: doppel capture init recordings/anna");
  auto amended = std::make_shared<AmendArguments>();
  add_amend(*app, amended);
  return {app, [arguments, amended, init_app](const CommonOptions& common) {
            return init_app->parsed() ? init(*arguments, common) : amend(*amended, common);
          }};
}

}  // namespace doppel::tools
