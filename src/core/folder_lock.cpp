#include "doppel/core/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <sstream>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/temporary_name.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr char kLockName[] = ".doppel-lock";

/// What the owner wrote: its process number and its host.
std::string owner_of(int file) {
  std::array<char, 512> text{};
  const ssize_t size = ::pread(file, text.data(), text.size(), 0);
  std::istringstream words(std::string(text.data(), size > 0 ? as_size(size) : 0));
  std::string process, host;
  if (!(words >> process >> host)) return "another process";  // it has not written them yet
  return fmt::format("process {} on {}", process, host);
}

/// Whether `path` still names the opened file: an owner that ends removes it.
bool is_still(int file, const fs::path& path) {
  struct stat opened = {}, named = {};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &named) == 0 && opened.st_dev == named.st_dev &&
         opened.st_ino == named.st_ino;
}

/// Opens and locks the file. @return its descriptor
int lock_file(const fs::path& path, const fs::path& folder) {
  for (;;) {
    const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (file < 0) fail("{}: the folder cannot be written: {}", folder.string(), std::strerror(errno));
    if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
      const int reason = errno;
      if (reason != EWOULDBLOCK) {
        log::warn("{}: this file system has no locks ({}); see that no other process writes there", folder.string(),
                  std::strerror(reason));
        return file;
      }
      const std::string owner = owner_of(file);
      ::close(file);
      fail("{}: {} writes into this folder. Wait until it ends, stop it, or choose another --out", folder.string(),
           owner);
    }
    if (is_still(file, path)) return file;
    ::close(file);
  }
}

}  // namespace

FolderLock::FolderLock(const fs::path& folder) : folder_(folder) {
  std::error_code code;
  if (fs::exists(folder, code) && !fs::is_directory(folder, code))
    fail<UsageError>("{} is a file; give a folder to write into", folder.string());
  made_folder_ = fs::create_directories(folder, code);
  if (code) fail("{}: the folder cannot be made: {}", folder.string(), code.message());
  file_ = lock_file(folder / kLockName, folder);
  remove_temporaries(folder);
  const std::string owner = fmt::format("{} {}\n", ::getpid(), host_name());
  // Only a message needs the content, so a full disk does not stop the work here.
  if (::ftruncate(file_, 0) == 0) (void)!::pwrite(file_, owner.data(), owner.size(), 0);
}

FolderLock::~FolderLock() {
  std::error_code ignored;
  // Removed while it is locked: a process that has opened it notices by `is_still`.
  fs::remove(folder_ / kLockName, ignored);
  ::close(file_);
  if (made_folder_) fs::remove(folder_, ignored);
}

bool is_unused_folder(const fs::path& folder) {
  if (!fs::exists(folder)) return true;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().filename() != kLockName) return false;
  return true;
}

}  // namespace doppel
