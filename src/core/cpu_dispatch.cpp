#include "doppel/core/cpu_dispatch.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

#if defined(__x86_64__) || defined(_M_X64)
#include <cpuid.h>
#endif

namespace doppel {
namespace {

#if defined(__x86_64__) || defined(_M_X64)
/// Clang 14 does not know this feature by name.
bool supports_f16c() {
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  return __get_cpuid(1, &eax, &ebx, &ecx, &edx) != 0 && (ecx & bit_F16C) != 0;
}
#endif

Isa widest_isa() {
#if defined(__x86_64__) || defined(_M_X64)
  // Kernel pointers are set while static objects are constructed, perhaps before the compiler's own detection has run.
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && supports_f16c();
  if (!avx2) return Isa::baseline;
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  return avx512 ? Isa::avx512 : Isa::avx2;
#else
  return Isa::baseline;
#endif
}

Isa chosen_isa() {
  const Isa widest = widest_isa();
  const char* wish = std::getenv("DOPPEL_ISA");
  if (!wish) return widest;
  for (Isa isa : {Isa::baseline, Isa::avx2, Isa::avx512})
    if (isa < widest && std::strcmp(wish, isa_name(isa)) == 0) return isa;
  return widest;
}

}  // namespace

Isa cpu_isa() {
  static const Isa isa = chosen_isa();
  return isa;
}

const char* isa_name(Isa isa) {
  switch (isa) {
    case Isa::avx512:
      return "avx512";
    case Isa::avx2:
      return "avx2";
    default:
      return "baseline";
  }
}

}  // namespace doppel
