#pragma once

#include <ATen/Parallel.h>

#include <algorithm>

namespace doppel {

/// Reduces the process's threads by one in its scope, to leave a core to the thread that reads images. Two threads on
/// one core would wait for each other.
class OneThreadFewer {
 public:
  OneThreadFewer() : before_(at::get_num_threads()) { at::set_num_threads(std::max(1, before_ - 1)); }
  ~OneThreadFewer() { at::set_num_threads(before_); }
  OneThreadFewer(const OneThreadFewer&) = delete;
  OneThreadFewer& operator=(const OneThreadFewer&) = delete;

 private:
  int before_;
};

}  // namespace doppel
