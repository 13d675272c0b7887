/* Makes one call of a kind fail (fault_plan.h), for programs started with LD_PRELOAD. glibc's own streams call the
   system without passing here, so that their functions are replaced too. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include "fault_plan.h"

extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);

static struct FaultPlan* plan;
static int in_main; /* static initialisers of libraries cannot report a failure */

#define REAL(name) ((__typeof__(&name))real(#name))
static void* real(const char* name) { return dlsym(RTLD_NEXT, name); }

__attribute__((constructor)) static void map_plan(void) {
  const char* path = getenv("DOPPEL_FAULTS");
  const int file = path ? (int)syscall(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC) : -1;
  if (file < 0) return;
  void* at = (void*)syscall(SYS_mmap, NULL, sizeof(struct FaultPlan), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (at != MAP_FAILED) plan = at;
  syscall(SYS_close, file);
}

/* Counts a call. Returns whether it shall fail. */
static int fails(int kind, const char* call, const char* path) {
  const long number = __atomic_add_fetch(&plan->counts[kind], 1, __ATOMIC_RELAXED);
  if (plan->kind != kind || plan->call == 0) return 0;
  if (kind == FAULT_FULL ? number < plan->call : number != plan->call) return 0;
  if (__atomic_fetch_add(&plan->failed, 1, __ATOMIC_RELAXED) == 0) {
    strncpy(plan->failed_call, call, sizeof(plan->failed_call) - 1);
    strncpy(plan->failed_path, path, sizeof(plan->failed_path) - 1);
  }
  return 1;
}

static int is_watched(const char* path) {
  const size_t length = strlen(plan->folder);
  return length > 0 && strncmp(path, plan->folder, length) == 0 && (path[length] == '/' || path[length] == 0);
}

/* The path of a descriptor, if its file is watched. */
static int watched_file(int file, char path[PATH_MAX]) {
  char link[64];
  if (!plan) return 0;
  const int kept = errno;
  snprintf(link, sizeof(link), "/proc/self/fd/%d", file);
  const ssize_t length = readlink(link, path, PATH_MAX - 1);
  errno = kept;
  if (length <= 0) return 0;
  path[length] = 0;
  return is_watched(path);
}

static int is_written(int file) {
  const int flags = fcntl(file, F_GETFL);
  return flags >= 0 && (flags & O_ACCMODE) != O_RDONLY;
}

static int file_fails(int kind, const char* call, int file) {
  char path[PATH_MAX];
  return watched_file(file, path) && fails(kind, call, path);
}

static int path_fails(int kind, const char* call, const char* path) {
  return plan && path && is_watched(path) && fails(kind, call, path);
}

static int failed(int reason) {
  errno = reason;
  return -1;
}

/* Whether a write fails, and how many bytes it may write. */
static int write_fails(const char* call, int file, size_t* size) {
  char path[PATH_MAX];
  if (!watched_file(file, path)) return 0;
  if (size && *size > 1 && fails(FAULT_SHORT, call, path)) *size /= 2;
  const int full = fails(FAULT_FULL, call, path);
  return fails(FAULT_WRITE, call, path) || full;
}

/* ---- memory ---- */

static int memory_fails(const char* call) { return plan && in_main && fails(FAULT_MEMORY, call, ""); }

void* malloc(size_t size) {
  if (memory_fails("malloc")) return failed(ENOMEM), NULL;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  if (memory_fails("calloc")) return failed(ENOMEM), NULL;
  return __libc_calloc(count, size);
}
void* realloc(void* old, size_t size) {
  if (size > 0 && memory_fails("realloc")) return failed(ENOMEM), NULL;
  return __libc_realloc(old, size);
}
void* memalign(size_t alignment, size_t size) {
  if (memory_fails("memalign")) return failed(ENOMEM), NULL;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }
int posix_memalign(void** to, size_t alignment, size_t size) {
  if (memory_fails("posix_memalign")) return ENOMEM;
  void* block = __libc_memalign(alignment, size);
  if (!block) return ENOMEM;
  *to = block;
  return 0;
}

static int (*program)(int, char**, char**);
static int run_program(int argc, char** argv, char** environment) {
  in_main = 1;
  return program(argc, argv, environment);
}
typedef int (*Start)(int (*)(int, char**, char**), int, char**, void (*)(void), void (*)(void), void (*)(void), void*);
int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(void), void (*fini)(void),
                      void (*end)(void), void* stack) {
  program = main;
  return ((Start)real("__libc_start_main"))(run_program, argc, argv, init, fini, end, stack);
}

/* ---- opening ---- */

static int opening_fails(const char* call, const char* path, int flags) {
  const int writes = (flags & O_ACCMODE) != O_RDONLY || (flags & O_CREAT);
  if (!path_fails(writes ? FAULT_CREATE : FAULT_OPEN, call, path)) return 0;
  errno = writes ? EACCES : EMFILE;
  return 1;
}
static mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) ? va_arg(arguments, mode_t) : 0;
}

