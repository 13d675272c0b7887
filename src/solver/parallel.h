#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace doppel {

/// Calls work(first, last) for parts of [0, count), on the threads of the process (`at::set_num_threads`). The parts
/// depend on the number of threads, so the result for one index must not depend on other indices.
void for_parts(std::size_t count, const std::function<void(std::size_t, std::size_t)>& work);

/// The sum of term(i) over [0, count). Its parts and the order of addition do not depend on the number of threads.
double sum_in_order(std::size_t count, const std::function<double(std::size_t, std::size_t)>& sum_of_part);

}  // namespace doppel
