#include "doppel/render/raster/rasterizer.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include "doppel/core/as_size.h"
#include "doppel/core/cpu_dispatch.h"
#include "doppel/core/error.h"
#include "doppel/render/raster/raster_kernel.h"
#include "render/brute_force.h"
#include "render/scenes.h"
#include "support/gradient_check.h"

namespace doppel::rasterizer_test {
namespace {

using test::Mesh;
using torch::Tensor;

Tensor pinhole(double focal, double cx, double cy) {
  return torch::tensor({focal, focal, cx, cy}).unsqueeze(0).to(torch::kFloat32);
}

/// One thread count for the time of a scope.
class Threads {
 public:
  explicit Threads(int n) : before_(at::get_num_threads()) { at::set_num_threads(n); }
  ~Threads() { at::set_num_threads(before_); }

 private:
  int before_;
};

bool equal(const RasterImage& a, const RasterImage& b) {
  return torch::equal(a.face_id, b.face_id) && torch::equal(a.depth, b.depth) &&
         torch::equal(a.barycentrics, b.barycentrics);
}

RasterImage copy(const RasterImage& image) {
  return {image.face_id.clone(), image.depth.clone(), image.barycentrics.clone()};
}

/// Covered by each face alone: uint8 [F,H,W].
Tensor coverage_by_face(const Mesh& mesh, const Tensor& intrinsics, std::int64_t height, std::int64_t width,
                        bool cull = false) {
  const Tensor corners = mesh.vertices.index_select(0, mesh.faces.flatten().to(torch::kInt64)).reshape({-1, 3, 3});
  Rasterizer one_face(torch::tensor({0, 1, 2}, torch::kInt32).reshape({1, 3}), {0.01f, cull});
  return one_face.coverage(corners, intrinsics, height, width);
}

/// What is wrong with an image of `mesh`, pixel by pixel; empty: nothing.
std::string compare_with_brute_force(const Mesh& mesh, const Tensor& intrinsics, const RasterImage& image) {
  constexpr double kMargin = 1.0 / 128, kNear = 0.01;
  const auto id = image.face_id[0];
  const auto ids = id.accessor<std::int32_t, 2>();
  const Tensor depth_image = image.depth[0], bary_image = image.barycentrics[0];
  const auto depth = depth_image.accessor<float, 2>();
  const auto bary = bary_image.accessor<float, 3>();
  std::vector<test::Corners> corners;
  for (std::int64_t f = 0; f < mesh.faces.size(0); ++f) {
    corners.push_back(test::corners_of(mesh.vertices, mesh.faces, intrinsics[0], f));
  }
  std::ostringstream problem;
  for (std::int64_t y = 0; y < id.size(0); ++y) {
    for (std::int64_t x = 0; x < id.size(1); ++x) {
      const double u = static_cast<double>(x) + 0.5, v = static_cast<double>(y) + 0.5;
      double nearest = std::numeric_limits<double>::infinity();
      for (const auto& h : corners) {
        const test::Hit hit = test::hit_face(h, u, v, kNear, kMargin);
        if (hit.surely_inside) nearest = std::min(nearest, hit.depth);
      }
      const std::int32_t found = ids[y][x];
      problem.str("");
      problem << "pixel " << x << "," << y << " face " << found << " depth " << depth[y][x] << ": ";
      if (found < 0) {
        if (std::isfinite(nearest)) return problem.str() + "a face lies there";
        if (!std::isinf(depth[y][x]) || bary[y][x][0] != 0) return problem.str() + "background is not cleared";
        continue;
      }
      const test::Hit hit = test::hit_face(corners[found], u, v, kNear, kMargin);
      if (hit.surely_outside) return problem.str() + "the face does not lie there";
      if (depth[y][x] > nearest * (1 + 1e-4) + 1e-5) return problem.str() + "a nearer face lies there";
      const double sum = bary[y][x][0] + bary[y][x][1] + bary[y][x][2];
      if (std::abs(sum - 1) > 1e-5) return problem.str() + "barycentrics do not sum to 1";
      for (std::int64_t k = 0; k < 3; ++k) {
        if (bary[y][x][k] < 0 || bary[y][x][k] > 1 + 1e-6f) return problem.str() + "barycentrics beyond 0..1";
        if (hit.surely_inside && std::abs(bary[y][x][k] - hit.barycentrics[k]) > 2e-3) {
          return problem.str() + "wrong barycentrics";
        }
      }
      if (hit.surely_inside && std::abs(depth[y][x] - hit.depth) > 2e-3 * hit.depth)
        return problem.str() + "wrong depth";
    }
  }
  return "";
}

TEST(RasterizerAgrees, WithBruteForceOnAThousandTriangleSoups) {
  std::mt19937 random(1);
  std::int64_t drawn = 0;
  for (int scene = 0; scene < 1000; ++scene) {
    const Mesh mesh = test::triangle_soup(random, 1 + static_cast<int>(random() % 12));
    const std::int64_t width = 1 + random() % 90, height = 1 + random() % 40;
    const Tensor intrinsics = pinhole(0.8 * static_cast<double>(width + height), 0.5 * static_cast<double>(width),
                                      0.45 * static_cast<double>(height));
    Rasterizer rasterizer(mesh.faces);
    const RasterImage& image = rasterizer.rasterize(mesh.vertices.unsqueeze(0), intrinsics, height, width);
    const std::string problem = compare_with_brute_force(mesh, intrinsics, image);
    ASSERT_EQ(problem, "") << "scene " << scene;
    drawn += (image.face_id >= 0).sum().item<std::int64_t>();
    const Tensor coverage = rasterizer.coverage(mesh.vertices.unsqueeze(0), intrinsics, height, width);
    ASSERT_TRUE(torch::equal(coverage, (image.face_id >= 0).to(torch::kUInt8))) << "scene " << scene;
  }
  EXPECT_GT(drawn, 200000);  // the scenes do show something
}

TEST(RasterizerAgrees, WithTheExactTestOnRoundedCorners) {
  std::mt19937 random(2);
  for (int scene = 0; scene < 200; ++scene) {
    const std::int64_t size = 1 + random() % 150;
    std::vector<float> points;
    std::vector<std::int64_t> x, y;
    for (int k = 0; k < 3; ++k) {  // corners on a coarse grid, so that centres often lie exactly on edges
      const int step = scene % 2 ? 128 : 1;
      x.push_back(static_cast<std::int64_t>(random() % static_cast<unsigned>(256 * size)) / step * step);
      y.push_back(static_cast<std::int64_t>(random() % static_cast<unsigned>(256 * size)) / step * step);
      points.insert(points.end(), {static_cast<float>(x.back()) / 256, static_cast<float>(y.back()) / 256, 1});
    }
    const std::int64_t area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area < 0) std::swap(x[1], x[2]), std::swap(y[1], y[2]);
    Rasterizer rasterizer(torch::tensor({0, 1, 2}, torch::kInt32).reshape({1, 3}));
    const Tensor mask = rasterizer.coverage(torch::tensor(points).reshape({1, 3, 3}), pinhole(1, 0, 0), size, size)[0];
    const auto found = mask.accessor<std::uint8_t, 2>();
    for (std::int64_t py = 0; py < size; ++py) {
      for (std::int64_t px = 0; px < size; ++px) {
        bool expected = area != 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t n = (k + 1) % 3;
          const std::int64_t dx = x[n] - x[k], dy = y[n] - y[k];
          const std::int64_t e = dx * (256 * py + 128 - y[k]) - dy * (256 * px + 128 - x[k]);
          expected = expected && (e > 0 || (e == 0 && (dy < 0 || (dy == 0 && dx > 0))));
        }
        ASSERT_EQ(found[py][px] != 0, expected) << "scene " << scene << " pixel " << px << "," << py;
      }
    }
  }
}

