#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "doppel/core/temporary_name.h"

namespace doppel::support {

/// The temporary name beside `path` of a process that has ended.
inline std::filesystem::path left_by_a_killed_process(const std::filesystem::path& path) {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  waitpid(child, nullptr, 0);
  const std::string here = std::to_string(getpid());
  std::string name = temporary_beside(path).filename().string();
  return path.parent_path() / name.replace(name.find("-" + here + "-") + 1, here.size(), std::to_string(child));
}

}  // namespace doppel::support
