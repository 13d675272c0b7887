#include <gtest/gtest.h>

#include <cmath>

#include "doppel/character/blend_skin.h"
#include "doppel/io/figure_export/figure_clip.h"
#include "support/test_character.h"

namespace doppel::rest_vertices_test {
namespace {

/// A clip of a surface two centimetres beside the template, skinned linearly.
struct Beside {
  const Character& character = test_actor();
  Figure figure = make_figure(character, BoneNames::skeletool);
  std::vector<Eigen::Vector3d> rest = character.mesh.vertices;
  FigureClip clip;

  Beside() {
    for (std::size_t v = 0; v < rest.size(); ++v)
      rest[v] +=
          0.02 * Eigen::Vector3d(std::sin(1.0 * static_cast<double>(v)), 0.3, std::cos(1.0 * static_cast<double>(v)));
    for (int t = 0; t < 12; ++t) {
      std::vector<double> dofs = character.rest_dofs;
      for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += 0.2 * std::sin(0.3 * t + static_cast<double>(d));
      clip.dofs.push_back(dofs);
      std::vector<float> values;
      const SkinBlend skin(bone_motions(character, dofs), SkinningMode::linear);
      for (const Eigen::Vector3d& vertex : skin.vertices(rest, character.skin))
        for (const double value : vertex) values.push_back(static_cast<float>(value));
      clip.vertices.push_back(values);
    }
  }
};

TEST(FittedRestVertices, AreThoseThatTheClipWasMadeFrom) {
  const Beside beside;
  const auto found = fitted_rest_vertices(beside.figure, beside.character.skeleton, beside.clip);
  ASSERT_EQ(found.size(), beside.rest.size());
  for (std::size_t v = 0; v < found.size(); ++v)
    EXPECT_LT((found[v] - beside.rest[v]).norm(), 2e-4) << v;  // the damping: a hundredth of the 2 cm
}

TEST(FittedRestVertices, AreTheTemplateWithoutFrames) {
  const Beside beside;
  EXPECT_EQ(fitted_rest_vertices(beside.figure, beside.character.skeleton, FigureClip()),
            beside.character.mesh.vertices);
}

}  // namespace
}  // namespace doppel::rest_vertices_test
