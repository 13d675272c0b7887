#pragma once

#include <nlohmann/json.hpp>

namespace doppel::tools {

/// What a report of an error should name: the versions of Doppel and of the libraries in use, the compiler, the core of
/// OpenBLAS, the instruction set of Doppel's kernels, and the number of threads. All values are strings but `threads`.
nlohmann::ordered_json describe_versions();

}  // namespace doppel::tools
