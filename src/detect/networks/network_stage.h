#pragma once

#include <memory>

#include "doppel/detect/networks/image_network.h"
#include "doppel/detect/networks/output_choice.h"

namespace doppel {

/// A network with the adapter of its outputs, which is chosen when the network first runs.
class NetworkStage {
 public:
  /// @throws as ImageNetwork
  NetworkStage(const NetworkOptions& options, const Wanted& wanted);

  const NetworkOptions& options() const { return network_.options(); }
  /// @throws as ImageNetwork::run; Error naming the file when the outputs do not have the form wanted
  NetworkResult run(const cv::Mat& image, const NetworkView& view);

 private:
  ImageNetwork network_;
  Wanted wanted_;
  std::unique_ptr<OutputAdapter> adapter_;
};

}  // namespace doppel
