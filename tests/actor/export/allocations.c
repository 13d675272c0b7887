/* The functions of the heap, as glibc documents them for replacement. A program's own come before those of the C
   library for every shared library of the process, so that LibTorch's and Doppel's calls arrive here too. Unlike
   mallinfo2(), which counts blocks that wait in the caches of threads as in use, the numbers are exact. */
#include "allocations.h"

#include <errno.h>
#include <malloc.h>
#include <stdatomic.h>
#include <stddef.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

/* A sanitizer has a heap of its own. Nothing is counted. */
struct allocations allocations_now(void) {
  return (struct allocations){0, 0, 0};
}

#else

extern void* __libc_malloc(size_t size);
extern void* __libc_calloc(size_t count, size_t size);
extern void* __libc_realloc(void* block, size_t size);
extern void* __libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void* block);

static atomic_long taken, blocks, bytes;

struct allocations allocations_now(void) {
  return (struct allocations){taken, blocks, bytes};
}

static void* count(void* block) {
  if (!block) return block;
  ++taken;
  ++blocks;
  bytes += (long)malloc_usable_size(block);
  return block;
}

static void uncount(void* block) {
  --blocks;
  bytes -= (long)malloc_usable_size(block);
}

void* malloc(size_t size) { return count(__libc_malloc(size)); }
void* calloc(size_t number, size_t size) { return count(__libc_calloc(number, size)); }
void* memalign(size_t alignment, size_t size) { return count(__libc_memalign(alignment, size)); }
void* aligned_alloc(size_t alignment, size_t size) { return memalign(alignment, size); }

void free(void* block) {
  if (block) uncount(block);
  __libc_free(block);
}

void* realloc(void* block, size_t size) {
  const long old = block ? (long)malloc_usable_size(block) : 0;
  void* moved = __libc_realloc(block, size);
  if (!moved && size > 0) return moved; /* the old block stays */
  if (block) {
    --blocks;
    bytes -= old;
  }
  return count(moved);
}

int posix_memalign(void** block, size_t alignment, size_t size) {
  *block = memalign(alignment, size);
  return *block ? 0 : ENOMEM;
}

#endif