#define OPEN(name)                                    \
  int name(const char* path, int flags, ...) {        \
    va_list arguments;                                \
    va_start(arguments, flags);                       \
    const mode_t mode = mode_of(flags, arguments);    \
    va_end(arguments);                                \
    if (opening_fails(#name, path, flags)) return -1; \
    return REAL(name)(path, flags, mode);             \
  }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                       \
  int name(int folder, const char* path, int flags, ...) { \
    va_list arguments;                                     \
    va_start(arguments, flags);                            \
    const mode_t mode = mode_of(flags, arguments);         \
    va_end(arguments);                                     \
    if (opening_fails(#name, path, flags)) return -1;      \
    return REAL(name)(folder, path, flags, mode);          \
  }
OPENAT(openat)
OPENAT(openat64)

#define FOPEN(name)                                                                                        \
  FILE* name(const char* path, const char* mode) {                                                         \
    if (opening_fails(#name, path, mode[0] == 'r' && !strchr(mode, '+') ? O_RDONLY : O_RDWR)) return NULL; \
    return REAL(name)(path, mode);                                                                         \
  }
FOPEN(fopen)
FOPEN(fopen64)

int mkdir(const char* path, mode_t mode) {
  if (path_fails(FAULT_CREATE, "mkdir", path)) return failed(EACCES);
  return REAL(mkdir)(path, mode);
}

/* ---- reading ---- */

ssize_t read(int file, void* to, size_t size) {
  if (file_fails(FAULT_READ, "read", file)) return failed(EIO);
  return syscall(SYS_read, file, to, size);
}
#define PREAD(name, offset_type)                                  \
  ssize_t name(int file, void* to, size_t size, offset_type at) { \
    if (file_fails(FAULT_READ, #name, file)) return failed(EIO);  \
    return syscall(SYS_pread64, file, to, size, at);              \
  }
PREAD(pread, off_t)
PREAD(pread64, off64_t)
ssize_t readv(int file, const struct iovec* parts, int count) {
  if (file_fails(FAULT_READ, "readv", file)) return failed(EIO);
  return syscall(SYS_readv, file, parts, count);
}
size_t fread(void* to, size_t size, size_t count, FILE* stream) {
  if (file_fails(FAULT_READ, "fread", fileno(stream))) {
    stream->_flags |= _IO_ERR_SEEN;
    return failed(EIO), 0;
  }
  return REAL(fread)(to, size, count, stream);
}
char* fgets(char* to, int size, FILE* stream) {
  if (file_fails(FAULT_READ, "fgets", fileno(stream))) {
    stream->_flags |= _IO_ERR_SEEN;
    return failed(EIO), NULL;
  }
  return REAL(fgets)(to, size, stream);
}
#define MMAP(name, offset_type)                                                                \
  void* name(void* at, size_t size, int protection, int flags, int file, offset_type offset) { \
    if (file >= 0 && file_fails(FAULT_MAP, #name, file)) return failed(ENOMEM), MAP_FAILED;    \
    return (void*)syscall(SYS_mmap, at, size, protection, flags, file, offset);                \
  }
MMAP(mmap, off_t)
MMAP(mmap64, off64_t)

/* ---- writing ---- */

ssize_t write(int file, const void* from, size_t size) {
  if (write_fails("write", file, &size)) return failed(ENOSPC);
  return syscall(SYS_write, file, from, size);
}
#define PWRITE(name, offset_type)                                         \
  ssize_t name(int file, const void* from, size_t size, offset_type at) { \
    if (write_fails(#name, file, &size)) return failed(ENOSPC);           \
    return syscall(SYS_pwrite64, file, from, size, at);                   \
  }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)
ssize_t writev(int file, const struct iovec* parts, int count) {
  size_t whole = (size_t)count;
  if (write_fails("writev", file, &whole)) return failed(ENOSPC);
  return syscall(SYS_writev, file, parts, (int)whole);
}
#define PWRITEV(name, offset_type)                                               \
  ssize_t name(int file, const struct iovec* parts, int count, offset_type at) { \
    size_t whole = (size_t)count;                                                \
    if (write_fails(#name, file, &whole)) return failed(ENOSPC);                 \
    return syscall(SYS_pwritev, file, parts, (int)whole, (long)at, 0L);          \
  }
PWRITEV(pwritev, off_t)
PWRITEV(pwritev64, off64_t)
size_t fwrite(const void* from, size_t size, size_t count, FILE* stream) {
  if (write_fails("fwrite", fileno(stream), NULL)) {
    stream->_flags |= _IO_ERR_SEEN;
    return failed(ENOSPC), 0;
  }
  return REAL(fwrite)(from, size, count, stream);
}
int fflush(FILE* stream) {
  if (stream && write_fails("fflush", fileno(stream), NULL)) {
    stream->_flags |= _IO_ERR_SEEN;
    return failed(ENOSPC), EOF;
  }
  return REAL(fflush)(stream);
}
int fclose(FILE* stream) {
  const int fault = is_written(fileno(stream)) && file_fails(FAULT_CLOSE, "fclose", fileno(stream));
  const int result = REAL(fclose)(stream);
  return fault ? failed(EIO), EOF : result;
}
int close(int file) {
  const int fault = is_written(file) && file_fails(FAULT_CLOSE, "close", file);
  const int result = (int)syscall(SYS_close, file);
  return fault ? failed(EIO) : result;
}

int fsync(int file) { return file_fails(FAULT_SYNC, "fsync", file) ? failed(EIO) : (int)syscall(SYS_fsync, file); }
int fdatasync(int file) {
  return file_fails(FAULT_SYNC, "fdatasync", file) ? failed(EIO) : (int)syscall(SYS_fdatasync, file);
}
int ftruncate(int file, off_t size) {
  return file_fails(FAULT_RESIZE, "ftruncate", file) ? failed(ENOSPC) : (int)syscall(SYS_ftruncate, file, size);
}
int ftruncate64(int file, off64_t size) { return ftruncate(file, size); }
int fallocate(int file, int mode, off_t at, off_t size) {
  return file_fails(FAULT_RESIZE, "fallocate", file) ? failed(ENOSPC)
                                                     : (int)syscall(SYS_fallocate, file, mode, at, size);
}
int rename(const char* from, const char* to) {
  if (path_fails(FAULT_RENAME, "rename", to)) return failed(EIO);
  return REAL(rename)(from, to);
}
