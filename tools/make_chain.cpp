#include "make_chain.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <numeric>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/temporary_name.h"
#include "program.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr char kFile[] = "make.json";

/// Sends what the process writes to stdout into a file while it lives. The file has its name once it is whole.
class StdoutToFile {
 public:
  explicit StdoutToFile(fs::path path)
      : path_(std::move(path)), temporary_(temporary_beside(path_)), before_(dup(STDOUT_FILENO)) {
    flush();
    const int file = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (before_ < 0 || file < 0) fail("{}: the results of a step cannot be written", path_.string());
    dup2(file, STDOUT_FILENO);
    close(file);
  }
  ~StdoutToFile() {
    flush();
    dup2(before_, STDOUT_FILENO);
    close(before_);
    std::error_code ignored;
    fs::remove(temporary_, ignored);  // what was published is no longer there
  }
  StdoutToFile(const StdoutToFile&) = delete;
  StdoutToFile& operator=(const StdoutToFile&) = delete;

  void publish() const {
    if (!flush()) fail("writing {}: {}", path_.string(), std::strerror(errno));
    publish_file(temporary_, path_);
  }

 private:
  static bool flush() {
    std::cout.flush();
    return std::fflush(stdout) == 0 && std::cout.good();
  }
  fs::path path_, temporary_;
  int before_;
};

Json read_json(const fs::path& path) {
  try {
    return Json::parse(read_file(path));
  } catch (const Json::exception& e) {
    fail_at({path.string(), 0}, "the file is damaged ({}); remove it, and the step runs again", e.what());
  }
}

/// The commands print one JSON object with --json, or nothing.
Json results_in(const fs::path& path) {
  return fs::exists(path) && fs::file_size(path) > 0 ? read_json(path) : Json::object();
}

}  // namespace

ProgressChain expected_time(const std::vector<PlannedStep>& plan, std::size_t step,
                            const std::map<std::string, double>& spent) {
  constexpr double kMinExpected = 20.0;  // seconds: shorter steps tell nothing about the machine
  double expected = 0.0, taken = 0.0, elapsed = 0.0;
  for (const auto& [name, seconds] : spent) elapsed += seconds;
  for (std::size_t i = 0; i < step; ++i)
    if (const auto found = spent.find(plan[i].name); found != spent.end()) {
      expected += plan[i].seconds;
      taken += found->second;
    }
  const double slower = expected >= kMinExpected ? std::clamp(taken / expected, 0.25, 8.0) : 1.0;
  const auto seconds_of = [&](const PlannedStep& s, double begin) {
    return s.end > 0.0 ? std::max(s.seconds, s.end - begin) : slower * s.seconds;
  };
  ProgressChain chain;
  chain.position = fmt::format("[{}/{}]", step + 1, plan.size());
  chain.step_seconds = seconds_of(plan[step], elapsed);
  for (std::size_t i = step + 1; i < plan.size(); ++i)
    chain.later_seconds += seconds_of(plan[i], elapsed + chain.step_seconds + chain.later_seconds);
  return chain;
}

std::string command_line(const std::vector<std::string>& words) {
  std::string line = "doppel";
  for (const std::string& word : words) {
    const bool plain = !word.empty() && word.find_first_of(" '\"$\\&|;<>()*?[]#~") == std::string::npos;
    std::string quoted;
    for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += " " + (plain ? word : "'" + quoted + "'");
  }
  return line;
}

MakeChain::MakeChain(fs::path out, const CommonOptions& common, std::vector<std::string> inputs,
                     std::vector<PlannedStep> plan)
    : out_(std::move(out)), common_(common), inputs_(std::move(inputs)), plan_(std::move(plan)) {
  const fs::path file = out_ / kFile;
  if (!fs::exists(file)) return;
  const Json before = read_json(file);
  try {
    steps_ = before.at("steps");
    for (const Json& step : steps_) step.at("seconds").get<double>();
    if (before.at("inputs").get<std::vector<std::string>>() == inputs_) return;
  } catch (const Json::exception& e) {
    fail_at({file.string(), 0}, "the file is damaged ({}); remove it, and the chain begins anew", e.what());
  }
  fail<UsageError>(
      "{} was made from other footage or with other options; choose another folder with --out, or remove {}",
      out_.string(), file.string());
}

fs::path MakeChain::results_file(const std::string& name) const { return out_ / "steps" / (name + ".json"); }

void MakeChain::write() const {
  write_atomically(out_ / kFile, Json{{"inputs", inputs_}, {"steps", steps_}}.dump(2) + "\n");
}

double MakeChain::seconds() const {
  return std::accumulate(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(next_), 0.0,
                         [](double sum, const Json& step) { return sum + step["seconds"].get<double>(); });
}

void MakeChain::show_position(const std::string& name) {
  const auto planned = std::find_if(plan_.begin(), plan_.end(), [&](const PlannedStep& s) { return s.name == name; });
  if (planned == plan_.end()) return;
  std::map<std::string, double> spent;
  for (std::size_t i = 0; i < next_; ++i) spent[steps_[i]["name"]] = steps_[i]["seconds"].get<double>();
  const ProgressChain chain = expected_time(plan_, static_cast<std::size_t>(planned - plan_.begin()), spent);
  fmt::print(stderr, "{} {} (whole chain: about {} left)\n", chain.position, name,
             format_duration(chain.step_seconds + chain.later_seconds));
  set_progress_chain(chain);
}

Json MakeChain::run(const std::string& name, const std::vector<std::string>& words, int failing) {
  const fs::path results = results_file(name);
  const std::string command = command_line(words);
  if (next_ < steps_.size() && steps_[next_]["command"] == command && fs::exists(results)) {
    ++next_;
    return results_in(results);
  }
  steps_.erase(steps_.begin() + static_cast<std::ptrdiff_t>(next_), steps_.end());
  show_position(name);
  fmt::print(stderr, "    {}\n", command);
  std::vector<std::string> all{"doppel"};
  all.insert(all.end(), words.begin(), words.end());
  for (const std::string& word : {std::string("--json"), std::string("--log-level"),
                                  std::string(common_.log_level == "info" ? "warn" : common_.log_level),
                                  std::string("--threads"), std::to_string(common_.threads)})
    all.push_back(word);
  std::vector<const char*> argv;
  for (const std::string& word : all) argv.push_back(word.c_str());
  fs::create_directories(results.parent_path());
  const Clock::time_point begin = Clock::now();
  const auto [code, done] = [&] {
    const StdoutToFile redirected(results);
    const int ended = run_program(static_cast<int>(argv.size()), argv.data());
    const bool has_results = ended == 0 || (ended == failing && !stop_requested());
    if (has_results) redirected.publish();
    return std::pair(ended, has_results);
  }();
  set_progress_chain(std::nullopt);
  setup_logging(common_.log_level);
  if (!done) {
    fmt::print(stderr, "doppel make: stopped at the step {}; the same command goes on from there\n", name);
    throw StepFailed{code};
  }
  steps_.push_back(
      {{"name", name}, {"command", command}, {"seconds", std::chrono::duration<double>(Clock::now() - begin).count()}});
  next_ = steps_.size();
  write();
  return results_in(results);
}

void MakeChain::skip(const std::string& name, const std::string& reason) {
  fmt::print(stderr, "{}: {}\n", name, reason);
}

}  // namespace doppel::tools