TEST(RasterizerWatertight, TessellatedPlaneCoversEveryPixelOnce) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(-0.3f, 0.3f);
  constexpr int kCells = 23;
  std::vector<float> points;
  std::vector<std::int32_t> faces;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      const bool inner = i > 0 && j > 0 && i < kCells && j < kCells;
      const float x = static_cast<float>(i) + (inner ? noise(random) : 0),
                  y = static_cast<float>(j) + (inner ? noise(random) : 0);
      points.insert(points.end(), {x * 6 - 20, y * 4 - 15, 1});
    }
  }
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const int a = j * (kCells + 1) + i, b = a + 1, c = a + kCells + 1, d = c + 1;
      for (const int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  }
  const Mesh mesh{torch::tensor(points).reshape({-1, 3}), torch::tensor(faces, torch::kInt32).reshape({-1, 3})};
  const Tensor count = coverage_by_face(mesh, pinhole(1, 0, 0), 61, 97).to(torch::kInt32).sum(0);
  EXPECT_EQ(count.min().item<int>(), 1);
  EXPECT_EQ(count.max().item<int>(), 1);
}

TEST(RasterizerWatertight, GroundThatRunsUnderTheCameraHasNoGaps) {
  // A floor from behind the camera to the horizon: every triangle near the camera is cut.
  std::vector<float> points;
  std::vector<std::int32_t> faces;
  constexpr int kCells = 12;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      points.insert(points.end(),
                    {static_cast<float>(i - kCells / 2) * 3.1f, 0.7f, static_cast<float>(j) * 1.7f - 5.03f});
    }
  }
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const int a = j * (kCells + 1) + i, b = a + 1, c = a + kCells + 1, d = c + 1;
      for (const int v : {a, b, d, a, d, c}) faces.push_back(v);
    }
  }
  const Mesh mesh{torch::tensor(points).reshape({-1, 3}), torch::tensor(faces, torch::kInt32).reshape({-1, 3})};
  const Tensor intrinsics = pinhole(60, 50, 10);
  const Tensor count = coverage_by_face(mesh, intrinsics, 80, 100).to(torch::kInt32).sum(0);
  EXPECT_EQ(count.max().item<int>(), 1);
  EXPECT_EQ(count.slice(0, 16, 80).min().item<int>(), 1);  // all below the far end of the floor (row 13)
  EXPECT_EQ(count.slice(0, 0, 10).max().item<int>(), 0);   // nothing above the horizon
  Rasterizer rasterizer(mesh.faces);
  EXPECT_EQ(
      compare_with_brute_force(mesh, intrinsics, rasterizer.rasterize(mesh.vertices.unsqueeze(0), intrinsics, 80, 100)),
      "");
}

