#include "doppel/render/outline/seen_vertices.h"

#include <gtest/gtest.h>
#include <torch/types.h>

namespace doppel::seen_vertices_test {
namespace {

using torch::Tensor;

TEST(SeenVertices, AreCornersOfDrawnFacesThatFaceTheCamera) {
  // A tent: two faces look up along z, a third hangs from their ridge and looks down; nothing has vertex 5.
  const Tensor vertices = torch::tensor(
      {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {1.0, 1.0, 0.0}, {1.0, 2.0, -0.2}, {5.0, 5.0, 5.0}},
      torch::kFloat64);
  const Tensor faces = torch::tensor({{0, 1, 2}, {1, 3, 2}, {3, 2, 4}}, torch::kInt64);
  const Tensor face_id = torch::tensor({{-1, 0}, {0, 2}}, torch::kInt32);
  const auto seen = [&](double z, double min_facing = 0.0) {
    const Tensor eye = torch::tensor({0.5, 0.5, z}, torch::kFloat64);
    return seen_vertices(face_id, faces, vertices, eye, min_facing);
  };
  EXPECT_TRUE(seen(3.0)[0].item<bool>() && seen(3.0)[1].item<bool>());
  EXPECT_FALSE(seen(3.0)[4].item<bool>());  // its only face looks away
  EXPECT_FALSE(seen(3.0)[5].item<bool>());
  EXPECT_TRUE(seen(-3.0)[4].item<bool>());
  EXPECT_FALSE(seen(-3.0)[0].item<bool>());
  EXPECT_TRUE(seen(0.1)[0].item<bool>());
  EXPECT_FALSE(seen(0.1, 0.2)[0].item<bool>());  // at a slant
  const Tensor nothing = torch::full({2, 2}, -1, torch::kInt32);
  EXPECT_FALSE(seen_vertices(nothing, faces, vertices, vertices[0]).any().item<bool>());
}

}  // namespace
}  // namespace doppel::seen_vertices_test
