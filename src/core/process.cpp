#include "doppel/core/process.h"

#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <new>
#include <string_view>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

#include "doppel/core/cpu_dispatch.h"
#include "doppel/core/cpu_quota.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

std::atomic<bool> stop_wanted{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may only touch lock-free atomics");

constexpr int kMaxThreads = 1024;
// About 0.1 ms: the least with which an idle machine is as fast as with the default, 300,000 (docs/benchmarks.md).
constexpr const char* kSpinCount = "3000";
constexpr const char* kBlasTimeout = "12";  // 2^12 cycles; the default is 2^26

extern "C" void on_stop_signal(int signal) {
  if (stop_wanted.exchange(true)) _exit(128 + signal);
}

std::terminate_handler usual_terminate = nullptr;

/// An exception that nothing can catch, such as one in a destructor of a library.
[[noreturn]] void on_terminate() {
  try {
    if (const std::exception_ptr thrown = std::current_exception()) std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    // Formatting a message might need memory.
    constexpr std::string_view text = "doppel: the memory is not enough for this work\n";
    (void)!::write(STDERR_FILENO, text.data(), text.size());
    _exit(1);
  } catch (...) {
    // the usual handler prints it
  }
  if (usual_terminate) usual_terminate();
  std::abort();
}

void keep_freed_memory() {
#if defined(__GLIBC__)
  // glibc allocates blocks above 32 MB with mmap for any M_MMAP_THRESHOLD, and unmaps them when they are freed. Without
  // mmap they come from the heap, which keeps them.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_TOP_PAD, 16 << 20);
#endif
}

}  // namespace

void setup_process() {
  keep_freed_memory();
  usual_terminate = std::set_terminate(on_terminate);
  struct sigaction action = {};
  action.sa_handler = on_stop_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A program started by nohup ignores the end of its terminal, and goes on doing so.
  struct sigaction hang_up = {};
  if (sigaction(SIGHUP, nullptr, &hang_up) == 0 && hang_up.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

void start_tuned(char** argv) {
#if defined(__linux__)
  if (std::getenv("GOMP_SPINCOUNT") || std::getenv("OMP_WAIT_POLICY")) return;
  std::error_code missing;
  // The link itself would do, but the process would then be called "exe".
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", missing);
  if (missing || setenv("GOMP_SPINCOUNT", kSpinCount, 1) != 0) return;
  setenv("OPENBLAS_THREAD_TIMEOUT", kBlasTimeout, 0);
  if (cpu_isa() == Isa::avx512) setenv("OPENBLAS_CORETYPE", "SkylakeX", 0);
  execv(program.c_str(), argv);
#else
  (void)argv;
#endif
}

int resolve_threads(int requested) {
  if (requested < 0 || requested > kMaxThreads) {
    fail<UsageError>(
        "setting the number of threads: found {}; allowed is 0 (OMP_NUM_THREADS, or the cores that the process may "
        "use) to {}",
        requested, kMaxThreads);
  }
  if (requested > 0) return requested;
  const char* environment = std::getenv("OMP_NUM_THREADS");
  const int threads = environment ? std::atoi(environment) : 0;
  return threads > 0 && threads <= kMaxThreads ? threads : available_cores();
}

double private_megabytes() {
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0.0, resident_pages = 0.0, file_pages = 0.0;
  if (!(statm >> total_pages >> resident_pages >> file_pages)) return 0.0;
  return (resident_pages - file_pages) * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "an unknown host";
}

bool stop_requested() { return stop_wanted.load(std::memory_order_relaxed); }
void request_stop(bool value) { stop_wanted.store(value); }

}  // namespace doppel