TEST(RasterizerWatertight, ClosedMeshShowsAsManyFrontsAsBacks) {
  const Mesh mesh = test::sphere(24, 0.5f);
  Mesh placed{mesh.vertices + torch::tensor({0.1, -0.05, 1.6}).to(torch::kFloat32), mesh.faces};
  Mesh turned{placed.vertices, mesh.faces.flip({1})};
  const Tensor intrinsics = pinhole(120, 64, 50);
  const Tensor front = coverage_by_face(placed, intrinsics, 101, 127, true).to(torch::kInt32).sum(0);
  const Tensor back = coverage_by_face(turned, intrinsics, 101, 127, true).to(torch::kInt32).sum(0);
  EXPECT_EQ(front.max().item<int>(), 1);
  EXPECT_TRUE(torch::equal(front, back));
  EXPECT_GT(front.sum().item<int>(), 4000);
  // Culling the back of a closed mesh changes nothing.
  Rasterizer all(mesh.faces), culled(mesh.faces, {0.01f, true});
  EXPECT_TRUE(equal(all.rasterize(placed.vertices.unsqueeze(0), intrinsics, 101, 127),
                    culled.rasterize(placed.vertices.unsqueeze(0), intrinsics, 101, 127)));
}

TEST(RasterizerAgrees, ForOneTwoAndThreeThreads) {
  const Mesh mesh = test::sphere(40, 0.6f);
  for (const std::int64_t views : {1, 2, 5}) {
    const Tensor vertices = mesh.vertices.unsqueeze(0) + torch::rand({views, 1, 3}) * 0.3 +
                            torch::tensor({0.0, 0.0, 0.9}).to(torch::kFloat32);
    const Tensor intrinsics = pinhole(150, 100, 70);
    RasterImage expected;
    Tensor covered;
    for (const int threads : {1, 2, 3}) {
      const Threads scope(threads);
      Rasterizer rasterizer(mesh.faces);
      const RasterImage image = copy(rasterizer.rasterize(vertices, intrinsics, 143, 201));
      const Tensor mask = rasterizer.coverage(vertices, intrinsics, 143, 201);
      if (threads == 1) expected = image, covered = mask;
      EXPECT_TRUE(equal(image, expected)) << threads << " threads, " << views << " views";
      EXPECT_TRUE(torch::equal(mask, covered));
    }
  }
}

