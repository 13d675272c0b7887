#pragma once

#include <dnnl.hpp>
#include <unordered_map>
#include <vector>

#include "doppel/detect/blazepose/network_model.h"

namespace doppel {

/// A network as primitives of oneDNN that run one after the other.
struct NetworkSteps {
  struct Step {
    dnnl::primitive primitive;
    std::unordered_map<int, dnnl::memory> arguments;
  };
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  std::vector<Step> steps;
  dnnl::memory input;                 ///< in the order of the model's shape
  std::vector<dnnl::memory> outputs;  ///< the same
  std::vector<dnnl::memory> blocks;   ///< where results between steps lie
};

/// Chooses primitives and layouts, packs the weights and plans the memory: later results take that of results which are
/// no longer read.
/// @param model for which `check_shapes` holds, with one input @throws FileError when oneDNN refuses a step
NetworkSteps plan_steps(const NetworkModel& model);

}  // namespace doppel
