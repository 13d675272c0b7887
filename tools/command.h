#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "shard_folder.h"

namespace doppel::tools {

/// Options of all subcommands.
struct CommonOptions {
  int threads = 0;  ///< 0: as `resolve_threads`
  bool json = false;
  std::string log_level = "info";
  std::vector<std::string> words;  ///< the command line without the program's name
  std::optional<Shard> shard;      ///< the part of the work to do; nothing: all of it
  ShardSet merged;                 ///< the shards to join instead of doing the work; empty: none
};

/// One subcommand. Adding it binds its options to `app`; `run` does the work and returns the exit code. Errors are
/// thrown; main prints them and exits with 2 for a UsageError, with 1 for any other error.
struct Command {
  CLI::App* app;
  std::function<int(const CommonOptions&)> run;
  bool in_shards = false;              ///< whether --shard belongs to it (shared_work.h)
  std::vector<Command> subcommands{};  ///< with the common options of their own; without one of them, `run` runs
};

Command add_make(CLI::App& program);
Command add_synth(CLI::App& program);
Command add_calibrate(CLI::App& program);
Command add_capture(CLI::App& program);
Command add_character(CLI::App& program);
Command add_prepare(CLI::App& program);
Command add_detect(CLI::App& program);
Command add_doctor(CLI::App& program);
Command add_track(CLI::App& program);
Command add_train(CLI::App& program);
Command add_adapt(CLI::App& program);
Command add_evaluate(CLI::App& program);
Command add_merge(CLI::App& program);
Command add_compare(CLI::App& program);
Command add_animate(CLI::App& program);
Command add_export(CLI::App& program);
Command add_view(CLI::App& program);
Command add_info(CLI::App& program);

}  // namespace doppel::tools
