// `doppel` on a disk that fails: each write, rename, fsync, opening and read in turn. What was published before stays
// whole, nothing temporary is left, the program says so and ends with 1, and the same command succeeds afterwards.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "support/temporary_folder.h"

namespace doppel::faults_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;

struct Fault {
  std::string kind;
  long call = 0;  ///< 0: none, the calls are counted
  bool lasts = false;
};

struct Outcome {
  int code = -1;
  std::string messages;
};

std::string quoted(const fs::path& path) { return "'" + path.string() + "'"; }

/// Runs `doppel ARGUMENTS`. @param fault among the files below `folder`
Outcome run(const std::string& arguments, const fs::path& folder, const Fault& fault, const fs::path& scratch) {
  const fs::path messages = scratch / "messages.txt";
  std::string command = "OMP_NUM_THREADS=1 ";
  if (!fault.kind.empty())
    command += "LD_PRELOAD=" DOPPEL_FAULTS " DOPPEL_FAULT_FOLDER=" + quoted(folder) + " DOPPEL_FAULT_KIND=" +
               fault.kind + " DOPPEL_FAULT_CALL=" + std::to_string(fault.call) +
               (fault.lasts ? " DOPPEL_FAULT_LASTS=1" : "") + " DOPPEL_FAULT_COUNT=" + quoted(scratch / "count") + " ";
  command += std::string(DOPPEL_PROGRAM) + " " + arguments + " >/dev/null 2>" + quoted(messages);
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), read_file(messages)};
}

/// Paths below a folder that a run leaves only when it is killed.
std::vector<std::string> temporaries(const fs::path& folder) {
  static const std::regex pattern("\\..+\\.[0-9]+-[0-9]+(\\..*)?|.*\\.part(\\..*)?|\\..*partial|\\.doppel-lock");
  std::vector<std::string> found;
  if (!fs::exists(folder)) return found;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (std::regex_match(entry.path().filename().string(), pattern)) found.push_back(entry.path().string());
  return found;
}

std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[entry.path().string()] = read_file(entry.path());
  return files;
}

/// A tiny capture, prepared, and a run of a few steps, made once.
struct Made {
  TemporaryFolder folder;
  fs::path capture = folder / "capture", prepared = folder / "prepared", run_folder = folder / "run";

  Made() {
    const fs::path scratch = folder / "scratch";
    fs::create_directories(scratch);
    for (const std::string& command :
         {"synth --preset tiny --out " + quoted(capture), "prepare " + quoted(capture) + " --out " + quoted(prepared),
          train_command(run_folder)}) {
      const Outcome outcome = run(command, folder.path(), {}, scratch);
      EXPECT_EQ(outcome.code, 0) << command << "\n" << outcome.messages;
    }
  }
  std::string train_command(const fs::path& out) const {
    return "train " DOPPEL_SOURCE_DIR "/configs/tiny/egnet.yaml --set capture=" + quoted(prepared) +
           " --set train.iterations=4 --set train.log_every=1 --set train.checkpoint_every=2 --out " + quoted(out);
  }
};

const Made& made() {
  static const Made the_made;
  return the_made;
}

/// The points to try: all of them, or the first, the last and some between.
std::set<long> chosen_points(long calls) {
  std::set<long> points;
  const bool all = std::getenv("DOPPEL_FAULT_POINTS") != nullptr;
  if (all)
    for (long call = 1; call <= calls; ++call) points.insert(call);
  else
    for (const long call : {1L, (calls + 1) / 2, calls})
      if (call > 0) points.insert(call);
  return points;
}

struct Tally {
  int points = 0, refused = 0, survived = 0, silent = 0;
};

/// Lets one call fail and examines what is left.
/// @param wanted the files of a run without a fault, by their path below the output
void try_point(const std::string& arguments, const fs::path& out, const Fault& fault,
               const std::set<std::string>& wanted, Tally& tally) {
  SCOPED_TRACE(fault.kind + " " + std::to_string(fault.call) + (fault.lasts ? " and all later ones" : ""));
  const TemporaryFolder scratch;
  fs::remove_all(out);
  const auto before = contents(made().prepared);
  const Outcome broken = run(arguments, out, fault, scratch.path());
  ++tally.points;
  EXPECT_TRUE(broken.code == 0 || broken.code == 1) << broken.code << ": " << broken.messages;
  if (broken.code == 1) {
    ++tally.refused;
    EXPECT_NE(broken.messages.find("error"), std::string::npos) << "no message: " << broken.messages;
  } else {
    ++tally.survived;  // the program tried again, or the call was not needed: then the result is whole
    for (const std::string& file : wanted)
      if (!fs::exists(out / file)) {
        ++tally.silent;
        ADD_FAILURE() << file << " is missing, and the exit code is 0";
      }
  }
  EXPECT_TRUE(temporaries(out).empty()) << temporaries(out).front();
  EXPECT_TRUE(before == contents(made().prepared)) << "a file that was read has changed";
  const Outcome again = run(arguments, out, {}, scratch.path());
  EXPECT_EQ(again.code, 0) << "the same command afterwards: " << again.messages;
  for (const std::string& file : wanted) EXPECT_TRUE(fs::exists(out / file)) << file << " is missing afterwards";
}

/// Tries the points of failure of a command. @param out what the command writes
void try_command(const std::string& name, const std::string& arguments, const fs::path& out) {
  const TemporaryFolder scratch;
  Tally tally;
  std::set<std::string> wanted;
  for (const char* kind : {"write", "rename", "fsync", "open", "read"}) {
    fs::remove_all(out);
    const Outcome whole = run(arguments, out, {kind, 0, false}, scratch.path());
    ASSERT_EQ(whole.code, 0) << whole.messages;
    if (wanted.empty())
      for (const auto& entry : fs::recursive_directory_iterator(out))
        if (entry.is_regular_file() && entry.path().filename().string().rfind("events.", 0) != 0)
          wanted.insert(entry.path().lexically_relative(out).string());
    const long calls = std::stol(read_file(scratch / "count"));
    for (const long call : chosen_points(calls)) {
      const bool lasts = std::string(kind) == "write" && call % 2 == 1;  // a full disk stays full
      try_point(arguments, out, {kind, call, lasts}, wanted, tally);
    }
  }
  std::printf("%s: %d points of failure, %d refused, %d survived, %d silent losses\n", name.c_str(), tally.points,
              tally.refused, tally.survived, tally.silent);
  EXPECT_GE(tally.points, 5) << "the library that lets calls fail does not work";
  EXPECT_GE(tally.refused, 3);
}

TEST(FaultsRecover, Prepare) {
  const TemporaryFolder folder;
  try_command("prepare",
              "prepare " + quoted(made().capture) + " --limit-frames 2 --out " + quoted(folder / "prepared"),
              folder / "prepared");
}

TEST(FaultsRecover, Train) {
  const TemporaryFolder folder;
  try_command("train", made().train_command(folder / "run"), folder / "run");
}

TEST(FaultsRecover, Track) {
  const TemporaryFolder folder;
  try_command("track",
              "track " + quoted(made().capture) + " --limit-frames 2 --vertices --sheet-frames 1 --sequences testing " +
                  "--out " + quoted(folder / "tracked"),
              folder / "tracked");
}

TEST(FaultsRecover, Export) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "out");
  try_command("export", "export --run " + quoted(made().run_folder) + " --out " + quoted(folder / "out/actor.pt"),
              folder / "out");
}

}  // namespace
}  // namespace doppel::faults_test
