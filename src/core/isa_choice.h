#pragma once

namespace doppel {

/// Checks the environment variable DOPPEL_ISA=plain|avx2|avx512, which chooses the kernels (core/cpu_dispatch.h). They
/// are chosen before `main`, where no error can be reported; until this check, a value that it refuses counts as none.
/// @throws UsageError when the value is none of these names, or names an instruction set that this processor lacks
void check_isa();

}  // namespace doppel
