#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// Threads that networks share. One network at a time may run on them.
class NetworkThreads {
 public:
  /// @throws UsageError when `count` is not 1 to 64
  explicit NetworkThreads(int count);
  ~NetworkThreads();
  NetworkThreads(const NetworkThreads&) = delete;
  NetworkThreads& operator=(const NetworkThreads&) = delete;

 private:
  friend class Network;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A network that is ready to run: weights are packed and memory is planned. XNNPACK computes it, in float32, as
/// TensorFlow Lite does on a CPU. The number of threads does not change the results. Not thread-safe.
class Network {
 public:
  /// @param model has one input
  /// @throws FileError when `check_shapes` refuses the model, or XNNPACK does
  Network(const NetworkModel& model, std::shared_ptr<NetworkThreads> threads);
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

}  // namespace doppel
