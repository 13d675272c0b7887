#include "doppel/core/cpu_dispatch.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string>

#if defined(__x86_64__) || defined(_M_X64)
#include <cpuid.h>
#endif

#include "doppel/core/error.h"
#include "doppel/core/isa_choice.h"

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

constexpr std::initializer_list<Isa> kIsas{Isa::baseline, Isa::avx2, Isa::avx512};

/// The instruction set that DOPPEL_ISA names, if this CPU has it.
std::optional<Isa> wished_isa() {
  const char* wish = std::getenv("DOPPEL_ISA");
  for (const Isa isa : kIsas)
    if (wish && isa <= widest_isa() && std::strcmp(wish, isa_name(isa)) == 0) return isa;
  return std::nullopt;
}

}  // namespace

Isa cpu_isa() {
  static const Isa isa = wished_isa().value_or(widest_isa());
  return isa;
}

void check_isa() {
  const char* wish = std::getenv("DOPPEL_ISA");
  if (!wish || wished_isa()) return;
  std::string allowed;
  for (const Isa isa : kIsas)
    if (isa <= widest_isa()) allowed += std::string(allowed.empty() ? "" : ", ") + isa_name(isa);
  fail<UsageError>(
      "choosing the instruction set by the environment variable DOPPEL_ISA: found '{}'; this processor has {}; "
      "without the variable it is the widest",
      wish, allowed);
}

const char* isa_name(Isa isa) {
  switch (isa) {
    case Isa::avx512:
      return "avx512";
    case Isa::avx2:
      return "avx2";
    default:
      return "plain";
  }
}

}  // namespace doppel
