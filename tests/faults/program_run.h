#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "faults/fault_plan.h"

namespace doppel::faults {

/// A fault for one process, and what it counted: the memory that the shim shares with the test.
class Fault {
 public:
  /// @param folder only calls on files in it count
  explicit Fault(const std::filesystem::path& folder);
  ~Fault();
  Fault(const Fault&) = delete;
  Fault& operator=(const Fault&) = delete;

  /// Begins anew. @param call 0: only count
  void set(FaultKind kind, long call);
  const FaultPlan& plan() const { return *plan_; }
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path folder_, file_;
  FaultPlan* plan_ = nullptr;
};

/// How a process ended.
struct Ending {
  int code = -1;  ///< -1: by a signal
  int signal = 0;
  bool hung = false;        ///< it was killed, after minutes
  std::string err;          ///< what it wrote to stderr
  long peak_megabytes = 0;  ///< largest resident memory

  bool succeeded() const { return code == 0; }
};

/// `doppel` as a process of its own, with one thread.
class Process {
 public:
  /// @param words without the program's name @param fault may be null
  explicit Process(const std::vector<std::string>& words, const Fault* fault = nullptr);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t id() const { return id_; }
  void send(int signal) const;
  bool has_ended();
  /// What it has written to stderr so far.
  std::string err() const;
  Ending wait();

 private:
  std::filesystem::path log_;
  pid_t id_ = -1;
  int status_ = 0;
  long peak_kilobytes_ = 0;
  bool ended_ = false;
};

/// @param words as for `Process`
Ending run(const std::vector<std::string>& words, const Fault* fault = nullptr);

}  // namespace doppel::faults
