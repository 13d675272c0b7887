#include "doppel/core/appended_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

AppendedFile::AppendedFile(std::filesystem::path path)
    : path_(std::move(path)), file_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666)) {
  if (file_ < 0) fail("cannot write {}: {}", path_.string(), std::strerror(errno));
}

AppendedFile::~AppendedFile() { ::close(file_); }

bool AppendedFile::write() {
  while (!missing_.empty()) {
    const ssize_t written = ::write(file_, missing_.data(), missing_.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      reason_ = std::strerror(errno);
      return false;
    }
    missing_.erase(0, as_size(written));
  }
  return true;
}

void AppendedFile::append(const std::string& record) {
  const bool warned = !missing_.empty();
  missing_ += record;
  if (!write() && !warned) log::warn("cannot write {}: {}; it is tried again later", path_.string(), reason_);
}

void AppendedFile::finish() {
  if (!write()) fail("cannot write {}: {}; its last {} bytes are missing", path_.string(), reason_, missing_.size());
}

}  // namespace doppel
