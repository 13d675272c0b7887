// TexNet: a texture at inference and a training step, for both ways of upsampling and both memory layouts.
//
//   texnet_bench [threads] [size] [width] [batch]

#include <ATen/Parallel.h>
#include <torch/types.h>
#include <torch/utils.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "doppel/nets/tex_net.h"
#include "support/ratio.h"

namespace {

using doppel::TexNet;
using torch::Tensor;

double first_call_ms(const std::function<void()>& run) {
  const auto start = std::chrono::steady_clock::now();
  run();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

/// The channels of the normals, then the six of the camera.
doppel::TexNetInput split(const Tensor& channels) {
  return {channels.narrow(1, 0, channels.size(1) - 6), channels.narrow(1, channels.size(1) - 6, 6)};
}

struct Form {
  const char* name;
  doppel::Upsampling upsample;
  bool channels_last;
};

TexNet make_net(const doppel::TexNetConfig& base, const Form& form) {
  doppel::TexNetConfig config = base;
  config.unet.upsample = form.upsample;
  TexNet net(config);
  if (form.channels_last)
    for (Tensor& parameter : net->parameters())
      if (parameter.dim() == 4) parameter.set_data(parameter.contiguous(at::MemoryFormat::ChannelsLast));
  return net;
}

void run(int size, double width, int64_t batch) {
  doppel::TexNetConfig config;
  config.size = size;
  config.unet.width = width;
  const Tensor plain = torch::randn({batch, 15, size, size}, at::detail::createCPUGenerator(1));
  auto generator = at::detail::createCPUGenerator(2);
  std::vector<doppel::bench::Candidate> training, inference;
  for (const Form& form : {Form{"bilinear_conv, channels last", doppel::Upsampling::bilinear_conv, true},
                           Form{"bilinear_conv", doppel::Upsampling::bilinear_conv, false},
                           Form{"transposed, channels last", doppel::Upsampling::transposed, true},
                           Form{"transposed", doppel::Upsampling::transposed, false}}) {
    TexNet net = make_net(config, form);
    const Tensor input = form.channels_last ? plain.contiguous(at::MemoryFormat::ChannelsLast) : plain;
    const auto step = [=]() mutable {
      net->train();
      net->zero_grad();
      net->forward(split(input), generator).sum().backward();
    };
    TexNet trained = make_net(config, form);
    trained->eval();
    for (Tensor& parameter : trained->parameters()) parameter.set_requires_grad(false);
    const auto infer = [=]() mutable { trained->forward(split(input.narrow(0, 0, 1))); };
    std::printf("%s: first training step %.0f ms, ", form.name, first_call_ms(step));
    std::printf("first texture %.0f ms\n", first_call_ms(infer));
    training.push_back({form.name, step});
    inference.push_back({form.name, infer});
    if (form.channels_last) continue;
    // Without gradients the layers run as image_convolution.
    inference.push_back(
        {form.upsample == doppel::Upsampling::transposed ? "transposed, kernels" : "bilinear_conv, kernels",
         [=]() mutable {
           torch::NoGradGuard no_grad;
           trained->forward(split(input.narrow(0, 0, 1)));
         }});
  }
  doppel::bench::RatioOptions options;
  options.turns = 5;
  options.warm_up = 1;
  char title[120];
  std::snprintf(title, sizeof(title), "TexNet %d, width %g, %d threads: ", size, width, at::get_num_threads());
  doppel::bench::compare(std::string(title) + "training, batch " + std::to_string(batch), training, options);
  doppel::bench::compare(std::string(title) + "one texture", inference, options);
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  run(argc > 2 ? std::atoi(argv[2]) : 256, argc > 3 ? std::atof(argv[3]) : 0.5, argc > 4 ? std::atoi(argv[4]) : 2);
  return 0;
}
