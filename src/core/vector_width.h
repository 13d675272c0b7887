#pragma once

/// For kernel files only (see cpu_dispatch.h): the vector width of the instruction set that a file is compiled for.

namespace doppel::kernels::DOPPEL_ISA {

#if defined(__AVX512F__)
constexpr int kVectorBytes = 64;
#elif defined(__AVX2__)
constexpr int kVectorBytes = 32;
#else
constexpr int kVectorBytes = 16;
#endif

}  // namespace doppel::kernels::DOPPEL_ISA
