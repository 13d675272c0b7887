#include "doppel/detect/blazepose/network.h"

#include <omp.h>

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/network_edits.h"
#include "doppel/detect/blazepose/network_shapes.h"
#include "doppel/detect/blazepose/network_steps.h"

namespace doppel {

namespace {

constexpr int kMaxNetworkThreads = 64;

/// The number of threads that the calling thread gives to OpenMP, for as long as this lives.
class OpenMpThreads {
 public:
  explicit OpenMpThreads(int count) : before_(omp_get_max_threads()) { omp_set_num_threads(count); }
  ~OpenMpThreads() { omp_set_num_threads(before_); }
  OpenMpThreads(const OpenMpThreads&) = delete;
  OpenMpThreads& operator=(const OpenMpThreads&) = delete;

 private:
  int before_;
};

NetworkSteps plan_checked(const NetworkModel& model) {
  check_shapes(model);
  if (model.inputs.size() != 1)
    fail_at({model.source, 0}, "the network has {} inputs, expected 1", model.inputs.size());
  try {
    return plan_steps(fold_padding(model));
  } catch (const dnnl::error& e) {
    fail_at({model.source, 0}, "oneDNN cannot compute this network ({})", e.what());
  }
}

std::span<float> numbers_of(const dnnl::memory& memory, const TensorShape& shape) {
  return {static_cast<float*>(memory.get_data_handle()), as_size(num_elements(shape))};
}

}  // namespace

struct Network::Impl {
  std::string source;
  int threads = 1;
  TensorShape input_shape;
  std::vector<TensorShape> output_shapes;
  NetworkSteps plan;
};

Network::Network(const NetworkModel& model, int threads) : impl_(std::make_unique<Impl>()) {
  if (threads < 1 || threads > kMaxNetworkThreads)
    fail<UsageError>("starting the threads of a network: found {}; allowed is 1 to {}", threads, kMaxNetworkThreads);
  const OpenMpThreads scope(threads);
  impl_->source = model.source;
  impl_->threads = threads;
  impl_->plan = plan_checked(model);
  impl_->input_shape = model.tensors[model.inputs[0]].shape;
  for (const int output : model.outputs) impl_->output_shapes.push_back(model.tensors[output].shape);
}

Network::~Network() = default;
Network::Network(Network&&) noexcept = default;
Network& Network::operator=(Network&&) noexcept = default;

const TensorShape& Network::output_shape(std::size_t index) const { return impl_->output_shapes.at(index); }

std::span<float> Network::input() { return numbers_of(impl_->plan.input, impl_->input_shape); }

void Network::run() {
  const OpenMpThreads scope(impl_->threads);
  NetworkSteps& plan = impl_->plan;
  try {
    for (const NetworkSteps::Step& step : plan.steps) step.primitive.execute(plan.stream, step.arguments);
    plan.stream.wait();
  } catch (const dnnl::error& e) {
    fail_at({impl_->source, 0}, "running the network failed inside oneDNN ({})", e.what());
  }
}

std::span<const float> Network::output(std::size_t index) const {
  return numbers_of(impl_->plan.outputs.at(index), output_shape(index));
}

bool all_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

}  // namespace doppel
