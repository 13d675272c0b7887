#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// A network that is ready to run: weights are packed and memory is planned. oneDNN computes it, in float32. The number
/// of threads does not change the results. Not thread-safe.
class Network {
 public:
  /// @param model has one input @param threads of OpenMP that `run` uses
  /// @throws FileError when `check_shapes` refuses the model, or oneDNN does; UsageError when `threads` is not 1 to 64
  explicit Network(const NetworkModel& model, int threads = 1);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;
  Network(Network&&) noexcept;
  Network& operator=(Network&&) noexcept;

  const TensorShape& output_shape(std::size_t index) const;

  /// The input, [1, height, width, channels]: fill it before `run`.
  std::span<float> input();
  void run();
  /// An output of the last run, in the order of the file.
  std::span<const float> output(std::size_t index) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether all numbers of an output are finite.
bool all_finite(std::span<const float> values);

}  // namespace doppel
