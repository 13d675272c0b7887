#include "doppel/losses/silhouette.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>
#include <torch/autograd.h>
#include <torch/optim/adam.h>
#include <torch/types.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "render/scenes.h"
#include "support/gradient_check.h"

namespace doppel::silhouette_test {
namespace {

using namespace test;
using torch::Tensor;

/// Signed distance to the outline of a mask, half a pixel at the pixels on either side of it.
Tensor signed_distance(const Tensor& mask) {
  const int height = static_cast<int>(mask.size(0)), width = static_cast<int>(mask.size(1));
  const Tensor kept = mask.contiguous();
  const cv::Mat inside(height, width, CV_8U, kept.data_ptr<std::uint8_t>());
  cv::Mat to_outside, to_inside;
  cv::distanceTransform(inside, to_outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(1 - inside, to_inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const Tensor in = torch::from_blob(to_outside.data, {height, width}).clone();
  const Tensor out = torch::from_blob(to_inside.data, {height, width}).clone();
  return torch::where(in > 0, 0.5 - in, out - 0.5);
}

/// Centres (x,y) of the inside pixels next to an outside one.
Tensor contour_pixels(const Tensor& distance) {
  const Tensor yx = (distance == -0.5).nonzero();
  return yx.flip({1}).to(torch::kFloat32) + 0.5;
}

SilhouetteTarget target_of_masks(const Tensor& masks, const Tensor& projection) {
  SilhouetteTarget target;
  target.projection = projection.to(torch::kFloat32);
  std::vector<Tensor> distances, contours;
  std::vector<std::int64_t> offsets{0};
  for (std::int64_t i = 0; i < masks.size(0) * masks.size(1); ++i) {
    distances.push_back(signed_distance(masks.flatten(0, 1)[i]));
    contours.push_back(contour_pixels(distances.back()));
    offsets.push_back(offsets.back() + contours.back().size(0));
  }
  target.distance = torch::stack(distances).reshape(masks.sizes());
  target.pixel_scale = torch::full({masks.size(0), masks.size(1)}, 2.0f);
  target.valid = torch::ones({masks.size(0), masks.size(1)}, torch::kBool);
  target.contour = torch::cat(contours);
  target.contour_offsets = torch::tensor(offsets, torch::kInt64);
  return target;
}

/// A sphere seen by cameras around it, and the masks of the same sphere elsewhere and larger.
struct Scene {
  Mesh mesh;
  Tensor vertices, ground_truth;
  SilhouetteTarget target;

  explicit Scene(std::int64_t batch = 2, std::int64_t size = 96, int rings = 14, int cameras = 3)
      : mesh(test::sphere(rings, 0.5f)) {
    std::vector<Tensor> start, end, projections;
    for (std::int64_t b = 0; b < batch; ++b) {
      const auto shift = static_cast<float>(b) * 0.03f;
      start.push_back(mesh.vertices + torch::tensor({0.05f - shift, 0.04f, -0.06f + shift}));
      end.push_back(mesh.vertices * 1.15f + torch::tensor({-0.06f, shift, 0.05f}));
      std::vector<Tensor> one;
      for (int c = 0; c < cameras; ++c)
        one.push_back(test::orbit_projection(0.9 * c, 3, 1.6 * static_cast<double>(size), static_cast<double>(size)));
      projections.push_back(torch::stack(one));
    }
    vertices = torch::stack(start);
    ground_truth = torch::stack(end);
    const Tensor projection = torch::stack(projections).to(torch::kFloat32);
    Rasterizer rasterizer(mesh.faces);
    target = target_of_masks(rasterizer.coverage_projected(ground_truth, projection, size, size), projection);
  }
};

Tensor gradient_of(const Tensor& loss, const Tensor& leaf) {
  return torch::autograd::grad({loss}, {leaf}, {}, true)[0];
}

TEST(SilhouetteReference, IsZeroOnItsOwnOutlineAndRisesWithDistance) {
  const Scene s(1);
  double before = -1;
  for (const double shift : {0.0, 0.02, 0.05, 0.1}) {
    const Tensor moved = s.ground_truth.to(torch::kFloat64) + torch::tensor({0.0, shift, 0.0}, torch::kFloat64);
    const SilhouetteLoss loss = silhouette_loss(moved, s.mesh.faces, s.target);
    const double total = loss.total().item<double>();
    EXPECT_GT(total, before);
    before = total;
    // Half of a pixel at most for each of the some dozen boundary vertices.
    if (shift == 0.0) {
      EXPECT_LT(loss.model_to_data.item<double>(), 60 * std::pow(2.0 / 255, 2));
    }
  }
}

/// One vertex on a strip-shaped mask, rows of equal distance: the medial-axis example.
struct Strip {
  std::int64_t size = 40;
  SilhouetteTarget target;
  Tensor faces = torch::tensor({0, 1, 2}, torch::kInt64).reshape({1, 3});
  Tensor boundary = torch::tensor({1, 0, 0}).reshape({1, 1, 3}).to(torch::kBool);

  explicit Strip(std::int64_t width = 10) {
    // `width` columns from 15 inside; orthographic camera: u = 10 x + 15, v = 10 y + 20 with w = 1.
    Tensor mask = torch::zeros({1, 1, size, size}, torch::kUInt8);
    mask.slice(3, 15, 15 + width).fill_(1);
    const Tensor projection =
        torch::tensor({10.f, 0.f, 0.f, 15.f, 0.f, 10.f, 0.f, 20.f, 0.f, 0.f, 0.f, 1.f}).reshape({1, 1, 3, 4});
    target = target_of_masks(mask, projection);
  }
  /// Vertex 0 at strip coordinate x (0..width inside) with a normal along +u or -u.
  Tensor at(double x, double normal) const {
    const Tensor u = torch::tensor({x / 10, 0.013, 0.0}, torch::kFloat64);
    const Tensor right = torch::tensor({0.0, 0.1, 0.0}, torch::kFloat64),
                 deep = torch::tensor({0.0, 0.0, normal}, torch::kFloat64);
    return torch::stack({u, u + right, u + deep}).unsqueeze(0);  // cross((0,1,0), (0,0,n)) = (n,0,0)
  }
};

TEST(SilhouetteReference, RhoTurnsTheGradientBehindTheMedialAxisAndNotTheValue) {
  const Strip s;
  SilhouetteOptions options;
  options.data_to_model = 0;
  options.distance_scale = 1;
  const auto evaluate = [&](double x, double normal) {
    const Tensor v = s.at(x, normal).requires_grad_();
    const Tensor loss = silhouette_loss(v, s.faces, s.boundary, s.target, options).model_to_data;
    return std::make_pair(loss.item<double>(), gradient_of(loss, v)[0][0][0].item<double>());
  };
  // Facing right, the vertex belongs to the right outline (x = 10). At 3 the left one is nearer: value 9, and descent
  // must go right.
  EXPECT_NEAR(evaluate(3, 1).first, 9, 1e-5);
  EXPECT_NEAR(evaluate(3, 1).second, -2 * 3 * 10, 1e-3);  // d(x^2)/dx = +6 per pixel, turned; 10 pixels per metre
  EXPECT_NEAR(evaluate(3, -1).second, 2 * 3 * 10, 1e-3);
  EXPECT_NEAR(evaluate(7, 1).first, 9, 1e-5);
  EXPECT_NEAR(evaluate(7, 1).second, -2 * 3 * 10, 1e-3);  // past the axis: the same way, unturned
  // Outside it is never turned, whichever way the vertex faces.
  EXPECT_NEAR(evaluate(-2, 1).second, -2 * 2 * 10, 1e-3);
  EXPECT_NEAR(evaluate(-2, -1).second, -2 * 2 * 10, 1e-3);
}

TEST(SilhouetteReference, DescentWithRhoEndsOnTheOutlineTheVertexFaces) {
  const Strip s(
      9);  // of odd width: the ridge of an even one is flat from pixel centre to pixel centre, a step can rest on it
  SilhouetteOptions options;
  options.data_to_model = 0;
  options.distance_scale = 1;
  for (const double start : {1.0, 4.0, 6.0}) {
    double x = start;
    for (int step = 0; step < 200; ++step) {
      const Tensor v = s.at(x, 1).requires_grad_();
      const Tensor loss = silhouette_loss(v, s.faces, s.boundary, s.target, options).model_to_data;
      x -= 0.1 * gradient_of(loss, v)[0][0][0].item<double>() / 10;
    }
    EXPECT_NEAR(x, 9, 0.05) << "from " << start;
  }
}

TEST(SilhouetteReference, InsetMovesTheGoalInwards) {
  const Strip s;
  SilhouetteOptions options;
  options.data_to_model = 0;
  options.distance_scale = 1;
  options.inset = 1.5;
  const auto value = [&](double x) {
    return silhouette_loss(s.at(x, 1), s.faces, s.boundary, s.target, options).model_to_data.item<double>();
  };
  EXPECT_NEAR(value(8.5), 0, 1e-5);
  EXPECT_NEAR(value(10), 1.5 * 1.5, 1e-4);
  EXPECT_NEAR(value(7), 1.5 * 1.5, 1e-4);
}

TEST(SilhouetteReference, UnitsAndWeights) {
  const Scene s(1);
  const Tensor vertices = s.vertices.to(torch::kFloat64);
  const SilhouetteLoss loss = silhouette_loss(vertices, s.mesh.faces, s.target);
  SilhouetteOptions options;
  options.unit = SilhouetteUnit::image_pixels;  // 2 image pixels per crop pixel
  options.data_to_model = 3;
  const SilhouetteLoss scaled = silhouette_loss(vertices, s.mesh.faces, s.target, options);
  EXPECT_TRUE(is_near(scaled.model_to_data, loss.model_to_data * 4, 0, 1e-9));
  EXPECT_TRUE(is_near(scaled.data_to_model, loss.data_to_model * 3, 0, 1e-9));
}

SilhouetteOptions on_outline() {
  SilhouetteOptions options;
  options.boundary = SilhouetteBoundary::outline;
  return options;
}

/// Drawn a third of a pixel aside: points lie at pixel centres when they are drawn, and there the interpolant of the
/// distance image has its kinks.
OutlinePoints outline_off_the_kinks(const Scene& s) {
  const Tensor moved = s.vertices + torch::tensor({0.006f, 0.007f, 0.005f});
  return outline_points(moved, s.target.projection, s.mesh.faces, s.target.distance.size(2), s.target.distance.size(3),
                        s.target.valid);
}

TEST(SilhouetteOutline, IsZeroOnItsOwnMaskAndGrowsBySquares) {
  const Scene s(1);
  const Tensor ground_truth = s.ground_truth.to(torch::kFloat64);
  const SilhouetteLoss own = silhouette_loss(ground_truth, s.mesh.faces, s.target, on_outline());
  EXPECT_LT(own.total().item<double>(), 1e-6) << "pixels of the mask's edge are compared with pixels of the drawing's";
  const auto moved_by = [&](double shift) {
    const Tensor moved = ground_truth + torch::tensor({0.0, shift, 0.0}, torch::kFloat64);
    return silhouette_loss(moved, s.mesh.faces, s.target, on_outline());
  };
  const SilhouetteLoss near = moved_by(0.05), far = moved_by(0.1);
  EXPECT_NEAR(far.model_to_data.item<double>() / near.model_to_data.item<double>(), 4, 1);
  EXPECT_NEAR(far.data_to_model.item<double>() / near.data_to_model.item<double>(), 4, 1);
}

TEST(SilhouetteOutline, DoesNotDependOnTheSizeOfTheCrop) {
  const Scene small(1, 96), large(1, 192);
  Scene coarse = small, fine = large;
  coarse.target.pixel_scale.fill_(2.0f);
  fine.target.pixel_scale.fill_(1.0f);
  const SilhouetteLoss a = silhouette_loss(coarse.vertices, coarse.mesh.faces, coarse.target, on_outline());
  const SilhouetteLoss b = silhouette_loss(fine.vertices, fine.mesh.faces, fine.target, on_outline());
  EXPECT_NEAR(a.model_to_data.item<double>() / b.model_to_data.item<double>(), 1, 0.05);
  EXPECT_NEAR(a.data_to_model.item<double>() / b.data_to_model.item<double>(), 1, 0.15);
}

TEST(SilhouetteOutline, DescentFillsTheMask) {
  const Scene s(1);
  Rasterizer rasterizer(s.mesh.faces);
  const auto overlap = [&](const Tensor& vertices) {
    const Tensor drawn = rasterizer.coverage_projected(vertices, s.target.projection, 96, 96) > 0;
    const Tensor mask = s.target.distance < 0;
    return (drawn & mask).sum().item<double>() / (drawn | mask).sum().item<double>();
  };
  Tensor placement = torch::tensor({0.0f, 0.0f, 0.0f, 1.0f}).requires_grad_();  // a shift and a size
  torch::optim::Adam adam(std::vector<Tensor>{placement}, torch::optim::AdamOptions(5e-3));
  const auto placed = [&] { return s.vertices * placement[3] + placement.slice(0, 0, 3); };
  const double before = overlap(placed().detach());
  for (int step = 0; step < 150; ++step) {
    adam.zero_grad();
    silhouette_loss(placed(), s.mesh.faces, s.target, on_outline()).total().backward();
    adam.step();
  }
  EXPECT_LT(before, 0.8);
  EXPECT_GT(overlap(placed().detach()), 0.985);
}

TEST(SilhouetteGradient, OnTheOutlineMatchesCentralDifferences) {
  const Scene s(2, 64, 9);
  const OutlinePoints outline = outline_off_the_kinks(s);
  const auto f = [&](const std::vector<Tensor>& in) {
    const SilhouetteLoss loss = silhouette_loss(in[0], s.mesh.faces, outline, s.target);
    return torch::stack({loss.model_to_data, loss.data_to_model});
  };
  EXPECT_TRUE(gradients_match(f, {{"vertices", s.vertices.to(torch::kFloat64)}}, {1e-7, 1e-6, 1e-5, 1200}));
}

TEST(SilhouetteGradient, OfTheReferenceMatchesCentralDifferences) {
  const Scene s(2);
  const Tensor boundary = boundary_vertices(s.vertices, s.target.projection, s.mesh.faces, 96, 96);
  // Without turned gradients, for which a central difference rightly finds the other sign: all vertices lie inside a
  // larger sphere's mask here, and face outward.
  const auto f = [&](const std::vector<Tensor>& in) {
    const SilhouetteLoss loss = silhouette_loss(in[0], s.mesh.faces, boundary, s.target);
    return torch::stack({loss.model_to_data, loss.data_to_model});
  };
  EXPECT_TRUE(gradients_match(f, {{"vertices", s.vertices.to(torch::kFloat64)}}, {1e-7, 1e-6, 1e-5, 1200}));
}

TEST(SilhouetteAgrees, KernelAndReferenceForOneTwoAndThreeThreads) {
  Scene s(3, 75, 11);
  s.target.valid[1][2] = false;
  for (const int variant : {0, 1, 2}) {
    SilhouetteOptions options;
    options.visible_only = variant == 1;
    options.inset = variant == 1 ? 0.7 : 0.0;
    options.data_to_model = 0.5;
    const Tensor vertices = s.vertices.clone().requires_grad_();
    const OutlinePoints outline = outline_off_the_kinks(s);
    const auto evaluate = [&] {
      return variant == 2 ? silhouette_loss(vertices, s.mesh.faces, outline, s.target, options)
                          : silhouette_loss(vertices, s.mesh.faces, s.target, options);
    };
    Tensor value, gradient[2];
    {
      const ReferenceScope reference;
      const SilhouetteLoss loss = evaluate();
      value = loss.total().detach();
      gradient[0] = gradient_of(loss.model_to_data, vertices);
      gradient[1] = gradient_of(loss.data_to_model, vertices);
      EXPECT_GT(loss.model_to_data.item<float>(), 0);
      EXPECT_GT(loss.data_to_model.item<float>(), 0);
    }
    const int before = at::get_num_threads();
    Tensor first;
    for (const int threads : {1, 2, 3}) {
      at::set_num_threads(threads);
      const SilhouetteLoss loss = evaluate();
      EXPECT_TRUE(is_near(loss.total(), value, 1e-6, 1e-4));
      const Tensor found[2] = {gradient_of(loss.model_to_data, vertices), gradient_of(loss.data_to_model, vertices)};
      for (int k = 0; k < 2; ++k)
        EXPECT_TRUE(is_near(found[k], gradient[k], 1e-3 * gradient[k].abs().max().item<double>())) << k;
      if (!first.defined()) first = found[0] + found[1];
      EXPECT_TRUE(torch::equal(found[0] + found[1], first)) << threads << " threads";
    }
    at::set_num_threads(before);
  }
}

TEST(SilhouetteAgrees, WithNoBatchNoCameraAndNoContour) {
  Scene s(1);
  SilhouetteTarget none = s.target;
  none.projection = torch::zeros({0, 3, 3, 4});
  none.distance = torch::zeros({0, 3, 96, 96});
  none.valid = torch::zeros({0, 3}, torch::kBool);
  none.contour = torch::zeros({0, 2});
  none.contour_offsets = torch::zeros({1}, torch::kInt64);
  for (const auto dtype : {torch::kFloat32, torch::kFloat64}) {
    const Tensor vertices = torch::zeros({0, s.vertices.size(1), 3}, dtype).requires_grad_();
    const SilhouetteLoss loss = silhouette_loss(vertices, s.mesh.faces, none);
    EXPECT_EQ(loss.total().item<double>(), 0);
    EXPECT_EQ(gradient_of(loss.total(), vertices).sizes(), vertices.sizes());
  }
  s.target.contour = torch::zeros({0, 2});
  s.target.contour_offsets = torch::zeros({4}, torch::kInt64);
  EXPECT_EQ(silhouette_loss(s.vertices, s.mesh.faces, s.target).data_to_model.item<float>(), 0);
}

TEST(SilhouetteAgrees, InvalidCamerasContributeNothing) {
  Scene s(1);
  const SilhouetteLoss all = silhouette_loss(s.vertices, s.mesh.faces, s.target);
  s.target.valid[0][1] = false;
  s.target.distance[0][1].fill_(std::numeric_limits<float>::quiet_NaN());
  const SilhouetteLoss two = silhouette_loss(s.vertices, s.mesh.faces, s.target);
  Scene alone(1);
  alone.target.valid[0][0] = alone.target.valid[0][2] = false;
  const SilhouetteLoss one = silhouette_loss(s.vertices, s.mesh.faces, alone.target);
  EXPECT_TRUE(is_near(two.total() * 2 + one.total(), all.total() * 3, 0, 1e-5));  // means over valid cameras
  s.target.valid.fill_(false);
  const Tensor vertices = s.vertices.clone().requires_grad_();
  const SilhouetteLoss nothing = silhouette_loss(vertices, s.mesh.faces, s.target);
  EXPECT_EQ(nothing.total().item<float>(), 0);
  EXPECT_EQ(gradient_of(nothing.total(), vertices).abs().max().item<float>(), 0);
}

TEST(SilhouetteRecovers, PositionAndSizeOfASphereFromItsMasks) {
  const Scene s(1, 160, 20, 4);
  Tensor shift = torch::zeros({3}).requires_grad_(), scale = torch::ones({1}).requires_grad_();
  torch::optim::Adam adam({shift, scale}, torch::optim::AdamOptions(0.01));
  for (int step = 0; step < 150; ++step) {
    adam.zero_grad();
    const Tensor vertices = s.vertices * scale + shift;
    silhouette_loss(vertices, s.mesh.faces, s.target).total().backward();
    adam.step();
  }
  const Tensor error = (s.vertices * scale + shift - s.ground_truth).norm(2, 2).max();
  EXPECT_LT(error.item<float>(), 0.006f);  // a pixel is 19 mm / 1.6
}

TEST(SilhouetteRejects, WrongShapesAndTypes) {
  const Scene s(2);
  const auto rejects = [&](const std::function<void(SilhouetteTarget&)>& spoil) {
    SilhouetteTarget target = s.target;
    spoil(target);
    EXPECT_THROW(silhouette_loss(s.vertices, s.mesh.faces, target), Error);
  };
  rejects([](SilhouetteTarget& t) { t.projection = t.projection[0]; });
  rejects([](SilhouetteTarget& t) { t.distance = t.distance.slice(3, 0, 50); });
  rejects([](SilhouetteTarget& t) { t.valid = t.valid.to(torch::kFloat32); });
  rejects([](SilhouetteTarget& t) { t.contour = t.contour.slice(0, 1); });
  rejects([](SilhouetteTarget& t) { t.contour_offsets = t.contour_offsets.flip({0}); });
  rejects([](SilhouetteTarget& t) { t.contour_offsets = t.contour_offsets.slice(0, 1); });
  rejects([](SilhouetteTarget& t) { t.distance = Tensor(); });
  EXPECT_THROW(silhouette_loss(s.vertices[0], s.mesh.faces, s.target), Error);
  EXPECT_THROW(silhouette_loss(s.vertices.slice(1, 0, 5), s.mesh.faces, s.target), Error);
  EXPECT_THROW(silhouette_loss(s.vertices, s.mesh.faces.slice(1, 0, 2), s.target), Error);
  EXPECT_THROW(silhouette_loss(s.vertices, s.mesh.faces, torch::ones({2, 3, 4}, torch::kBool), s.target), Error);
  SilhouetteOptions options;
  options.contour_radius = 0;
  EXPECT_THROW(silhouette_loss(s.vertices, s.mesh.faces, s.target, options), Error);
}

TEST(SilhouetteRejects, ASecondDerivative) {
  const Scene s(1);
  const Tensor vertices = s.vertices.clone().requires_grad_();
  const Tensor loss = silhouette_loss(vertices, s.mesh.faces, s.target).total();
  const Tensor gradient = torch::autograd::grad({loss}, {vertices}, {}, true, true)[0];
  EXPECT_ANY_THROW(gradient.square().sum().backward());
}

}  // namespace
}  // namespace doppel::silhouette_test
