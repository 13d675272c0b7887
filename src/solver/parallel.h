#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace doppel {

/// Calls work(first, last) for parts of [0, count), on the threads that the process uses (`at::set_num_threads`).
/// Where the cuts are depends on the number of threads: what is worked out for one index must not depend on others.
void for_parts(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work);

/// The sum of term(i) over [0, count), cut and added up in the same way whatever the number of threads.
double sum_in_order(std::size_t count, const std::function<double(std::size_t, std::size_t)>& sum_of_part);

}  // namespace doppel
