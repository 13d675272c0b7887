// Runs readers on damaged files, the same ones in every run.
//
//   fuzz_driver [--runs N | --seconds S] [--seed N] [TARGET...]   seeds, regressions and N damaged files of each target
//   fuzz_driver --write FOLDER TARGET                             seeds and dictionary, for libFuzzer
//   fuzz_driver --list                                            names of the targets
//   fuzz_driver --replay FILE TARGET                              one input, in this process
//
// A target runs in a process of its own. A crash, a report of a sanitizer, a broken promise, more than 10 s of CPU for
// one input or more than kMaxMegabytes is a finding: the input is kept as `finding-TARGET-N` in the current folder,
// and the exit code is 1.

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <optional>

#include "doppel/core/log.h"
#include "fuzz/fuzz_target.h"
#include "fuzz/mutator.h"
#include "support/temporary_folder.h"

extern "C" const char* __asan_default_options() {
  return "detect_leaks=0:quarantine_size_mb=16:max_allocation_size_mb=400:allocator_may_return_null=0";
}

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;

constexpr long kMaxMegabytes = 700;
constexpr unsigned kMaxSeconds = 10;         ///< of CPU, so that a busy machine makes no findings
constexpr unsigned kMaxSecondsWaited = 600;  ///< for a reader that waits
constexpr std::size_t kMaxInputBytes = 4 << 20;

struct Options {
  long runs = 150;
  double seconds = 0;  ///< instead of runs, unless 0
  std::uint64_t seed = 1;
  Path write, replay;
  bool list = false;
  std::vector<std::string> targets;
};

/// The input in work, which the parent process sees when its child has died.
struct SharedInput {
  std::size_t size = 0;
  char bytes[kMaxInputBytes];
};

