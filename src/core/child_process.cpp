#include "doppel/core/child_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstring>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

extern char** environ;

namespace doppel {

namespace {

constexpr std::size_t kKeptOutput = 4096;

/// The working folder and the streams of a program that is to be started.
class StreamActions {
 public:
  StreamActions(const std::filesystem::path& folder, const std::filesystem::path& output) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_addopen(&actions_, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions_, 1, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions_, 1, 2);
    posix_spawn_file_actions_addchdir_np(&actions_, folder.c_str());
  }
  ~StreamActions() { posix_spawn_file_actions_destroy(&actions_); }
  StreamActions(const StreamActions&) = delete;
  StreamActions& operator=(const StreamActions&) = delete;

  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

int exit_code_of(pid_t process) {
  int status = 0;
  while (waitpid(process, &status, 0) < 0) {
    if (errno != EINTR) fail("waiting for a program: {}", std::strerror(errno));
  }
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

/// The end of what a program printed; the file is removed.
std::string take_output(const std::filesystem::path& path) {
  std::string text = read_file(path);
  std::filesystem::remove(path);
  return text.size() > kKeptOutput ? text.substr(text.size() - kKeptOutput) : text;
}

}  // namespace

ProgramResult run_program(const std::vector<std::string>& arguments, const std::filesystem::path& folder) {
  const std::filesystem::path output = std::filesystem::absolute(folder) / ".output";
  const StreamActions streams(std::filesystem::absolute(folder), output);
  std::vector<char*> words;
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  pid_t process = 0;
  const int error = posix_spawnp(&process, words[0], streams.get(), nullptr, words.data(), environ);
  if (error == ENOENT) return {};
  if (error != 0) fail("starting the program {} in {}: {}", arguments[0], folder.string(), std::strerror(error));
  const int exit_code = exit_code_of(process);
  return {true, exit_code, take_output(output)};
}

}  // namespace doppel