TEST(RasterizerAgrees, WhenOutputsAreDrawnOver) {
  std::mt19937 random(5);
  const Mesh mesh = test::sphere(12, 0.3f);
  Rasterizer kept(mesh.faces);
  for (int frame = 0; frame < 20; ++frame) {
    const float x = static_cast<float>(random() % 100) / 50 - 1, z = 1 + static_cast<float>(random() % 100) / 50;
    const Tensor vertices = torch::stack({mesh.vertices + torch::tensor({x, -x / 2, z}).to(torch::kFloat32),
                                          mesh.vertices + torch::tensor({-x, x, 3.0f - z}).to(torch::kFloat32)});
    const Tensor intrinsics = pinhole(110, 80, 60);
    Rasterizer fresh(mesh.faces);
    EXPECT_TRUE(equal(kept.rasterize(vertices, intrinsics, 121, 163), fresh.rasterize(vertices, intrinsics, 121, 163)))
        << "frame " << frame;
  }
}

#if defined(__x86_64__)
/// The kernels of one instruction set, as the rasterizer calls them.
struct KernelSet {
  decltype(kernels::project_vertices) project;
  decltype(kernels::bound_faces) bound;
  decltype(kernels::draw_tile) draw;
  decltype(kernels::cover_tile) cover;
  decltype(kernels::resolve_tile) resolve;
};

struct OneTile {
  std::vector<float> screen;
  std::vector<std::int32_t> bounded, face_id;
  std::vector<float> depth, barycentrics;
  std::array<std::uint64_t, kernels::kTile> rows{};
};

OneTile draw_one_tile(const KernelSet& k, const Mesh& mesh, int height, int width) {
  const std::int64_t num_vertices = mesh.vertices.size(0), num_faces = mesh.faces.size(0);
  OneTile r;
  r.screen.resize(4 * num_vertices);
  const Tensor padded = torch::cat({mesh.faces, torch::zeros({num_faces, 1}, torch::kInt32)}, 1).contiguous();
  kernels::RasterView view;
  view.vertices = mesh.vertices.data_ptr<float>();
  const float matrix[12] = {55, 0, 31, 0, 0, 55, 20, 0, 0, 0, 1, 0};
  std::copy_n(matrix, 12, view.matrix);
  view.faces = padded.data_ptr<std::int32_t>();
  view.screen = r.screen.data();
  view.width = width, view.height = height, view.z_near = 0.01f;
  k.project(view, 0, num_vertices);
  std::vector<kernels::FaceTiles> bounds(num_faces);
  bounds.resize(k.bound(view, 0, num_faces, bounds.data()));
  std::vector<std::int32_t> entries;
  for (const auto& b : bounds) {
    r.bounded.insert(r.bounded.end(), {b.face, b.x0});
    if (b.x0 >= 0) entries.push_back(b.face);
  }
  kernels::TileBuffer tile;
  std::fill(std::begin(tile.inverse_depth), std::end(tile.inverse_depth), 0.0f);
  std::fill(std::begin(tile.face), std::end(tile.face), -1);
  const kernels::TileWork work{entries.data(), static_cast<std::int64_t>(entries.size()), nullptr, 0, 0};
  kernels::TileRect touched;
  k.draw(view, work, tile, touched);
  k.cover(view, work, r.rows.data());
  const auto pixels = as_size(height * width);
  r.face_id.assign(pixels, -1);
  r.depth.assign(pixels, 0);
  r.barycentrics.assign(3 * pixels, 0);
  const kernels::TileRect whole{0, 0, static_cast<std::int16_t>(width), static_cast<std::int16_t>(height)};
  k.resolve(view, 0, 0, whole, tile, {r.face_id.data(), r.depth.data(), r.barycentrics.data()});
  return r;
}

