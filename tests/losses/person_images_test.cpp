#include "doppel/losses/person_images.h"

#include <gtest/gtest.h>

#include "support/gradient_check.h"

namespace doppel::person_images_test {
namespace {

using torch::Tensor;

constexpr std::int64_t kSide = 12;

/// A grey person, whose edge runs through the pixels of column 5, before a studio of random colours.
struct Scene {
  Tensor alpha = torch::zeros({1, 1, kSide, kSide});
  Tensor studio = torch::rand({1, 1, kSide, kSide, 3}, at::detail::createCPUGenerator(1));
  Tensor colour, image, mask;

  explicit Scene(double covered) {
    alpha.narrow(3, 6, 6).fill_(1.0);
    alpha.select(3, 5).fill_(covered);
    colour = alpha.unsqueeze(4) * torch::full({3}, 0.5);
    image = colour + (1.0 - alpha).unsqueeze(4) * studio;
    mask = (alpha >= 0.5).to(torch::kFloat32);
  }
};

TEST(PersonImagesReference, OverTheStudioTheTrueDrawingIsTheImage) {
  for (const double covered : {0.3, 0.5, 0.9}) {
    const Scene scene(covered);
    const PersonImages found = person_over_studio(scene.colour, scene.alpha, scene.image, scene.mask, scene.studio);
    EXPECT_TRUE(test::is_near(found.drawn, found.filmed, 1e-6));
    EXPECT_EQ((found.certain * (scene.alpha - scene.mask).abs()).max().item<double>(), 0.0);
    const std::int64_t first = covered >= 0.5 ? 5 : 6;  // column of the mask
    EXPECT_TRUE(torch::equal(found.filmed.narrow(3, first - 2, 4), scene.image.narrow(3, first - 2, 4)));
    EXPECT_EQ(found.filmed.narrow(3, 0, first - 2).abs().max().item<double>(), 0.0);
    EXPECT_EQ(found.certain.sum().item<double>(), kSide * (kSide - 2));
  }
}

TEST(PersonImagesReference, OverBlackTheTrueDrawingLacksTheStudioAtTheEdge) {
  const Scene scene(0.6);
  const PersonImages found = person_over_black(scene.colour, scene.image, scene.mask);
  const Tensor off = (found.drawn - found.filmed).abs().sum({0, 1, 2, 4});
  EXPECT_GT(off[5].item<double>(), 1.0);
  EXPECT_NEAR(off.sum().item<double>(), off[5].item<double>(), 1e-5);
  EXPECT_TRUE(torch::equal(found.certain, torch::ones_like(scene.mask)));
}

}  // namespace
}  // namespace doppel::person_images_test
