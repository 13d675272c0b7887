#pragma once

/* What the test asks of fault_shim.c, and what the shim counted. Both see it in one shared file, which DOPPEL_FAULTS
   names; the counts survive the death of the process. Plain C, for both languages. */

#ifdef __cplusplus
extern "C" {
#endif

/* NOLINTBEGIN(readability-identifier-naming): C has no scopes for the names of constants */
enum FaultKind {
  FAULT_MEMORY, /* malloc, calloc, realloc, aligned blocks, after main has begun: null, ENOMEM */
  FAULT_MAP,    /* mmap of a file: ENOMEM */
  FAULT_CREATE, /* opening for writing, mkdir: EACCES */
  FAULT_OPEN,   /* opening for reading: EMFILE */
  FAULT_READ,   /* EIO */
  FAULT_WRITE,  /* ENOSPC, once */
  FAULT_FULL,   /* the same calls: ENOSPC from the chosen one on */
  FAULT_SHORT,  /* the same calls without streams: half of the bytes are written */
  FAULT_CLOSE,  /* closing what was opened for writing: EIO */
  FAULT_SYNC,   /* fsync, fdatasync, msync: EIO */
  FAULT_RESIZE, /* ftruncate, fallocate: ENOSPC */
  FAULT_RENAME, /* EIO */
  FAULT_KINDS
};
/* NOLINTEND(readability-identifier-naming) */

struct FaultPlan {
  int kind;                 /* FaultKind */
  long call;                /* the call to fail, counted from 1; 0: none, only count */
  char folder[256];         /* calls on files outside of this folder are neither counted nor failed */
  long counts[FAULT_KINDS]; /* calls so far */
  long failed;              /* calls that were made to fail */
  char failed_call[64];     /* the function's name */
  char failed_path[256];    /* of its file; empty for memory */
};

#ifdef __cplusplus
}
#endif
