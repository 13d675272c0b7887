#include "program.h"

#include <ATen/Parallel.h>

#include <cstdio>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "command.h"
#include "doppel/core/error.h"
#include "doppel/core/isa_choice.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"

namespace doppel::tools {
namespace {

std::vector<Command> add_commands(CLI::App& program, CommonOptions& common) {
  std::vector<Command> commands{
      add_synth(program),   add_calibrate(program), add_capture(program),  add_character(program),
      add_prepare(program), add_detect(program),    add_doctor(program),   add_track(program),
      add_train(program),   add_adapt(program),     add_evaluate(program), add_compare(program),
      add_animate(program), add_export(program),    add_view(program),     add_info(program)};
  for (Command& command : commands) {
    command.app->add_option("--threads", common.threads, "Threads to use (0: OMP_NUM_THREADS, or the granted cores)")
        ->capture_default_str();
    command.app->add_flag("--json", common.json, "Print results to stdout as one JSON object");
    command.app->add_option("--log-level", common.log_level, "trace, debug, info, warn, error or off")
        ->capture_default_str();
  }
  return commands;
}

int run(const Command& command, const CommonOptions& common) {
  setup_logging(common.log_level);
  check_isa();
  const int threads = resolve_threads(common.threads);
  at::set_num_threads(threads);
  cv::setNumThreads(threads);
  return command.run(common);
}

}  // namespace

int run_program(int argc, const char* const* argv) {
  CLI::App program{"Doppel turns calibrated multi-view video of a person into a digital double", "doppel"};
  program.set_version_flag("--version", DOPPEL_VERSION);
  program.require_subcommand(1);
  CommonOptions common;
  const std::vector<Command> commands = add_commands(program, common);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return program.exit(e) == 0 ? 0 : 2;
  }
  try {
    for (const Command& command : commands)
      if (command.app->parsed()) return run(command, common);
  } catch (const UsageError& e) {
    std::fprintf(stderr, "doppel: %s\n", e.what());
    return 2;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "doppel: %s\n", e.what());
    return 1;
  }
  return 0;
}

}  // namespace doppel::tools