TEST(RasterizerAgrees, OnEveryInstructionSet) {
  const KernelSet baseline{&kernels::baseline::project_vertices, &kernels::baseline::bound_faces,
                           &kernels::baseline::draw_tile, &kernels::baseline::cover_tile,
                           &kernels::baseline::resolve_tile};
  std::vector<KernelSet> others;
  if (cpu_isa() >= Isa::avx2) {
    others.push_back({&kernels::avx2::project_vertices, &kernels::avx2::bound_faces, &kernels::avx2::draw_tile,
                      &kernels::avx2::cover_tile, &kernels::avx2::resolve_tile});
  }
  if (cpu_isa() >= Isa::avx512) {
    others.push_back({&kernels::avx512::project_vertices, &kernels::avx512::bound_faces, &kernels::avx512::draw_tile,
                      &kernels::avx512::cover_tile, &kernels::avx512::resolve_tile});
  }
  std::mt19937 random(6);
  for (int scene = 0; scene < 60; ++scene) {
    Mesh mesh = test::triangle_soup(random, 40);
    const int height = 1 + static_cast<int>(random() % 64), width = 1 + static_cast<int>(random() % 64);
    const OneTile expected = draw_one_tile(baseline, mesh, height, width);
    for (const KernelSet& set : others) {
      const OneTile found = draw_one_tile(set, mesh, height, width);
      EXPECT_EQ(found.screen, expected.screen);
      EXPECT_EQ(found.bounded, expected.bounded);
      EXPECT_EQ(found.rows, expected.rows);
      EXPECT_EQ(found.face_id, expected.face_id);
      EXPECT_EQ(found.depth, expected.depth);
      EXPECT_EQ(found.barycentrics, expected.barycentrics);
    }
  }
}
#endif

TEST(RasterizerTies, GoToTheLowerFace) {
  const Tensor vertices = torch::tensor({-1.f, -1.f, 2.f, 1.f, -1.f, 3.f, 0.f, 1.f, 2.f}).reshape({1, 3, 3});
  const Tensor faces = torch::tensor({0, 1, 2, 0, 1, 2, 1, 2, 0}, torch::kInt32).reshape({3, 3});
  Rasterizer rasterizer(faces.slice(0, 0, 2));
  const RasterImage& image = rasterizer.rasterize(vertices, pinhole(40, 20, 20), 40, 40);
  EXPECT_EQ(image.face_id.max().item<int>(), 0);
  EXPECT_GT((image.face_id == 0).sum().item<int>(), 200);
}

TEST(RasterizerSizes, NothingToDrawIsBackground) {
  const Tensor no_faces = torch::empty({0, 3}, torch::kInt32);
  Rasterizer empty(no_faces);
  for (const std::int64_t views : {0, 1, 3}) {
    for (const std::int64_t points : {0, 5}) {
      const RasterImage& image = empty.rasterize(torch::ones({views, points, 3}), pinhole(10, 3, 2), 5, 7);
      EXPECT_EQ(image.face_id.sizes(), (std::vector<std::int64_t>{views, 5, 7}));
      EXPECT_TRUE((image.face_id == -1).all().item<bool>());
      EXPECT_TRUE(torch::isinf(image.depth).all().item<bool>());
      EXPECT_EQ(empty.coverage(torch::ones({views, points, 3}), pinhole(10, 3, 2), 5, 7).sum().item<int>(), 0);
    }
  }
}

TEST(RasterizerSizes, LargeTrianglesOnLargeAndTinyImages) {
  // Two triangles that fill any image, the second nearer on the right half.
  const Tensor vertices = torch::tensor({-50.f, -50.f, 1.f, 150.f, -50.f, 1.f, -50.f, 150.f, 1.f,  //
                                         0.f, -90.f, 0.9f, 90.f, -90.f, 0.9f, 0.f, 90.f, 0.9f})
                              .reshape({1, 6, 3});
  const Tensor faces = torch::arange(6, torch::kInt32).reshape({2, 3});
  Rasterizer rasterizer(faces);
  for (const std::int64_t size : {1, 2, 63, 64, 65, 129, 1000, 8200}) {
    const auto s = static_cast<double>(size);
    const RasterImage& image = rasterizer.rasterize(vertices, pinhole(s, s / 2, s / 2), size, size);
    EXPECT_GE(image.face_id.min().item<int>(), 0) << size;
    const Tensor row = image.face_id[0][size / 2];
    const Tensor centres = torch::arange(size, torch::kFloat64) + 0.5 - s / 2;
    EXPECT_TRUE(torch::equal(row, (centres >= 0).to(torch::kInt32))) << size;
    EXPECT_TRUE(test::is_near(image.depth[0][size / 2], torch::where(centres >= 0, 0.9, 1.0), 1e-6)) << size;
  }
}

