#pragma once

namespace doppel {

/// Sets up the process for numeric work, once, at the start of `main`.
/// - keeps large freed blocks in the process instead of giving them back to the system: a fresh 40 MB tensor costs
///   more in page faults than most kernels cost in arithmetic;
/// - makes Ctrl-C and SIGTERM a request that `stop_requested` reports; a second one ends the process at once.
void setup_process();

/// The number of threads to use: `requested`, or all cores of this machine when it is 0.
/// @throws UsageError when negative or above 1024.
int resolve_threads(int requested);

/// Main memory that the process itself holds now, in megabytes (2^20 bytes), without the pages of mapped files: those
/// the system takes back when it likes. 0 where the system does not say (it does on Linux).
double private_megabytes();

/// True once Ctrl-C or SIGTERM came in. Long jobs look here between steps, write a checkpoint and return.
bool stop_requested();
/// Asks for a stop as Ctrl-C would (for tests).
void request_stop(bool stop = true);

}  // namespace doppel
