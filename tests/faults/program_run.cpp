#include "faults/program_run.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace doppel::faults {

namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kPatience = 300s;

/// A new empty file outside of the watched folder.
fs::path new_file() {
  std::string name = (fs::temp_directory_path() / "doppel-faults-XXXXXX").string();
  const int file = mkstemp(name.data());
  if (file < 0) throw std::runtime_error("cannot make " + name);
  ::close(file);
  return name;
}

[[noreturn]] void start(const std::vector<std::string>& words, const fs::path& log, const Fault* fault) {
  const int file = ::open(log.c_str(), O_WRONLY | O_TRUNC);
  const int nothing = ::open("/dev/null", O_RDWR);
  if (file < 0 || nothing < 0 || dup2(nothing, 0) < 0 || dup2(nothing, 1) < 0 || dup2(file, 2) < 0) _exit(126);
  setenv("OMP_NUM_THREADS", "1", 1);
  setenv("GOMP_SPINCOUNT", "0", 1);  // the program would start itself again to set it
  if (fault) {
    setenv("DOPPEL_FAULTS", fault->file().c_str(), 1);
    setenv("LD_PRELOAD", DOPPEL_FAULT_SHIM, 1);
  }
  std::vector<const char*> argv{DOPPEL_PROGRAM};
  for (const std::string& word : words) argv.push_back(word.c_str());
  argv.push_back(nullptr);
  execv(DOPPEL_PROGRAM, const_cast<char**>(argv.data()));
  _exit(127);
}

}  // namespace

Fault::Fault(const fs::path& folder) : folder_(fs::canonical(folder)), file_(new_file()) {
  fs::resize_file(file_, sizeof(FaultPlan));
  const int file = ::open(file_.c_str(), O_RDWR);
  void* at = mmap(nullptr, sizeof(FaultPlan), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  if (at == MAP_FAILED) throw std::runtime_error("cannot map " + file_.string());
  plan_ = static_cast<FaultPlan*>(at);
}

Fault::~Fault() {
  munmap(plan_, sizeof(FaultPlan));
  std::error_code ignored;
  fs::remove(file_, ignored);
}

void Fault::set(FaultKind kind, long call) {
  *plan_ = FaultPlan{};
  plan_->kind = kind;
  plan_->call = call;
  std::strncpy(plan_->folder, folder_.c_str(), sizeof(plan_->folder) - 1);
}

Process::Process(const std::vector<std::string>& words, const Fault* fault) : log_(new_file()) {
  id_ = fork();
  if (id_ == 0) start(words, log_, fault);
}

Process::~Process() {
  if (!ended_) {
    send(SIGKILL);
    waitpid(id_, &status_, 0);
  }
  std::error_code ignored;
  fs::remove(log_, ignored);
}

void Process::send(int signal) const { ::kill(id_, signal); }

bool Process::has_ended() {
  if (ended_) return true;
  rusage used{};
  ended_ = wait4(id_, &status_, WNOHANG, &used) == id_;
  peak_kilobytes_ = used.ru_maxrss;
  return ended_;
}

std::string Process::err() const {
  std::ostringstream text;
  text << std::ifstream(log_).rdbuf();
  return text.str();
}

Ending Process::wait() {
  Ending ending;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!has_ended()) {
    if (std::chrono::steady_clock::now() > end && !ending.hung) {
      ending.hung = true;
      send(SIGKILL);
    }
    std::this_thread::sleep_for(1ms);
  }
  if (WIFEXITED(status_)) ending.code = WEXITSTATUS(status_);
  if (WIFSIGNALED(status_)) ending.signal = WTERMSIG(status_);
  ending.err = err();
  ending.peak_megabytes = peak_kilobytes_ / 1024;
  return ending;
}

Ending run(const std::vector<std::string>& words, const Fault* fault) { return Process(words, fault).wait(); }

}  // namespace doppel::faults
