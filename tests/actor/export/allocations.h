/* Counts the memory that all libraries of a process take from the heap. */
#ifndef DOPPEL_TESTS_EXPORT_ALLOCATIONS_H
#define DOPPEL_TESTS_EXPORT_ALLOCATIONS_H

/* All numbers are sums over all threads since the process began. */
struct allocations {
  long taken;  /* blocks taken; a block that changes its size counts as one more */
  long blocks; /* blocks in use */
  long bytes;  /* bytes in use */
};

struct allocations allocations_now(void);

#endif
