#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/losses/anchor.h"
#include "doppel/losses/chamfer.h"
#include "doppel/losses/isometry.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::refinement_losses_test {
namespace {

using support::message_of;
using namespace test;
using torch::Tensor;

Tensor random_points(int64_t count, uint64_t seed) {
  return torch::rand({count, 3}, at::detail::createCPUGenerator(seed), torch::kFloat64);
}

/// The loss where all normals agree.
Tensor loss_of(const Tensor& vertices, const Tensor& cloud, const Tensor& visible = {}, double threshold = 0.04) {
  const Tensor up = torch::tensor({{0.0, 0.0, 1.0}}, torch::kFloat64);
  ChamferOptions options;
  options.threshold = threshold;
  return chamfer_loss(vertices, up.expand_as(vertices), {cloud, up.expand_as(cloud)}, visible, options);
}

/// Every pair looked at.
double chamfer_by_hand(const Tensor& vertices, const Tensor& cloud, const Tensor& visible, double threshold) {
  const Tensor squared = (vertices.unsqueeze(1) - cloud.unsqueeze(0)).square().sum(2);
  const auto mean = [&](const Tensor& least) {
    return (least * (least <= threshold * threshold).to(torch::kFloat64)).mean().item<double>();
  };
  const Tensor shown = squared.index_select(0, visible.nonzero().squeeze(1));
  return mean(shown.amin(1)) + mean(shown.amin(0));
}

TEST(AnchorLoss, ByHand) {
  const Tensor anchors = random_points(6, 7).view({2, 3, 3});
  const Tensor offsets = torch::tensor({{1.0, 2.0, 2.0}, {0.0, 0.0, 3.0}, {0.0, 0.0, 0.0}}, torch::kFloat64);
  EXPECT_NEAR(anchor_loss(anchors + offsets, anchors).item<double>(), (9.0 + 9.0 + 0.0) / 3.0, 1e-12);
}

TEST(ChamferLoss, EqualsAllPairs) {
  const Tensor vertices = random_points(80, 1), cloud = random_points(150, 2);
  Tensor visible = torch::ones({80}, torch::kBool);
  for (double threshold : {0.04, 0.12, 10.0}) {
    EXPECT_NEAR(loss_of(vertices, cloud, {}, threshold).item<double>(),
                chamfer_by_hand(vertices, cloud, visible, threshold), 1e-12);
  }
  visible.slice(0, 0, 50).fill_(false);
  EXPECT_NEAR(loss_of(vertices, cloud, visible, 0.12).item<double>(), chamfer_by_hand(vertices, cloud, visible, 0.12),
              1e-12);
}

// A cloud 1 cm before a plane: both directions 1e-4. Points farther than the threshold count 0, but count.
TEST(ChamferLoss, OfParallelPlanes) {
  const Tensor plane = random_points(60, 3) * torch::tensor({1.0, 1.0, 0.0}, torch::kFloat64);
  Tensor cloud = plane.clone();
  cloud.select(1, 2) += 0.01;
  EXPECT_NEAR(loss_of(plane, cloud).item<double>(), 2e-4, 1e-12);
  cloud.slice(0, 0, 30).select(1, 2) += 1.0;
  const double both = loss_of(plane, cloud).item<double>();
  // Nothing of the surface is seen: nothing to compare with.
  EXPECT_EQ(loss_of(plane, cloud.slice(0, 30), torch::zeros({60}, torch::kBool)).item<double>(), 0.0);
  EXPECT_LT(both, 2e-4);
}

// A sheet of which the cloud shows the side that looks away: what is near, but of the other side, does not pull.
TEST(ChamferLoss, SidesThatLookAwayDoNotPull) {
  const Tensor sheet = random_points(60, 3) * torch::tensor({1.0, 1.0, 0.0}, torch::kFloat64);
  const Tensor cloud = sheet + torch::tensor({0.0, 0.0, 0.01}, torch::kFloat64);
  const auto normals = [](double angle) {
    return torch::tensor({{std::sin(angle), 0.0, std::cos(angle)}}, torch::kFloat64).expand({60, 3});
  };
  const auto loss = [&](double angle) {
    return chamfer_loss(sheet, normals(0.0), {cloud, normals(angle)}).item<double>();
  };
  EXPECT_NEAR(loss(0.9), 2e-4, 1e-12);
  EXPECT_EQ(loss(1.2), 0.0);
  EXPECT_EQ(loss(M_PI), 0.0);
}

TEST(ChamferLoss, Gradients) {
  const Tensor vertices = random_points(30, 4), cloud = random_points(40, 5);
  const Tensor visible = random_points(30, 6).select(1, 0) > 0.3;
  EXPECT_TRUE(gradients_match([&](const std::vector<Tensor>& in) { return loss_of(in[0], cloud, visible, 0.3); },
                              {{"vertices", vertices}}));
}

TEST(ChamferLoss, WithoutPointsAndRejections) {
  Tensor vertices = random_points(5, 7).requires_grad_();
  const Tensor loss = loss_of(vertices, torch::zeros({0, 3}, torch::kFloat64));
  loss.backward();
  EXPECT_EQ(loss.item<double>(), 0.0);
  EXPECT_EQ(vertices.grad().abs().max().item<double>(), 0.0);
  const Tensor broken = torch::full({2, 3}, NAN, torch::kFloat64);
  EXPECT_THAT(message_of<UsageError>([&] { loss_of(vertices, broken); }), testing::HasSubstr("not finite"));
  EXPECT_THAT(message_of<UsageError>([&] { loss_of(vertices, random_points(3, 1), torch::ones({5})); }),
              testing::HasSubstr("visible must be bool [N] = [5]"));
}

TEST(PointCloud, OfRaysThatSawASurface) {
  const RaySamples samples =
      sample_cells(torch::full({2}, 3.96, torch::kFloat64), torch::full({2}, 4.04, torch::kFloat64), 65);
  Tensor density = torch::zeros({2, 65}, torch::kFloat64);
  density[0][32] = 1e5;
  density[1][32] = 10.0;  // a haze
  const RenderedRays seen = render_volume(density, torch::zeros({2, 65, 3}, torch::kFloat64), samples);
  const Tensor direction = torch::tensor({{0.0, 0.6, 0.8}, {0.0, 0.0, 1.0}}, torch::kFloat64);
  const Tensor cloud = point_cloud(seen, torch::tensor({1.0, 0.0, 0.0}, torch::kFloat64), direction);
  EXPECT_TRUE(is_near(cloud, torch::tensor({{1.0, 2.4, 3.2}}, torch::kFloat64), 1e-9));
}

const MeshTopology& path_of_three() {
  static const MeshTopology topology(3, {{0, 1}, {1, 2}});
  return topology;
}

TEST(IsometryLoss, ByHand) {
  const Tensor rest = torch::tensor({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {1.0, 2.0, 0.0}}, torch::kFloat64);
  const EdgeLengths edges(path_of_three(), rest);
  const Tensor turned = torch::tensor({{0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 1.0, 2.0}}, torch::kFloat64);
  const Tensor longer = torch::tensor({{0.0, 0.0, 0.0}, {3.0, 0.0, 0.0}, {3.0, 1.0, 0.0}}, torch::kFloat64);
  EXPECT_NEAR(isometry_loss(turned.unsqueeze(0), edges).item<double>(), 0.0, 1e-15);
  EXPECT_NEAR(isometry_loss(torch::stack({turned, longer}), edges).item<double>(), (4.0 + 1.0) / 4.0, 1e-12);
  EXPECT_NEAR(isometry_loss(longer.unsqueeze(0).to(torch::kFloat32), edges).item<double>(), 2.5, 1e-6);
}

TEST(IsometryLoss, Gradients) {
  const EdgeLengths edges(path_of_three(), random_points(3, 8));
  EXPECT_TRUE(gradients_match([&](const std::vector<Tensor>& in) { return isometry_loss(in[0], edges); },
                              {{"vertices", random_points(6, 9).view({2, 3, 3})}}));
  Tensor folded = torch::zeros({1, 3, 3}).requires_grad_();
  isometry_loss(folded, edges).backward();
  EXPECT_EQ(folded.grad().abs().max().item<float>(), 0.0f);
  EXPECT_EQ(isometry_loss(torch::zeros({0, 3, 3}), edges).item<float>(), 0.0f);
  EXPECT_THAT(message_of<UsageError>([&] {
                isometry_loss(torch::zeros({1, 4, 3}), edges);
              }),
              testing::HasSubstr("vertices must be"));
}

}  // namespace
}  // namespace doppel::refinement_losses_test
