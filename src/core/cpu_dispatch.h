#pragma once

/// Chooses, once per process, the kernels compiled for the widest instruction set of this CPU.
///
/// A kernel file is compiled once per instruction set (`doppel_module(... KERNELS ...)`) with DOPPEL_ISA defined as
/// `baseline`, `avx2` or `avx512`, and puts its functions into that namespace:
/// @code
///   // skinning_kernel.h
///   DOPPEL_DECLARE_KERNEL(void, skin_forward, (const SkinParams& p, int64_t begin, int64_t end))
///   // skinning_kernel.cpp
///   namespace doppel::kernels::DOPPEL_ISA {
///   void skin_forward(const SkinParams& p, int64_t begin, int64_t end) { ... }
///   }
///   // caller
///   kernels::skin_forward(params, 0, n);
/// @endcode
/// Kernel files may include only `<cmath>`, `<cstdint>`, `<cstring>`, intrinsics and headers of plain structs.
/// Containers and LibTorch are forbidden, because the linker could share their inline functions with other files.

namespace doppel {

enum class Isa { baseline = 0, avx2 = 1, avx512 = 2 };

/// The instruction set in use: that of the environment variable DOPPEL_ISA (core/isa_choice.h), otherwise the widest.
Isa cpu_isa();
const char* isa_name(Isa isa);

}  // namespace doppel

#if defined(DOPPEL_ISA)
// Inside a kernel file: only its own variant is declared, and no dispatcher is emitted.
#define DOPPEL_DECLARE_KERNEL(result, name, arguments) \
  namespace DOPPEL_ISA {                               \
  result name arguments;                               \
  }
#elif defined(__x86_64__) || defined(_M_X64)
#define DOPPEL_DECLARE_KERNEL(result, name, arguments)                                   \
  namespace baseline {                                                                   \
  result name arguments;                                                                 \
  }                                                                                      \
  namespace avx2 {                                                                       \
  result name arguments;                                                                 \
  }                                                                                      \
  namespace avx512 {                                                                     \
  result name arguments;                                                                 \
  }                                                                                      \
  inline auto* const name = ::doppel::cpu_isa() == ::doppel::Isa::avx512 ? &avx512::name \
                            : ::doppel::cpu_isa() == ::doppel::Isa::avx2 ? &avx2::name   \
                                                                         : &baseline::name;
#else
#define DOPPEL_DECLARE_KERNEL(result, name, arguments) \
  namespace baseline {                                 \
  result name arguments;                               \
  }                                                    \
  inline auto* const name = &baseline::name;
#endif
