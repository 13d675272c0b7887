#include "doppel/core/temporary_name.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <mutex>
#include <set>

#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// @return 0, or the system's reason
int flush(const fs::path& path, int flags) {
  const int file = ::open(path.c_str(), flags | O_RDONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const int reason = ::fsync(file) == 0 ? 0 : errno;
  ::close(file);
  return reason;
}

/// Starts the temporary names of this machine.
const std::string& machine_prefix() {
  static const std::string kPrefix = [] {
    const std::string host = host_name();
    return fmt::format(".doppel-{:08x}-", crc32c(host.data(), host.size()));
  }();
  return kPrefix;
}

bool is_running(pid_t process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

void remove_temporaries_once(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<fs::path> done;
  const std::lock_guard lock(mutex);
  if (done.insert(folder).second) remove_temporaries(folder);
}

}  // namespace

fs::path temporary_beside(const fs::path& path) {
  static std::atomic<unsigned> counter{0};
  remove_temporaries_once(path.parent_path());
  return path.parent_path() /
         fmt::format("{}{}-{}-{}", machine_prefix(), ::getpid(), counter.fetch_add(1), path.filename().string());
}

void publish_file(const fs::path& temporary, const fs::path& path) {
  if (const int reason = flush(temporary, 0)) fail("writing {}: {}", path.string(), std::strerror(reason));
  std::error_code code;
  fs::rename(temporary, path, code);
  if (code) fail("writing {}: {}", path.string(), code.message());
  // Some file systems cannot flush a folder; the content is safe in any case.
  const fs::path folder = path.parent_path();
  (void)flush(folder.empty() ? fs::path(".") : folder, O_DIRECTORY);
}

void remove_temporaries(const fs::path& folder) {
  std::error_code ignored;
  const fs::path listed = folder.empty() ? fs::path(".") : folder;
  if (!fs::is_directory(listed, ignored)) return;
  for (const auto& entry : fs::directory_iterator(listed, ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(machine_prefix())) continue;
    pid_t process = 0;
    const auto [end, reason] =
        std::from_chars(name.data() + machine_prefix().size(), name.data() + name.size(), process);
    if (reason == std::errc() && process > 0 && *end == '-' && !is_running(process)) fs::remove(entry.path(), ignored);
  }
}

}  // namespace doppel
