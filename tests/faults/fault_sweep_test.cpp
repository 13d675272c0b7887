// Every command with one call failing: nothing is lost, and nobody is told otherwise.
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <numeric>

#include "doppel/core/error.h"
#include "faults/folder_state.h"
#include "faults/program_run.h"
#include "faults/tiny_work.h"

namespace doppel::faults {
namespace {

namespace fs = std::filesystem;

/// The largest number of calls that are failed for each command and kind: DOPPEL_FAULT_POINTS, or a few.
long points_per_kind(FaultKind kind) {
  const char* wanted = std::getenv("DOPPEL_FAULT_POINTS");
  const long points = wanted ? std::atol(wanted) : 1;
  return kind == FAULT_MEMORY ? std::min(points, 300L) : points;  // there are some hundred thousand
}

const char* word_of(FaultKind kind) {
  switch (kind) {
    case FAULT_MEMORY:
      return "memory";
    case FAULT_MAP:
      return "map";
    case FAULT_CREATE:
      return "create";
    case FAULT_OPEN:
      return "open";
    case FAULT_READ:
      return "read";
    case FAULT_WRITE:
      return "write";
    case FAULT_FULL:
      return "full disk";
    case FAULT_SHORT:
      return "short write";
    case FAULT_CLOSE:
      return "close";
    case FAULT_SYNC:
      return "sync";
    case FAULT_RESIZE:
      return "resize";
    case FAULT_RENAME:
      return "rename";
    case FAULT_KINDS:
      break;
  }
  return "";
}

/// Offline and live tracking keep the frames before an image that cannot be read.
bool tells_of_a_part(const std::string& err) {
  return err.find("only the frames") != std::string::npos ||
         err.find("the images before it are kept") != std::string::npos;
}

/// Of `count` calls, at most `points`, evenly spread and with the last.
std::vector<long> calls_to_fail(long count, long points) {
  std::vector<long> calls;
  points = std::min(points, count);
  for (long i = 1; i <= points; ++i) calls.push_back(count * i / points);
  return calls;
}

/// One command, broken at one call after the other.
class Sweep {
 public:
  Sweep(const TinyWork& work, Recipe recipe)
      : work_(work), recipe_(std::move(recipe)), out_(work.at("out")), fault_(work.folder()) {
    work_.restore(recipe_, out_);
    before_ = state_of(out_);
    fault_.set(FAULT_MEMORY, 0);
    const Ending ending = run(recipe_.with_out(out_), &fault_);
    if (!ending.succeeded()) fail("without a fault: {}", ending.err);
    for (int kind = 0; kind < FAULT_KINDS; ++kind) counts_.push_back(fault_.plan().counts[kind]);
    whole_ = state_of(out_);
    work_.restore(recipe_, out_);
    if (!run(recipe_.with_out(out_)).succeeded()) fail("the second run failed");
    if (const std::string found = difference(state_of(out_), whole_); !found.empty())
      fail("two unbroken runs differ: {}", found);
  }

  /// @return the findings
  std::vector<std::string> run_all() {
    std::vector<std::string> findings;
    for (int k = 0; k < FAULT_KINDS; ++k) {
      const auto kind = static_cast<FaultKind>(k);
      for (const long call : calls_to_fail(counts_[static_cast<std::size_t>(k)], points_per_kind(kind)))
        if (const std::string finding = finding_at(kind, call); !finding.empty())
          findings.push_back(fmt::format("{}, {} {} of {} ({} {}): {}", recipe_.name, word_of(kind), call,
                                         counts_[static_cast<std::size_t>(k)], fault_.plan().failed_call,
                                         fault_.plan().failed_path, finding));
    }
    return findings;
  }
  long points() const { return points_; }
  /// Of all kinds but allocations of memory.
  long calls() const { return std::accumulate(counts_.begin(), counts_.end(), 0L) - counts_[FAULT_MEMORY]; }

 private:
  std::string finding_at(FaultKind kind, long call) {
    work_.restore(recipe_, out_);
    fault_.set(kind, call);
    const Ending ending = run(recipe_.with_out(out_), &fault_);
    if (fault_.plan().failed == 0) return "";  // another run makes fewer calls of this kind, say of memory
    ++points_;
    const std::string finding = judge(ending, kind);
    return finding.empty() ? after_another_run(ending) : finding;
  }