SharedInput* shared_input() {
  void* memory = mmap(nullptr, sizeof(SharedInput), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no memory for the input");
  return new (memory) SharedInput;
}

void on_alarm(int) {
  constexpr char kMessage[] = "fuzz_driver: this input takes too long\n";
  [[maybe_unused]] const auto written = write(2, kMessage, sizeof kMessage - 1);
  abort();  // a sanitizer prints where
}

/// Calls on_alarm after that many seconds of CPU, or of waiting. 0: no longer
void watch_time(unsigned cpu_seconds, unsigned waited_seconds) {
  itimerval limit{};
  limit.it_value.tv_sec = cpu_seconds;
  setitimer(ITIMER_PROF, &limit, nullptr);
  alarm(waited_seconds);
}

long peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

/// Runs one input. @return whether it was accepted
bool run_watched(const FuzzTarget& target, const std::string& bytes, const Path& folder, SharedInput& shared) {
  shared.size = std::min(bytes.size(), kMaxInputBytes);
  std::memcpy(shared.bytes, bytes.data(), shared.size);
  watch_time(kMaxSeconds, kMaxSecondsWaited);
  const bool accepted = run_once(target, bytes, folder);
  watch_time(0, 0);
  promise(peak_megabytes() < kMaxMegabytes, "memory stays bounded");
  return accepted;
}

std::string wrapped_again(const FuzzTarget& target, const std::string& seed) {
  const std::optional<Unwrapped> file = target.unwrap(seed);
  promise(file.has_value(), "the seeds of " + target.name + " can be unwrapped");
  return file->wrap(file->parts);
}

/// All inputs of a target, in the child process.
void run_target(const FuzzTarget& target, const Options& options, const Path& folder, SharedInput& shared) {
  for (const std::string& seed : target.seeds) {
    promise(run_watched(target, seed, folder, shared), "the seeds of " + target.name + " are valid files");
    promise(!target.unwrap || run_watched(target, wrapped_again(target, seed), folder, shared),
            "the seeds of " + target.name + " are valid in a new wrapping");
  }
  for (const Regression& regression : regressions())
    if (regression.target == target.name) run_watched(target, regression.bytes, folder, shared);
  Mutator mutator(target, options.seed);
  const auto start = std::chrono::steady_clock::now();
  const auto elapsed = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  long runs = 0, accepted = 0;
  while (options.seconds > 0 ? elapsed() < options.seconds : runs < options.runs) {
    accepted += run_watched(target, mutator.next(), folder, shared);
    ++runs;
  }
  std::cout << target.name << ": " << runs << " damaged files, " << accepted << " accepted, " << elapsed() << " s, "
            << peak_megabytes() << " MB\n";
}

[[noreturn]] void run_child(const FuzzTarget& target, const Options& options, const Path& folder, SharedInput& shared) {
  std::signal(SIGALRM, on_alarm);
  std::signal(SIGPROF, on_alarm);
  try {
    run_target(target, options, folder, shared);
    std::cout.flush();
    _exit(0);
  } catch (const std::exception& e) {
    std::cerr << "fuzz_driver: " << target.name << ": " << e.what() << "\n";
    _exit(1);
  }
}

/// @return whether the target has no finding
bool survives(const FuzzTarget& target, const Options& options, SharedInput& shared) {
  const support::TemporaryFolder folder;
  const pid_t child = fork();
  if (child == 0) run_child(target, options, folder.path(), shared);
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return true;
  Path kept;
  for (int n = 1; kept.empty() || std::filesystem::exists(kept); ++n)
    kept = "finding-" + target.name + "-" + std::to_string(n);
  std::ofstream(kept, std::ios::binary).write(shared.bytes, static_cast<std::streamsize>(shared.size));
  std::cerr << "fuzz_driver: " << target.name << " is broken by " << shared.size << " bytes, kept in " << kept.string()
            << "\n";
  return false;
}

/// `"word"` with everything but plain characters as \xNN, one per line.
std::string dictionary_of(const FuzzTarget& target) {
  std::string text;
  for (const std::string& word : target.dictionary) {
    text += '"';
    for (const char c : word) {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\x%02X", static_cast<unsigned char>(c));
      text += std::isalnum(static_cast<unsigned char>(c)) ? std::string(1, c) : escaped;
    }
    text += "\"\n";
  }
  return text;
}

void write_for_libfuzzer(const Options& options) {
  const FuzzTarget& target = target_of(options.targets.at(0));
  std::filesystem::create_directories(options.write / "seeds");
  std::ofstream(options.write / "dictionary") << dictionary_of(target);
  for (std::size_t i = 0; i < target.seeds.size(); ++i)
    std::ofstream(options.write / "seeds" / std::to_string(i), std::ios::binary) << target.seeds[i];
}

int replay(const Options& options) {
  std::ifstream file(options.replay, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const support::TemporaryFolder folder;
  const bool accepted = run_once(target_of(options.targets.at(0)), bytes, folder.path());
  std::cout << (accepted ? "accepted\n" : "refused\n");
  return 0;
}

Options parse(const std::vector<std::string>& words) {
  Options options;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto value = [&] { return i + 1 < words.size() ? words[++i] : throw Broken(words[i] + " needs a value"); };
    if (words[i] == "--runs")
      options.runs = std::stol(value());
    else if (words[i] == "--seconds")
      options.seconds = std::stod(value());
    else if (words[i] == "--seed")
      options.seed = std::stoull(value());
    else if (words[i] == "--list")
      options.list = true;
    else if (words[i] == "--write")
      options.write = value();
    else if (words[i] == "--replay")
      options.replay = value();
    else
      options.targets.push_back(target_of(words[i]).name);
  }
  return options;
}

int run(const Options& options) {
  SharedInput& shared = *shared_input();
  bool sound = true;
  for (const FuzzTarget& target : all_targets()) {
    const auto& wanted = options.targets;
    if (wanted.empty() || std::find(wanted.begin(), wanted.end(), target.name) != wanted.end())
      sound = survives(target, options, shared) && sound;
  }
  return sound ? 0 : 1;
}

}  // namespace
}  // namespace doppel::fuzz

int main(int argc, char** argv) {
  using namespace doppel::fuzz;
  try {
    doppel::setup_logging("off");
    const Options options = parse({argv + 1, argv + argc});
    if (options.list)
      for (const FuzzTarget& target : all_targets()) std::cout << target.name << "\n";
    if (options.list) return 0;
    if (!options.write.empty()) return write_for_libfuzzer(options), 0;
    return options.replay.empty() ? run(options) : replay(options);
  } catch (const std::exception& e) {
    std::cerr << "fuzz_driver: " << e.what() << "\n";
    return 2;
  }
}
