#include "doppel/core/temporary_name.h"

#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <regex>

namespace doppel {

namespace fs = std::filesystem;

fs::path temporary_beside(const fs::path& path) {
  static std::atomic<unsigned> counter{0};
  const std::string name =
      fmt::format(".{}.{}-{}{}", path.stem().string(), ::getpid(), counter.fetch_add(1), path.extension().string());
  return path.parent_path() / name;
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
