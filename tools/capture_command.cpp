#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"

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
    fmt::print("{}\n", report.dump(2));
    return;
  }
  for (const std::string& sentence : guess.found) fmt::print("{}\n", sentence);
  for (const std::string& sentence : guess.missing) fmt::print("missing: {}\n", sentence);
  if (!written.empty()) fmt::print("written: {}\n", written.string());
}

int init(const InitArguments& arguments, const CommonOptions& common) {
  const fs::path folder = arguments.folder;
  if (!fs::is_directory(folder)) fail("{} is not a folder", folder.string());
  const fs::path out = arguments.out.empty() ? folder / "capture.yaml" : arguments.out;
  if (fs::exists(out) && !arguments.force)
    fail<UsageError>("{} exists; --force replaces it, --out FILE writes another file", out.string());
  const CaptureGuess guess = guess_folder(folder);
  if (!guess.complete) {
    print_guess(guess, {}, 0, common.json);
    fail("{}: no capture.yaml was written, because the calibration or the footage is missing (see above)",
         folder.string());
  }
  write_capture(out, guess.capture, comments_of(guess));
  print_guess(guess, out, choose_cameras(read_capture(out)).cameras.size(), common.json);
  return 0;
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
  return {app, [arguments](const CommonOptions& common) { return init(*arguments, common); }};
}

}  // namespace doppel::tools