TEST(RasterizerSizes, CoordinatesBeyondReasonDoNoHarm) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const Tensor vertices = torch::tensor({nan, 0.f, 1.f, 1.f, inf, 1.f, 0.f, 1.f, nan, 1e30f, 0.f, 1.f, 0.f, -1e30f,
                                         1.f, 0.f, 0.f, inf, 0.f, 0.f, 1.f, 1.f, 0.f, 1.f,   0.f, 1.f, 1.f})
                              .reshape({1, 9, 3});
  std::vector<std::int32_t> faces;
  for (int a = 0; a < 9; ++a) {
    for (int b = 0; b < 9; ++b) faces.insert(faces.end(), {a, b, (a * b + 1) % 9});
  }
  Rasterizer rasterizer(torch::tensor(faces, torch::kInt32).reshape({-1, 3}));
  const RasterImage& image = rasterizer.rasterize(vertices, pinhole(20, 10, 10), 33, 33);
  EXPECT_FALSE(torch::isnan(image.depth).any().item<bool>());
  EXPECT_FALSE(torch::isnan(image.barycentrics).any().item<bool>());
  EXPECT_GT((image.face_id >= 0).sum().item<int>(), 100);  // the sound triangle is there
}

TEST(RasterizerOp, IsTheSameThroughTheDispatcher) {
  const Mesh mesh = test::sphere(10, 0.4f);
  const Tensor vertices = (mesh.vertices + torch::tensor({0.0, 0.0, 1.5}).to(torch::kFloat32)).unsqueeze(0);
  const RasterImage expected = rasterize(vertices, pinhole(60, 30, 30), mesh.faces, 60, 61);
  const auto op = c10::Dispatcher::singleton().findSchemaOrThrow("doppel::rasterize", "");
  torch::jit::Stack stack{vertices, pinhole(60, 30, 30), mesh.faces.to(torch::kInt64), 60, 61, 0.01, false};
  op.callBoxed(&stack);
  EXPECT_TRUE(equal({stack[0].toTensor(), stack[1].toTensor(), stack[2].toTensor()}, expected));
}

TEST(RasterizerRejects, WrongShapesTypesAndIndices) {
  const Tensor face = torch::tensor({0, 1, 2}, torch::kInt32).reshape({1, 3});
  EXPECT_THROW(Rasterizer(torch::zeros({4, 4}, torch::kInt32)), Error);
  EXPECT_THROW(Rasterizer(torch::zeros({4, 3})), Error);
  EXPECT_THROW(Rasterizer(-face - 1), Error);
  EXPECT_THROW(Rasterizer(face, {0.0f, false}), Error);
  Rasterizer rasterizer(face);
  const Tensor points = torch::ones({2, 3, 3}), k = pinhole(10, 5, 5);
  EXPECT_THROW(rasterizer.rasterize(points.to(torch::kFloat64), k, 8, 8), Error);
  EXPECT_THROW(rasterizer.rasterize(points[0], k, 8, 8), Error);
  EXPECT_THROW(rasterizer.rasterize(points, torch::ones({3, 4}), 8, 8), Error);
  EXPECT_THROW(rasterizer.rasterize(points, k, 0, 8), Error);
  EXPECT_THROW(rasterizer.rasterize(points, k, 8, 20000), Error);
  EXPECT_THROW(rasterizer.rasterize(points.slice(1, 0, 2), k, 8, 8), Error);
  EXPECT_THROW(rasterizer.coverage_projected(points, torch::ones({1, 2, 3, 4}), 8, 8), Error);
}

}  // namespace
}  // namespace doppel::rasterizer_test
