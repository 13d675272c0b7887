#pragma once

#include <string>

namespace doppel {

/// Sets up the process for numeric work. Call it once, at the start of `main`.
/// - The process keeps large freed blocks instead of returning them to the system: the page faults of a new 40 MB
///   tensor cost more than the arithmetic of most kernels.
/// - A lack of memory that nothing can catch, say in a library's thread, is a sentence and exit code 1.
/// - Ctrl-C, SIGTERM and SIGHUP (unless nohup) are requests for `stop_requested`; a second ends the process at once.
void setup_process();

/// Starts the program once more, with environment variables set that libraries read while they are loaded, which is
/// before `main`. Call it first in `main`, before there are threads or open files. Returns where GOMP_SPINCOUNT or
/// OMP_WAIT_POLICY is set already, and where the system refuses; the program then runs on as it is.
/// - GOMP_SPINCOUNT: by default, waiting threads of OpenMP spin for milliseconds. Beside other work they hold the cores
///   that the threads they wait for need.
/// - OPENBLAS_THREAD_TIMEOUT, unless it is set already: the same for the threads of OpenBLAS, which yield in a loop.
/// - OPENBLAS_CORETYPE, with AVX-512 and unless it is set already: OpenBLAS 0.3.21 knows no AMD processor with AVX-512,
///   and multiplies matrices with AVX2 there.
void start_tuned(char** argv);

/// The number of threads to use. `requested` 0 stands for the environment variable OMP_NUM_THREADS or, where this is
/// not a number from 1 to 1024, for the number of cores that the process may use (core/cpu_quota.h).
/// @throws UsageError when `requested` is negative or above 1024
int resolve_threads(int requested);

/// Main memory that the process itself holds now, in megabytes (2^20 bytes). Pages of mapped files are not counted,
/// because the system can reclaim them. 0 on systems that do not report it; Linux does.
double private_megabytes();

/// The name of the machine, as `uname -n` prints it; "an unknown host" if the system does not tell.
std::string host_name();

/// True after Ctrl-C, SIGTERM or SIGHUP. Long jobs test it between steps, write a checkpoint and return.
bool stop_requested();
/// Requests a stop as Ctrl-C does, for tests.
void request_stop(bool stop = true);

}  // namespace doppel
