// One target under libFuzzer: DOPPEL_FUZZ_TARGET names it. scripts/fuzz.sh starts it with seeds and dictionary.

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "doppel/core/log.h"
#include "fuzz/fuzz_target.h"
#include "support/temporary_folder.h"

// Both libraries lose what they have read so far, a few kilobytes, when they refuse a damaged file.
extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp.so\nleak:libtorch_cpu.so\n"; }

extern "C" std::size_t LLVMFuzzerMutate(unsigned char* data, std::size_t size, std::size_t max_size);

namespace {

const doppel::fuzz::FuzzTarget& wanted_target() {
  static const char* name = std::getenv("DOPPEL_FUZZ_TARGET");
  static const doppel::fuzz::FuzzTarget& target = doppel::fuzz::target_of(name ? name : "");
  return target;
}

void mutate(std::string& bytes, std::size_t max_size) {
  const std::size_t size = bytes.size();
  bytes.resize(std::max(size, max_size));
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<unsigned char*>(bytes.data()), size, bytes.size()));
}

}  // namespace

/// Half of the files of a format that wraps its content are changed inside of the wrapping.
extern "C" std::size_t LLVMFuzzerCustomMutator(unsigned char* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  const doppel::fuzz::Unwrap& unwrap = wanted_target().unwrap;
  std::minstd_rand random(seed);
  auto file = unwrap && random() % 2 == 0 ? unwrap({reinterpret_cast<const char*>(data), size}) : std::nullopt;
  if (!file) return LLVMFuzzerMutate(data, size, max_size);
  mutate(file->parts[random() % file->parts.size()], max_size);
  const std::string bytes = file->wrap(file->parts);
  if (bytes.size() > max_size) return LLVMFuzzerMutate(data, size, max_size);
  std::memcpy(data, bytes.data(), bytes.size());
  return bytes.size();
}

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data, std::size_t size) {
  using namespace doppel;
  const fuzz::FuzzTarget& target = wanted_target();
  static const support::TemporaryFolder folder;
  [[maybe_unused]] static const bool quiet = (setup_logging("off"), true);
  fuzz::run_once(target, {reinterpret_cast<const char*>(data), size}, folder.path());
  return 0;
}
