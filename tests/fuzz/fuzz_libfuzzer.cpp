// One target under libFuzzer: DOPPEL_FUZZ_TARGET names it. scripts/fuzz.sh starts it with seeds and dictionary.

#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "doppel/core/log.h"
#include "fuzz/fuzz_target.h"
#include "support/temporary_folder.h"

// Both libraries lose what they have read so far, a few kilobytes, when they refuse a damaged file.
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp.so\nleak:libtorch_cpu.so\n"; }

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  using namespace doppel;
  static const char* name = std::getenv("DOPPEL_FUZZ_TARGET");
  static const fuzz::FuzzTarget& target = fuzz::target_of(name ? name : "");
  static const support::TemporaryFolder folder;
  [[maybe_unused]] static const bool quiet = (setup_logging("off"), true);
  fuzz::run_once(target, {reinterpret_cast<const char*>(data), size}, folder.path());
  return 0;
}
