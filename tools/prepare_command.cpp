#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "command.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/prepare/prepare.h"
#include "shared_work.h"

namespace doppel::tools {

namespace {

constexpr char kPrepareExample[] =
    "Example:\n"
    "  doppel prepare recordings/anna --out prepared/anna\n"
    "CAPTURE is a folder with a capture.yaml (docs/capture.md), or one in a layout that is known (same page).";

struct PrepareArguments {
  std::string capture;
  PrepareOptions options;
};

void add_options(CLI::App& app, PrepareArguments& arguments) {
  PrepareOptions& options = arguments.options;
  app.add_option("capture", arguments.capture, "Capture folder, or its capture.yaml")->required();
  app.add_option("--out", options.out, "Folder to prepare into (default: CAPTURE/prepared)");
  app.add_option("--mask-size", options.mask_size, "Side of the cropped masks, pixels")->capture_default_str();
  app.add_option("--image-size", options.image_size, "Side of the cropped images, pixels")->capture_default_str();
  app.add_option("--margin", options.margin, "Margin around the person, relative to the longer side")
      ->capture_default_str();
  app.add_option("--jpeg-quality", options.jpeg_quality, "JPEG quality of the cropped images (0: lossless PNG)")
      ->capture_default_str();
  app.add_option("--limit-frames", options.limit_frames, "Largest number of frames of each sequence (0: all)")
      ->capture_default_str();
  app.add_flag("--overwrite", options.overwrite, "Replace an earlier prepared capture in this folder");
  app.add_flag("--force", options.force, "Warn instead of stopping when a check of units, cameras or masks fails");
}

std::filesystem::path default_out(const std::filesystem::path& capture) {
  return (std::filesystem::is_directory(capture) ? capture : capture.parent_path()) / "prepared";
}

int run(const PrepareArguments& arguments, const CommonOptions& common) {
  PrepareOptions options = arguments.options;
  if (options.out.empty() && !common.shard) options.out = default_out(arguments.capture);
  options.threads = resolve_threads(common.threads);
  options.shard = common.shard;
  options.shards = common.merged.folders;
  const Capture capture = find_capture(arguments.capture);
  begin_work(common, options.out, [&] { return capture_inputs(capture); });
  const PrepareReport report = prepare_capture(capture, options);
  if (!report.finished) {
    log::warn("stopped after {} records; run the same command again to resume", report.records);
    return 1;
  }
  finish_work(common, options.out, nullptr);
  if (!common.merged.empty()) return 0;
  std::printf("%s", common.json ? (report.json() + "\n").c_str() : report.table().c_str());
  log::info("{} records in {}", report.records, options.out.string());
  return 0;
}

}  // namespace

Command add_prepare(CLI::App& program) {
  CLI::App* app = program.add_subcommand(
      "prepare", "Convert a capture to a prepared capture: cropped masks and images in one store");
  app->footer(kPrepareExample);
  auto arguments = std::make_shared<PrepareArguments>();
  add_options(*app, *arguments);
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }, true};
}

}  // namespace doppel::tools
