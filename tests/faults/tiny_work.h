#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "support/temporary_folder.h"

namespace doppel::faults {

/// A command to interrupt. `OUT` in its words is the folder that it writes.
struct Recipe {
  std::string name;
  std::vector<std::string> words;
  std::string before;  ///< a folder of `TinyWork` that OUT is a copy of before the command; empty: OUT is missing

  bool into_empty = false;  ///< the command refuses a folder with files, and its message says to remove it

  std::vector<std::string> with_out(const std::filesystem::path& out) const;
};

/// Whether DOPPEL_FAULT_RECIPES names the recipe: `all`, or names separated by commas.
/// @param otherwise the names where the variable is not set
bool is_wanted(const Recipe& recipe, const std::string& otherwise);

/// A tiny synthetic capture and what the commands make of it, in one folder.
class TinyWork {
 public:
  TinyWork();

  const std::filesystem::path& folder() const { return folder_.path(); }
  std::filesystem::path at(const std::string& name) const { return folder_ / name; }

  std::vector<std::string> synth(const std::string& out, int frames = 4) const;
  std::vector<std::string> prepare(const std::string& out) const;
  /// @param steps of EGNet; a checkpoint after each `every`
  std::vector<std::string> train(const std::string& out, int steps, int every) const;
  std::vector<std::string> track(const std::string& out) const;

  /// Every command that the fault sweep breaks.
  std::vector<Recipe> recipes() const;
  /// The same, a training of more steps and `make` until the training, which take too long for the sweep.
  std::vector<Recipe> recipes_to_kill() const;
  /// Makes `out` what it is before the command.
  void restore(const Recipe& recipe, const std::filesystem::path& out) const;

 private:
  void make(const std::vector<std::string>& words) const;
  void make_detector() const;
  /// Videos, keypoints, calibration and character, as `doppel make` takes them.
  void make_footage() const;
  /// A run as one killed after its second checkpoint left it.
  void make_broken_run() const;

  support::TemporaryFolder folder_;
};

}  // namespace doppel::faults
