#include "doppel/detect/blazepose/network_model.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace doppel {

const std::map<std::string, NetworkOp>& network_operators() {
  static const std::map<std::string, NetworkOp> operators = {{"ADD", NetworkOp::add},
                                                             {"CONCATENATION", NetworkOp::concatenation},
                                                             {"CONV_2D", NetworkOp::conv_2d},
                                                             {"DEPTHWISE_CONV_2D", NetworkOp::depthwise_conv_2d},
                                                             {"DEPTH_TO_SPACE", NetworkOp::depth_to_space},
                                                             {"FULLY_CONNECTED", NetworkOp::fully_connected},
                                                             {"LOGISTIC", NetworkOp::logistic},
                                                             {"MAX_POOL_2D", NetworkOp::max_pool_2d},
                                                             {"MEAN", NetworkOp::mean},
                                                             {"PAD", NetworkOp::pad},
                                                             {"PRELU", NetworkOp::prelu},
                                                             {"RESHAPE", NetworkOp::reshape},
                                                             {"RESIZE_BILINEAR", NetworkOp::resize_bilinear}};
  return operators;
}

std::int64_t num_elements(const TensorShape& shape) {
  std::int64_t count = 1;
  for (const std::int64_t side : shape) count *= side;
  return count;
}

std::string to_string(const TensorShape& shape) {
  return shape.empty() ? "1" : fmt::format("{}", fmt::join(shape, "x"));
}

std::string to_string(NetworkOp op) {
  for (const auto& [name, known] : network_operators()) {
    if (known == op) return name;
  }
  return "unknown";
}

}  // namespace doppel
