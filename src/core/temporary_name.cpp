#include "doppel/core/temporary_name.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <regex>

#include "doppel/core/error.h"

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

}  // namespace

fs::path temporary_beside(const fs::path& path) {
  static std::atomic<unsigned> counter{0};
  const std::string name =
      fmt::format(".{}.{}-{}{}", path.stem().string(), ::getpid(), counter.fetch_add(1), path.extension().string());
  return path.parent_path() / name;
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

void remove_temporaries(const fs::path& folder, const std::function<bool(const std::string&)>& ours) {
  static const std::regex pattern("\\.(.+)\\.[0-9]+-[0-9]+(\\.[^.]*)?");
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    std::smatch parts;
    if (std::regex_match(name, parts, pattern) && ours(parts[1].str() + parts[2].str()))
      fs::remove(entry.path(), ignored);
  }
}

}  // namespace doppel
