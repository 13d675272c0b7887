#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/losses/chroma.h"
#include "doppel/losses/images.h"
#include "doppel/losses/lighting.h"
#include "doppel/losses/photometric.h"
#include "support/gradient_check.h"
#include "support/message_of.h"

namespace doppel::image_losses_test {
namespace {

using support::message_of;
using namespace test;
using ::testing::HasSubstr;
using torch::Tensor;

/// Two images with a disc drawn and a rectangle of foreground, in [B,C,H,W,3].
struct Images {
  Tensor rendered, covered, target, mask;
};

Images images(int64_t B, int64_t C, int64_t H, int64_t W, uint64_t seed = 3, torch::ScalarType type = torch::kFloat64) {
  auto generator = at::detail::createCPUGenerator(seed);
  Images p;
  const Tensor y = torch::arange(H, torch::kFloat64).view({H, 1}) - 0.5 * H,
               x = torch::arange(W, torch::kFloat64) - 0.45 * W;
  p.covered = (x.square() + y.square() < 0.16 * H * W).expand({B, C, H, W}).contiguous();
  p.mask = torch::zeros({B, C, H, W}, torch::kUInt8);
  p.mask.slice(2, H / 5, H - H / 6).slice(3, W / 4, W - W / 8).fill_(1);
  p.rendered = torch::rand({B, C, H, W, 3}, generator, torch::kFloat64) * p.covered.unsqueeze(-1);
  p.target = torch::rand({B, C, H, W, 3}, generator, torch::kFloat64);
  p.rendered = p.rendered.to(torch::kFloat32).to(type);  // the same numbers in both types
  p.target = p.target.to(torch::kFloat32).to(type);
  return p;
}

using Loss = Tensor (*)(const Images&);
Tensor chroma(const Images& p) { return chroma_loss(p.rendered, p.covered, p.target, p.mask); }
Tensor chroma_plain(const Images& p) { return chroma_loss(p.rendered, p.covered, p.target, p.mask, {0.0, 1}); }
Tensor chroma_wide(const Images& p) { return chroma_loss(p.rendered, p.covered, p.target, p.mask, {1.7, 4}); }
Tensor lighting(const Images& p) { return lighting_loss(p.rendered, p.covered, p.target, p.mask); }
Tensor photometric(const Images& p) { return photometric_loss(p.rendered, p.covered, p.target, p.mask); }
Tensor photometric_squares(const Images& p) {
  return photometric_loss(p.rendered, p.covered, p.target, p.mask, {0, true});
}
const std::vector<std::pair<std::string, Loss>> kLosses{{"chroma", chroma},
                                                        {"chroma without smoothing", chroma_plain},
                                                        {"chroma, wide smoothing", chroma_wide},
                                                        {"lighting", lighting},
                                                        {"photometric", photometric},
                                                        {"photometric squares", photometric_squares}};

/// One view of `size` squared in one colour each, everything covered and foreground.
Images plain_images(int64_t size, const std::vector<double>& rendered, const std::vector<double>& target) {
  Images p;
  p.rendered = torch::tensor(rendered, torch::kFloat64).expand({1, 1, size, size, 3}).contiguous();
  p.target = torch::tensor(target, torch::kFloat64).expand({1, 1, size, size, 3}).contiguous();
  p.covered = torch::ones({1, 1, size, size}, torch::kBool);
  p.mask = torch::ones({1, 1, size, size}, torch::kUInt8);
  return p;
}

Images single(const Images& p) {
  return {p.rendered.to(torch::kFloat32), p.covered, p.target.to(torch::kFloat32), p.mask};
}

void expect_both(Loss loss, const Images& p, double expected) {
  EXPECT_NEAR(loss(p).item<double>(), expected, 1e-9 * std::abs(expected));
  EXPECT_NEAR(loss(single(p)).item<double>(), expected, 1e-5 * std::abs(expected));
}

// U of blue is 0.43601035, so U' runs from 1/2 to 1; V of red likewise.
TEST(ChromaReference, PureColoursByHand) {
  const double u_blue = 0.5, v_blue = -0.10001026 / (2 * 0.61497538);
  expect_both(chroma_plain, plain_images(4, {0, 0, 1}, {0, 0, 0}),
              0.5 * 255 * 255 * (u_blue * u_blue + v_blue * v_blue) / 2);
  const double u_red = -0.14714119 / (2 * 0.43601035), v_red = 0.5;
  expect_both(chroma_plain, plain_images(4, {0.25, 0, 0}, {0.75, 0, 0}),
              0.5 * 0.25 * 255 * 255 * (u_red * u_red + v_red * v_red) / 2);
}

TEST(ChromaReference, GreyIsInvisible) {
  const Images p = plain_images(5, {0.9, 0.9, 0.9}, {0.2, 0.2, 0.2});
  EXPECT_NEAR(chroma(p).item<double>(), 0.0, 1e-12);
  EXPECT_GT(lighting(p).item<double>(), 1.0);
}

// A single pixel of difference, smoothed: the sum of squares of the window's taps remains.
TEST(ChromaReference, SmoothingByHand) {
  Images p = plain_images(9, {0, 0, 0}, {0, 0, 0});
  p.rendered.select(2, 4).select(2, 4).select(2, 2).fill_(1.0);
  const double side = std::exp(-0.5), middle = 1 / (1 + 2 * side), edge = side / (1 + 2 * side);
  const double kept = std::pow(middle * middle + 2 * edge * edge, 2);
  const double v = -0.10001026 / (2 * 0.61497538);
  expect_both(chroma, p, kept * 0.5 * 255 * 255 * (0.25 + v * v) / (2 * 81));
}

TEST(ChromaReference, CountsMaskOrDrawingOfViewsThatSeeSomebody) {
  Images p = plain_images(8, {0, 0, 1}, {0, 0, 0});
  const double whole = chroma_plain(p).item<double>();
  p.mask.slice(2, 0, 4).zero_();  // half the difference, the same count
  expect_both(chroma_plain, p, whole / 2);
  p.covered.slice(2, 0, 2).zero_();  // 16 of 64 pixels are in neither
  expect_both(chroma_plain, p, whole / 2 * 64 / 48);
  Images two = p;
  two.mask = torch::cat({p.mask, torch::zeros_like(p.mask)}, 1);
  two.covered = torch::cat({p.covered, p.covered}, 1);
  two.rendered = torch::cat({p.rendered, p.rendered}, 1);
  two.target = torch::cat({p.target, p.target}, 1);
  expect_both(chroma_plain, two, whole / 2 * 64 / 48);
}

TEST(LightingReference, ByHand) {
  Images p = plain_images(10, {0.5, 0.1, 0.2}, {0.3, 0.2, 0.2});
  expect_both(lighting, p, 0.5 * 255 * 255 * (0.04 + 0.01) / 3);
  // Foreground on the left half, drawn except for the top row. The strip of difference along either edge is eroded.
  p.mask.slice(3, 5, 10).zero_();
  p.covered.slice(2, 0, 1).zero_();
  p.rendered.slice(3, 4, 10).fill_(77.0);
  p.rendered.slice(2, 0, 2).fill_(77.0);
  expect_both(lighting, p, 0.5 * 255 * 255 * (0.04 + 0.01) / 3);
}

TEST(PhotometricReference, ByHand) {
  Images p = plain_images(10, {0.5, 0.1, 0.2}, {0.3, 0.2, 0.2});
  expect_both(photometric, p, 255 * (0.2 + 0.1) / 3);
  expect_both(photometric_squares, p, 0.5 * 255 * 255 * (0.04 + 0.01) / 3);
  p.mask.slice(3, 6, 10).zero_();  // two columns of the rest are eroded, but nothing of what is drawn
  p.covered.slice(2, 0, 5).zero_();
  p.rendered.slice(3, 4, 10).fill_(77.0);
  p.rendered.slice(2, 0, 5).fill_(77.0);
  expect_both(photometric, p, 255 * (0.2 + 0.1) / 3);
}

TEST(ImageLossesReference, NothingSeenCostsNothing) {
  for (const auto& [name, loss] : kLosses) {
    for (auto type : {torch::kFloat32, torch::kFloat64}) {
      Images p = images(2, 2, 9, 7, 1, type);
      p.mask.zero_();
      p.rendered.requires_grad_();
      const Tensor value = loss(p);
      value.backward();
      EXPECT_EQ(value.item<double>(), 0.0) << name;
      EXPECT_EQ(p.rendered.grad().abs().max().item<double>(), 0.0) << name;
    }
  }
}

TEST(ImagesReference, ErosionByHand) {
  Tensor mask = torch::zeros({1, 1, 7, 8}, torch::kUInt8);
  mask.slice(2, 0, 6).slice(3, 1, 7).fill_(255);  // cut off by the upper edge
  Tensor expected = torch::zeros_like(mask);
  expected.slice(2, 0, 5).slice(3, 2, 6).fill_(1);
  EXPECT_TRUE(torch::equal(erode_mask(mask, 1), expected));
  expected.zero_().slice(2, 0, 4).slice(3, 3, 5).fill_(1);
  EXPECT_TRUE(torch::equal(erode_mask(mask.to(torch::kBool), 2), expected));
  EXPECT_TRUE(torch::equal(erode_mask(mask, 0), mask.ne(0).to(torch::kUInt8)));
  EXPECT_EQ(mask.max().item<int>(), 255);
}

TEST(ImagesReference, ColoursOf8Bits) {
  const Tensor image = torch::tensor({0, 51, 255}, torch::kUInt8).view({1, 1, 3});
  EXPECT_TRUE(is_near(image_float(image), torch::tensor({0.0, 0.2, 1.0}).view({1, 1, 3}), 1e-7));
}

TEST(ImagesAgrees, ErosionEqualsReference) {
  const int before = at::get_num_threads();
  for (int threads : {1, 2, 3}) {
    at::set_num_threads(threads);
    for (const auto& shape : std::vector<std::vector<int64_t>>{
             {2, 3, 41, 67}, {1, 1, 1, 1}, {1, 2, 5, 1}, {1, 1, 1, 9}, {0, 2, 4, 4}, {3, 2, 300, 20}, {1, 1, 4, 2}}) {
      const Tensor mask = torch::rand(shape, at::detail::createCPUGenerator(5)) < 0.9;
      for (int times : {0, 1, 2, 3})
        EXPECT_TRUE(torch::equal(erode_mask(mask, times), erode_mask_reference(mask, times))) << shape << times;
    }
  }
  at::set_num_threads(before);
}

/// Value, and gradients to both images of 0.7 times the loss.
std::vector<Tensor> evaluate(Loss loss, Images p) {
  p.rendered = p.rendered.detach().clone().requires_grad_();
  p.target = p.target.detach().clone().requires_grad_();
  const Tensor value = loss(p);
  (0.7 * value).backward();
  return {value.detach(), p.rendered.grad(), p.target.grad()};
}

TEST(ImageLossesAgrees, KernelEqualsReferenceWithAnyNumberOfThreads) {
  const int before = at::get_num_threads();
  const std::vector<std::vector<int64_t>> shapes{{2, 3, 45, 37}, {1, 1, 130, 19}, {1, 2, 1, 5},
                                                 {3, 1, 7, 1},   {0, 2, 8, 8},    {1, 1, 64, 64}};
  for (const auto& [name, loss] : kLosses) {
    for (const auto& s : shapes) {
      const Images p = images(s[0], s[1], s[2], s[3]);
      const auto expected = evaluate(loss, p);
      std::vector<Tensor> first;
      for (int threads : {1, 2, 3}) {
        at::set_num_threads(threads);
        const auto found = evaluate(loss, single(p));
        EXPECT_TRUE(is_near(found[0], expected[0], 1e-9, 1e-5)) << name << s;
        const double size = expected[1].numel() > 0 ? expected[1].abs().max().item<double>() : 0.0;
        for (int i : {1, 2}) EXPECT_TRUE(is_near(found[i], expected[i], 1e-6 * size + 1e-12, 1e-5)) << name << s << i;
        if (first.empty()) first = found;
        for (int i : {0, 1, 2}) EXPECT_TRUE(torch::equal(found[i], first[i])) << name << s << threads;
      }
    }
  }
  at::set_num_threads(before);
}

TEST(ImageLossesAgrees, ReferenceScopeTakesTheReference) {
  const Images p = single(images(1, 2, 33, 21));
  for (const auto& [name, loss] : kLosses) {
    const Tensor kernel = loss(p);
    const ReferenceScope reference;
    EXPECT_TRUE(is_near(kernel, loss(p), 1e-9, 1e-5)) << name;
  }
}

TEST(ImageLossesAgrees, StridedInputs) {
  const Images p = single(images(2, 3, 20, 30));
  const auto turned = [](const Tensor& t) { return t.transpose(2, 3).contiguous().transpose(2, 3); };
  const Images q{turned(p.rendered), turned(p.covered), turned(p.target), turned(p.mask)};
  for (const auto& [name, loss] : kLosses) EXPECT_TRUE(torch::equal(loss(p), loss(q))) << name;
}

// The renderer's background may hold anything: only the mask decides.
TEST(ImageLossesAgrees, IgnoresWhatLiesOutsideTheMask) {
  for (auto type : {torch::kFloat32, torch::kFloat64}) {
    const Images p = images(1, 2, 30, 30, 3, type);
    Images q = p;
    q.rendered = torch::where(p.mask.ne(0).unsqueeze(-1), p.rendered, torch::full({}, NAN, p.rendered.options()));
    for (const auto& [name, loss] : kLosses) {
      const auto expected = evaluate(loss, p), found = evaluate(loss, q);
      for (int i = 0; i < 3; ++i) EXPECT_TRUE(torch::equal(found[i], expected[i])) << name << i;
    }
  }
}

TEST(ImageLossesGradient, ReferenceEqualsCentralDifferences) {
  const Images p = images(2, 2, 11, 9);
  for (const auto& [name, loss] : kLosses) {
    const auto f = [&p, l = loss](const std::vector<Tensor>& x) { return l({x[0], p.covered, x[1], p.mask}); };
    EXPECT_TRUE(gradients_match(f, {{"rendered", p.rendered}, {"target", p.target}}, {1e-6, 1e-5, 1e-5})) << name;
  }
}

TEST(ImageLossesGradient, OnlyWhereWanted) {
  for (const auto& [name, loss] : kLosses) {
    Images p = single(images(1, 1, 20, 20));
    p.target.requires_grad_();
    loss(p).backward();
    EXPECT_GT(p.target.grad().abs().max().item<double>(), 0.0) << name;
    EXPECT_FALSE(p.rendered.grad().defined());
  }
}

TEST(ImageLossesRejects, ShapesAndTypes) {
  const Images good = single(images(1, 2, 6, 5));
  for (const auto& [name, loss] : kLosses) {
    const auto complaint = [&, l = loss](auto change) {
      Images p = good;
      change(p);
      return message_of<UsageError>([&] { l(p); });
    };
    EXPECT_THAT(complaint([](Images& p) { p.rendered = p.rendered[0]; }), HasSubstr("found float32 [2,6,5,3]"));
    EXPECT_THAT(complaint([](Images& p) { p.target = p.target.slice(2, 0, 5); }), HasSubstr("target must be"));
    EXPECT_THAT(complaint([](Images& p) { p.target = p.target.to(torch::kFloat64); }), HasSubstr("float64"));
    EXPECT_THAT(complaint([](Images& p) { p.mask = p.mask.to(torch::kFloat32); }), HasSubstr("target_mask must be"));
    EXPECT_THAT(complaint([](Images& p) { p.covered = p.covered.slice(3, 0, 4); }), HasSubstr("found bool [1,2,6,4]"));
    EXPECT_THAT(complaint([](Images& p) { p.covered = Tensor(); }), HasSubstr("an undefined tensor"));
  }
}

TEST(ImageLossesRejects, Options) {
  const Images p = single(images(1, 1, 6, 5));
  const auto chroma_with = [&](double smoothing, int half) {
    return message_of<UsageError>([&] { chroma_loss(p.rendered, p.covered, p.target, p.mask, {smoothing, half}); });
  };
  EXPECT_THAT(chroma_with(-1.0, 1), HasSubstr("smoothing -1"));
  EXPECT_THAT(chroma_with(NAN, 1), HasSubstr("smoothing"));
  EXPECT_THAT(chroma_with(1.0, 0), HasSubstr("half size 0"));
  EXPECT_THAT(chroma_with(1.0, 9), HasSubstr("half size 9"));
  EXPECT_THAT(message_of<UsageError>([&] { lighting_loss(p.rendered, p.covered, p.target, p.mask, {-1}); }),
              HasSubstr("-1 pixels"));
  EXPECT_THAT(message_of<UsageError>([&] { erode_mask(p.rendered, 1); }), HasSubstr("found float32"));
  EXPECT_THAT(message_of<UsageError>([&] { image_float(p.rendered); }), HasSubstr("must be uint8"));
}

}  // namespace
}  // namespace doppel::image_losses_test
