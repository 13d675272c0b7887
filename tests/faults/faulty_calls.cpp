// Loaded before the C library (LD_PRELOAD), it lets one call on a file fail, as a full or a broken disk does.
//   DOPPEL_FAULT_FOLDER  only files below this folder count
//   DOPPEL_FAULT_KIND    write, rename, fsync, open or read
//   DOPPEL_FAULT_CALL    the number of the first call of this kind that fails, from 1; 0: none
//   DOPPEL_FAULT_LASTS   set: all later calls of this kind fail too
//   DOPPEL_FAULT_COUNT   file that gets the number of calls of this kind when the process ends
// Reads and fsyncs fail with EIO, all others with ENOSPC. `open` counts only opening for writing.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace {

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

struct Plan {
  const std::string folder = variable("DOPPEL_FAULT_FOLDER"), kind = variable("DOPPEL_FAULT_KIND");
  const long call = std::atol(variable("DOPPEL_FAULT_CALL").c_str());
  const bool lasts = !variable("DOPPEL_FAULT_LASTS").empty();
};

const Plan& plan() {
  static const Plan* const the_plan = new Plan;  // not destroyed: calls at the end of the process need it
  return *the_plan;
}

std::atomic<long> calls{0};

bool concerns(const char* path) {
  if (path == nullptr || plan().folder.empty()) return false;
  char whole[PATH_MAX] = {};
  std::string absolute = path;
  if (absolute.empty() || absolute[0] != '/')
    absolute = std::string(getcwd(whole, sizeof(whole)) == nullptr ? "" : whole) + "/" + absolute;
  return absolute.compare(0, plan().folder.size(), plan().folder) == 0;
}

bool concerns(int file) {
  if (plan().folder.empty()) return false;
  char link[64], path[PATH_MAX];
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", file);
  const ssize_t size = readlink(link, path, sizeof(path) - 1);
  if (size <= 0) return false;
  path[size] = '\0';
  return concerns(path);
}

/// Counts a call. @return whether it fails; errno is set then
template <typename File>
bool fails(const char* kind, File file, int error) {
  if (plan().kind != kind || !concerns(file)) return false;
  const long number = ++calls;
  if (plan().call == 0 || number < plan().call || (number > plan().call && !plan().lasts)) return false;
  errno = error;
  return true;
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

struct CountAtEnd {
  ~CountAtEnd() {
    const std::string path = variable("DOPPEL_FAULT_COUNT");
    if (path.empty()) return;
    if (std::FILE* file = std::fopen(path.c_str(), "w")) {
      std::fprintf(file, "%ld\n", calls.load());
      std::fclose(file);
    }
  }
} count_at_end;

bool writes(int flags) { return (flags & O_ACCMODE) != O_RDONLY; }
bool writes(const char* mode) { return std::strpbrk(mode, "wa+") != nullptr; }

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  if (writes(flags) && fails("open", path, ENOSPC)) return -1;
  return next<int(const char*, int, ...)>("open")(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  if (writes(flags) && fails("open", path, ENOSPC)) return -1;
  return next<int(const char*, int, ...)>("open64")(path, flags, mode);
}
FILE* fopen(const char* path, const char* mode) {
  if (writes(mode) && fails("open", path, ENOSPC)) return nullptr;
  return next<FILE*(const char*, const char*)>("fopen")(path, mode);
}
FILE* fopen64(const char* path, const char* mode) {
  if (writes(mode) && fails("open", path, ENOSPC)) return nullptr;
  return next<FILE*(const char*, const char*)>("fopen64")(path, mode);
}
ssize_t write(int file, const void* bytes, size_t size) {
  if (fails("write", file, ENOSPC)) return -1;
  return next<ssize_t(int, const void*, size_t)>("write")(file, bytes, size);
}
ssize_t writev(int file, const iovec* parts, int count) {
  if (fails("write", file, ENOSPC)) return -1;
  return next<ssize_t(int, const iovec*, int)>("writev")(file, parts, count);
}
ssize_t pwrite(int file, const void* bytes, size_t size, off_t at) {
  if (fails("write", file, ENOSPC)) return -1;
  return next<ssize_t(int, const void*, size_t, off_t)>("pwrite")(file, bytes, size, at);
}
ssize_t pwrite64(int file, const void* bytes, size_t size, off64_t at) {
  if (fails("write", file, ENOSPC)) return -1;
  return next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64")(file, bytes, size, at);
}
ssize_t pwritev(int file, const iovec* parts, int count, off_t at) {
  if (fails("write", file, ENOSPC)) return -1;
  return next<ssize_t(int, const iovec*, int, off_t)>("pwritev")(file, parts, count, at);
}
size_t fwrite(const void* bytes, size_t size, size_t count, FILE* stream) {
  if (fails("write", fileno(stream), ENOSPC)) return 0;
  return next<size_t(const void*, size_t, size_t, FILE*)>("fwrite")(bytes, size, count, stream);
}
int fflush(FILE* stream) {
  if (stream != nullptr && fails("write", fileno(stream), ENOSPC)) return EOF;
  return next<int(FILE*)>("fflush")(stream);
}
ssize_t read(int file, void* bytes, size_t size) {
  if (fails("read", file, EIO)) return -1;
  return next<ssize_t(int, void*, size_t)>("read")(file, bytes, size);
}
int rename(const char* from, const char* to) {
  if (fails("rename", to, ENOSPC)) return -1;
  return next<int(const char*, const char*)>("rename")(from, to);
}
int fsync(int file) {
  if (fails("fsync", file, EIO)) return -1;
  return next<int(int)>("fsync")(file);
}
int fdatasync(int file) {
  if (fails("fsync", file, EIO)) return -1;
  return next<int(int)>("fdatasync")(file);
}

}  // extern "C"
