#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/core/progress.h"

namespace doppel::tools {

/// A step that `doppel make` expects to run, for the time that the whole chain takes.
struct PlannedStep {
  std::string name;
  double seconds = 0.0;  ///< a guess, which the time of the steps before corrects
  /// Of a step that fills the time up to here, seconds from the beginning of the chain; it takes at least `seconds`,
  /// which nothing corrects then. 0: it does not.
  double end = 0.0;
};

/// The position of a step in the chain, and the time that it and the later ones are expected to take.
/// @param step index into the plan @param spent seconds of the steps before, by name
ProgressChain expected_time(const std::vector<PlannedStep>& plan, std::size_t step,
                            const std::map<std::string, double>& spent);

/// A step ended with an error that it has printed, or on the user's request.
struct StepFailed {
  int exit_code = 1;
};

/// Runs commands of `doppel` one after the other in this process. `OUT/make.json` keeps what was run: a chain that is
/// started again skips the steps that ended before with the same command, up to the first that did not.
class MakeChain {
 public:
  /// Reads an earlier `make.json`.
  /// @param inputs what the whole chain reads; it must be the same as before
  /// @throws UsageError when `out` was made from other inputs; FileError for a damaged file
  MakeChain(std::filesystem::path out, const CommonOptions& common, std::vector<std::string> inputs,
            std::vector<PlannedStep> plan);

  /// Runs one command, or takes its results of an earlier start.
  /// @param name of a planned step @param words of the command line, without the program's name
  /// @param failing exit code that is a result too: 1 of `doctor` @return what the command printed with --json
  /// @throws StepFailed
  nlohmann::ordered_json run(const std::string& name, const std::vector<std::string>& words, int failing = 0);
  /// Says that a planned step has nothing to do. @param reason a sentence
  void skip(const std::string& name, const std::string& reason);

  /// Seconds that the steps have taken so far, with those of earlier starts.
  double seconds() const;
  /// The commands that were run: `name`, `command`, `seconds`, in their order.
  const nlohmann::ordered_json& steps() const { return steps_; }

 private:
  std::filesystem::path results_file(const std::string& name) const;
  void show_position(const std::string& name);
  void write() const;

  std::filesystem::path out_;
  const CommonOptions& common_;
  std::vector<std::string> inputs_;
  std::vector<PlannedStep> plan_;
  nlohmann::ordered_json steps_ = nlohmann::ordered_json::array();
  std::size_t next_ = 0;  ///< steps of make.json that this start has reached
};

/// The command line as a user types it. @param words without the program's name
std::string command_line(const std::vector<std::string>& words);

}  // namespace doppel::tools
