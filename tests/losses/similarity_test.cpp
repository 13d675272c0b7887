#include "doppel/losses/similarity.h"

#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "support/gradient_check.h"

namespace doppel::similarity_test {
namespace {

using torch::Tensor;

/// Two images that resemble each other, black outside of a rectangle.
std::pair<Tensor, Tensor> two_images(std::int64_t height, std::int64_t width, torch::ScalarType type) {
  auto generator = at::detail::createCPUGenerator(3);
  const Tensor a = torch::rand({2, 1, height, width, 3}, generator, torch::kFloat64);
  const Tensor noise = torch::randn(a.sizes(), generator, torch::kFloat64);
  Tensor inside = torch::zeros({1, 1, height, width, 1}, torch::kFloat64);
  inside.narrow(2, height / 4, height / 2).narrow(3, width / 3, width / 3).fill_(1.0);
  return {(a * inside).to(type), ((a + 0.2 * noise) * inside).to(type)};
}

TEST(SimilarityLoss, EqualImagesHaveNoLoss) {
  const auto [a, b] = two_images(40, 50, torch::kFloat32);
  EXPECT_NEAR(similarity_loss(a, a).item<double>(), 0.0, 1e-6);
  EXPECT_GT(similarity_loss(a, b).item<double>(), 0.01);
  EXPECT_EQ(similarity_loss(torch::zeros_like(a), torch::zeros_like(a)).item<double>(), 0.0);
}

TEST(SimilarityLoss, TwoFlatImages) {  // only the means differ: (2 ab + C1) / (a^2 + b^2 + C1)
  const Tensor a = torch::full({1, 1, 20, 30, 3}, 0.5), b = torch::full({1, 1, 20, 30, 3}, 0.25);
  const double expected = 1.0 - (2 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4);
  EXPECT_NEAR(similarity_loss(a, b).item<double>(), expected, 1e-4);
  EXPECT_NEAR(similarity_loss_reference(a, b).item<double>(), expected, 1e-4);
}

TEST(SimilarityLossKernel, AgreesWithTheReference) {
  for (const auto& [height, width] : {std::pair{11, 11}, {40, 50}, {100, 77}}) {
    const auto [a, b] = two_images(height, width, torch::kFloat32);
    const Tensor found = a.clone().requires_grad_(), expected = a.to(torch::kFloat64).requires_grad_();
    const Tensor loss = similarity_loss(found, b), reference = similarity_loss(expected, b.to(torch::kFloat64));
    EXPECT_NEAR(loss.item<double>(), reference.item<double>(), 1e-6);
    (3.0 * loss).backward();
    (3.0 * reference).backward();
    // A variance is a difference of moments of about 0.3, so float32 knows it to 3e-8, against C2 = 9e-4 at least.
    const double largest = expected.grad().abs().max().item<double>();
    EXPECT_TRUE(test::is_near(found.grad().to(torch::kFloat64), expected.grad(), 1e-4 * largest));
  }
}

TEST(SimilarityLossReference, GradientAgreesWithCentralDifferences) {
  const auto [a, b] = two_images(16, 20, torch::kFloat64);
  const Tensor target = b;
  const auto loss = [&](const std::vector<Tensor>& in) { return similarity_loss(in[0], target); };
  EXPECT_TRUE(test::gradients_match(loss, {{"a", a}}));
}

TEST(SimilarityLossRejects, ImagesThatDoNotFit) {
  const auto [a, b] = two_images(40, 50, torch::kFloat32);
  EXPECT_THROW(similarity_loss(a, b.narrow(2, 0, 30)), UsageError);
  EXPECT_THROW(similarity_loss(a, b.to(torch::kFloat64)), UsageError);
  EXPECT_THROW(similarity_loss(a.narrow(2, 0, 10), b.narrow(2, 0, 10)), UsageError);
}

}  // namespace
}  // namespace doppel::similarity_test