  std::string judge(const Ending& ending, FaultKind kind) const {
    if (ending.hung) return "it hangs";
    if (ending.signal != 0) return fmt::format("it ended by signal {}: {}", ending.signal, ending.err);
    if (ending.code != 0 && ending.code != 1) return fmt::format("exit code {}: {}", ending.code, ending.err);
    if (ending.code == 1 && ending.err.find("doppel: ") == std::string::npos && !tells_of_a_part(ending.err))
      return "there is no message: " + ending.err;
    if (ending.code == 1 && kind != FAULT_MEMORY && !names_the_file(ending.err))
      return "the message names no file: " + ending.err;
    const Files found = state_of(out_);
    for (const auto& [name, content] : found)
      if (is_leftover(name)) return name + " is left: " + ending.err;
    for (const auto& entry : fs::directory_iterator(work_.folder()))
      if (is_leftover(entry.path().filename().string()) && (ending.succeeded() || entry.path() != unfinished()))
        return entry.path().filename().string() + " is left";
    if (ending.succeeded()) {
      const std::string lost = difference(found, whole_);
      return lost.empty() ? "" : fmt::format("a silent loss: {}: {}", lost, ending.err);
    }
    return damage(found, ending);
  }

  bool names_the_file(const std::string& err) const {
    const fs::path path(fault_.plan().failed_path);
    return err.find(path.filename().string()) != std::string::npos ||
           err.find(path.parent_path().string()) != std::string::npos;
  }

  /// After a failure: files are those from before, whole new ones, or say that they are a part.
  std::string damage(const Files& found, const Ending& ending) const {
    for (const auto& [name, content] : before_)
      if (!found.contains(name)) return fmt::format("{} is gone: {}", name, ending.err);
    if (tells_of_a_part(ending.err)) return "";
    for (const auto& [name, content] : found) {
      const auto old = before_.find(name), whole = whole_.find(name);
      if (old != before_.end() && old->second == content) continue;
      if (whole == whole_.end()) return fmt::format("{} is new and belongs to nothing: {}", name, ending.err);
      if (whole->second != content && !is_part_of(name, content, whole->second))
        return fmt::format("{} is damaged: {}", name, ending.err);
    }
    return "";
  }

  /// Where `synth` leaves what the next run goes on with.
  fs::path unfinished() const { return work_.at(".out.making"); }

  std::string after_another_run(const Ending& first) {
    if (first.succeeded()) return "";
    if (state_of(out_) == before_ && !fs::exists(unfinished())) return "";  // another run is the undisturbed one
    if (recipe_.into_empty) fs::remove_all(out_);
    const Ending ending = run(recipe_.with_out(out_));
    if (!ending.succeeded()) return fmt::format("it does not run again: {}\nbefore: {}", ending.err, first.err);
    const std::string lost = difference(state_of(out_), whole_);
    return lost.empty() ? "" : fmt::format("after another run, {}: {}", lost, first.err);
  }

  const TinyWork& work_;
  Recipe recipe_;
  fs::path out_;
  Fault fault_;
  Files before_, whole_;
  std::vector<long> counts_;
  long points_ = 0;
};

TEST(FaultSweep, LosesNothing) {
  const TinyWork work;
  long points = 0;
  std::vector<std::string> findings;
  for (const Recipe& recipe : work.recipes()) {
    if (!is_wanted(recipe, "prepare,train,track,export")) continue;
    Sweep sweep(work, recipe);
    const std::vector<std::string> found = sweep.run_all();
    std::cout << fmt::format("{}: {} faults, {} findings; {} calls\n", recipe.name, sweep.points(), found.size(),
                             sweep.calls())
              << std::flush;
    for (const std::string& finding : found) std::cout << "  " << finding << "\n" << std::flush;
    points += sweep.points();
    findings.insert(findings.end(), found.begin(), found.end());
  }
  EXPECT_GT(points, 0);
  EXPECT_EQ(findings.size(), 0u) << "of " << points << " faults";
  RecordProperty("faults", static_cast<int>(points));
}

}  // namespace
}  // namespace doppel::faults
