#include "doppel/core/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/temporary_name.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_writing(const fs::path& path, const std::string& reason) {
  fail("writing {}: {}", path.string(), reason);
}

std::string system_reason() { return std::strerror(errno); }

class FileDescriptor {
 public:
  FileDescriptor(const fs::path& path, int flags) : value_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~FileDescriptor() {
    if (value_ >= 0) ::close(value_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  explicit operator bool() const { return value_ >= 0; }
  int get() const { return value_; }
  bool close() { return ::close(std::exchange(value_, -1)) == 0; }

 private:
  int value_;
};

/// Removes the temporary file unless it has been renamed.
struct TemporaryFile {
  explicit TemporaryFile(fs::path p) : path(std::move(p)) {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    std::error_code ignored;
    if (!path.empty()) fs::remove(path, ignored);
  }
  fs::path path;
};

/// The file to replace. A link stays a link, and its target is replaced.
fs::path target_of(const fs::path& path) {
  std::error_code code;
  if (!fs::is_symlink(path, code)) return path;
  const fs::path target = fs::weakly_canonical(path, code);
  return code ? path : target;
}

void write_whole(const fs::path& temporary, const std::string& content, const fs::path& path) {
  FileDescriptor file(temporary, O_WRONLY | O_CREAT | O_TRUNC);
  if (!file) fail_writing(path, system_reason());
  std::size_t written = 0;
  while (written < content.size()) {
    const ssize_t n = ::write(file.get(), content.data() + written, content.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_writing(path, system_reason());
    written += as_size(n);
  }
  if (!file.close()) fail_writing(path, system_reason());
}

}  // namespace

void write_atomically(const fs::path& path, const std::function<void(const fs::path&)>& write) {
  if (path.filename().empty()) fail_writing(path, "the path names no file");
  const fs::path target = target_of(path);
  std::error_code code;
  if (!target.parent_path().empty()) {
    fs::create_directories(target.parent_path(), code);
    if (code) fail_writing(path, fmt::format("cannot create its folder: {}", code.message()));
  }
  if (fs::is_directory(target, code)) fail_writing(path, "a folder of this name already exists");

  TemporaryFile temporary(temporary_beside(target));
  write(temporary.path);
  publish_file(temporary.path, target);
  temporary.path.clear();
}

void write_atomically(const fs::path& path, const std::string& content) {
  write_atomically(path, [&](const fs::path& temporary) { write_whole(temporary, content, path); });
}

std::string read_file(const fs::path& path, std::uintmax_t max_bytes) {
  const FileLocation where{path.string(), 0};
  // Without O_NONBLOCK, opening a pipe waits until another program writes to it.
  FileDescriptor file(path, O_RDONLY | O_NONBLOCK);
  if (!file) fail_at(where, "cannot read this file: {}", system_reason());
  struct stat status = {};
  if (::fstat(file.get(), &status) != 0) fail_at(where, "cannot read this file: {}", system_reason());
  if (S_ISDIR(status.st_mode)) fail_at(where, "this is a folder, not a file");
  if (!S_ISREG(status.st_mode))
    fail_at(where, "this is a pipe or a device, not a file; copy its content into a file and name that one");

  // Files of /proc report no size, so the size is only the initial capacity.
  std::string content;
  const auto known_size = status.st_size > 0 ? static_cast<std::uintmax_t>(status.st_size) : 0;
  std::size_t filled = 0;
  if (known_size <= max_bytes) content.resize(as_size(known_size) + 1);
  for (;;) {
    if (known_size > max_bytes || filled > max_bytes) {
      fail_at(where, "this file is too large: found {} bytes, allowed are {}",
              std::max<std::uintmax_t>(known_size, filled), max_bytes);
    }
    if (filled == content.size()) content.resize(2 * content.size());
    const ssize_t n = ::read(file.get(), content.data() + filled, content.size() - filled);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail_at(where, "cannot read this file: {}", system_reason());
    if (n == 0) break;
    filled += as_size(n);
  }
  content.resize(filled);
  return content;
}

}  // namespace doppel
