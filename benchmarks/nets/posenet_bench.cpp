/// What a frame of PoseNet and DefNet costs, how much of it is layers, and whether another memory layout would help.
///   posenet_bench [threads] [CHARACTER]

#include <cstdio>
#include <cstdlib>

#include "doppel/layers/surface.h"
#include "doppel/nets/def_net.h"
#include "doppel/nets/pose_capture.h"
#include "support/ratio.h"
#include "support/test_character.h"

namespace {

using torch::Tensor;

/// A person 3 m in front of a camera.
doppel::PersonView view_of(int64_t size, int64_t landmarks) {
  doppel::PersonView view;
  view.image = torch::randn({1, 3, size, size}, at::detail::createCPUGenerator(1));
  view.camera_rotation = torch::tensor({{{1.0f, 0.0f, 0.0f}, {0.0f, -1.0f, 0.0f}, {0.0f, 0.0f, -1.0f}}});
  const Tensor projection = torch::tensor(
      {{{{600.0, 0.0, -256.0, 768.0}, {0.0, -600.0, -256.0, 768.0}, {0.0, 0.0, -1.0, 3.0}}}}, torch::kFloat64);
  Tensor keypoints = 512.0 * torch::rand({1, 1, landmarks, 3}, at::detail::createCPUGenerator(2), torch::kFloat64);
  keypoints.select(-1, 2).fill_(0.9);
  view.rays = doppel::keypoint_rays(keypoints, projection, torch::tensor({{{0.0, 0.0, 3.0}}}, torch::kFloat64));
  return view;
}

void frame(const doppel::Character& character, doppel::ResNetKind kind, int64_t size) {
  const torch::NoGradGuard no_grad;
  std::vector<doppel::Marker> markers;
  for (int m = 0; m < 21; ++m) markers.push_back({"", m % character.skeleton.num_joints(), {0.0, 0.05, 0.0}, 0.0});
  doppel::PoseNetConfig backbone;
  backbone.kind = kind;
  backbone.input_size = static_cast<int>(size);
  const doppel::PoseDofs pose(character.skeleton, {}, character.rest_dofs);
  doppel::PoseNet posenet(pose, backbone);
  doppel::DefNet defnet(character.num_nodes(), backbone);
  posenet->eval();
  defnet->eval();
  const doppel::Landmarks landmarks(character.skeleton, markers);
  doppel::CharacterSurface surface(character);
  const doppel::PersonView view = view_of(size, 21);
  const auto [theta, alpha] = posenet->forward(view.image);
  const auto [A, T] = defnet->forward(view.image);
  const auto layers = [&, theta = theta, alpha = alpha, A = A, T = T] {
    const Tensor rotation = doppel::root_in_world(alpha, view.camera_rotation);
    const Tensor points = doppel::turn_points(rotation, landmarks->forward(pose.root_relative(theta)));
    const Tensor position = doppel::global_alignment(points, view.rays).translation;
    return surface->deformed(pose.dofs(theta, rotation, position), A, T);
  };
  char title[160];
  std::snprintf(title, sizeof(title), "A frame, ResNet-%d, %lld x %lld, N %d, %d threads",
                kind == doppel::ResNetKind::resnet18 ? 18 : 50, static_cast<long long>(size),
                static_cast<long long>(size), character.num_vertices(), at::get_num_threads());
  doppel::bench::compare(title,
                         {{"layers: landmarks, alignment, surface", [&] { layers(); }}, {"both networks", [&] {
                                                                                           posenet->forward(view.image);
                                                                                           defnet->forward(view.image);
                                                                                         }}});
}

void layouts(doppel::ResNetKind kind, int64_t batch, int64_t size) {
  const auto make = [&](at::MemoryFormat format) {
    doppel::ResNet net(kind, at::detail::createCPUGenerator(1));
    for (Tensor& parameter : net->parameters())
      if (parameter.dim() == 4) parameter.set_data(parameter.detach().contiguous(format));
    return net;
  };
  doppel::ResNet planes = make(at::MemoryFormat::Contiguous), last = make(at::MemoryFormat::ChannelsLast);
  const Tensor image = torch::randn({batch, 3, size, size}, at::detail::createCPUGenerator(2));
  const Tensor image_last = image.contiguous(at::MemoryFormat::ChannelsLast);
  const auto step = [](doppel::ResNet& net, const Tensor& input) {
    torch::autograd::grad({net->forward(input).square().sum()}, net->parameters());
  };
  doppel::bench::RatioOptions options;
  options.turns = 9;
  char title[160];
  std::snprintf(title, sizeof(title), "A training step, ResNet-%d, batch %lld of %lld x %lld, %d threads",
                kind == doppel::ResNetKind::resnet18 ? 18 : 50, static_cast<long long>(batch),
                static_cast<long long>(size), static_cast<long long>(size), at::get_num_threads());
  doppel::bench::compare(
      title, {{"channels last", [&] { step(last, image_last); }}, {"channels first", [&] { step(planes, image); }}},
      options);
}

}  // namespace

int main(int argc, char** argv) {
  at::set_num_threads(argc > 1 ? std::atoi(argv[1]) : 2);
  const doppel::Character character =
      argc > 2 ? doppel::load_character(argv[2]) : doppel::make_test_character(20, 53, 104);
  frame(character, doppel::ResNetKind::resnet18, 128);
  frame(character, doppel::ResNetKind::resnet50, 256);
  layouts(doppel::ResNetKind::resnet18, 8, 128);
  layouts(doppel::ResNetKind::resnet50, 2, 256);
  return 0;
}
