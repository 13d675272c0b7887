#include "doppel/detect/networks/network_stage.h"

#include "doppel/core/error.h"

namespace doppel {

NetworkStage::NetworkStage(const NetworkOptions& options, const Wanted& wanted) : network_(options), wanted_(wanted) {}

NetworkResult NetworkStage::run(const cv::Mat& image, const NetworkView& view) {
  const std::vector<NetworkOutput> outputs = network_.run(network_input(image, view, options()));
  try {
    if (!adapter_) adapter_ = choose_adapter(options(), wanted_, outputs, view.input);
    return adapter_->read(outputs, view.input);
  } catch (const Error& e) {
    fail("{}: {}", network_.files(), e.what());
  }
}

}  // namespace doppel
