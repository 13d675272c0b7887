#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "command.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/doctor/doctor.h"

namespace doppel::tools {

namespace {

constexpr char kDoctorExample[] =
    "Example:\n"
    "  doppel doctor recordings/anna --out anna.html\n"
    "Neither masks nor a motion nor a character are needed. docs/doctor.md explains the faults.\n"
    "Exit code: 0 healthy or suspicious, 1 faulty, 2 wrong use.";

struct DoctorArguments {
  std::string capture;
  std::string out = "doctor.html";
  DoctorOptions options;
  bool no_footage = false;
};

void print_examination(const Examination& examination) {
  for (const Finding& finding : examination.findings)
    fmt::print("{}: {}{}: {}\n    {}\n", to_string(finding.severity),
               finding.camera.empty() ? "" : "camera " + finding.camera + ": ", finding.fault, finding.figure,
               finding.advice);
  fmt::print("{}: {}\n", examination.capture, to_string(examination.verdict()));
}

int examine(const DoctorArguments& arguments, const CommonOptions& common) {
  DoctorOptions options = arguments.options;
  options.footage = !arguments.no_footage;
  const Examination examination = examine_capture(find_capture(arguments.capture), options);
  write_atomically(arguments.out, doctor_page(examination));
  if (common.json) {
    nlohmann::ordered_json report = to_json(examination);
    report["report"] = arguments.out;
    fmt::print("{}\n", report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    print_examination(examination);
    fmt::print("report: {}\n", arguments.out);
  }
  return examination.verdict() == Verdict::faulty ? 1 : 0;
}

}  // namespace

Command add_doctor(CLI::App& program) {
  CLI::App* app = program.add_subcommand("doctor", "Examine a capture: which camera has which fault");
  auto arguments = std::make_shared<DoctorArguments>();
  app->add_option("capture", arguments->capture, "Capture folder or capture.yaml")->required();
  app->add_option("--out", arguments->out, "HTML page to write")->capture_default_str();
  app->add_option("--frames", arguments->options.rows, "Frames to examine, over all sequences")
      ->capture_default_str()
      ->check(CLI::Range(20L, 100000L));
  app->add_flag("--no-footage", arguments->no_footage,
                "Examine calibration and keypoints only; read no images and masks");
  app->footer(kDoctorExample);
  return {app, [arguments](const CommonOptions& common) { return examine(*arguments, common); }};
}

}  // namespace doppel::tools
