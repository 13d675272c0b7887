#include "doppel/rigging/weights/heat_weights.h"

#include <gmock/gmock.h>

#include <functional>
#include <map>

#include "doppel/character/blend_skin.h"
#include "doppel/core/error.h"
#include "rigging/tubes.h"

namespace doppel::heat_weights_test {
namespace {

using Eigen::Vector3d;

using support::cylinder;

SolidGrid solid_of(const Vector3d& low, const Vector3d& high, double cell,
                   const std::function<bool(const Vector3d&)>& inside) {
  SolidGrid grid;
  grid.cell = cell;
  grid.origin = low + Vector3d::Constant(0.5 * cell);
  for (int k = 0; k < 3; ++k) grid.size[k] = static_cast<int>(std::lround((high[k] - low[k]) / cell));
  for (int z = 0; z < grid.size[2]; ++z)
    for (int y = 0; y < grid.size[1]; ++y)
      for (int x = 0; x < grid.size[0]; ++x) grid.inside.push_back(inside(grid.centre(x, y, z)) ? 1 : 0);
  return grid;
}

std::function<bool(const Vector3d&)> within_cylinder(double from, double to, double radius, double y = 0) {
  return [=](const Vector3d& p) { return p.x() > from && p.x() < to && std::hypot(p.y() - y, p.z()) < radius; };
}

/// The weights that a character keeps of the field.
SkinningWeights heat_weights(const TriangleMesh& mesh, const std::vector<HeatBone>& bones, const SolidGrid& solid) {
  std::vector<std::string> names;
  for (const HeatBone& bone : bones) names.push_back(bone.name);
  return sparse_weights(heat_field(mesh, bones, solid), names);
}

double weight_of(const SkinningWeights& skin, int vertex, int bone) {
  for (int k = skin.vertex_bones.offsets[vertex]; k < skin.vertex_bones.offsets[vertex + 1]; ++k)
    if (skin.vertex_bones.items[k] == bone) return skin.weights[k];
  return 0.0;
}

const std::vector<HeatBone> kTwoBones{{"a", {{Vector3d(-0.5, 0, 0), Vector3d(0, 0, 0)}}},
                                      {"b", {{Vector3d(0, 0, 0), Vector3d(0.5, 0, 0)}}}};
constexpr double kRadius = 0.05;

class BentCylinder : public ::testing::Test {
 protected:
  TriangleMesh mesh_ = cylinder(-0.5, 0.5, kRadius);
  SkinningWeights skin_ =
      heat_weights(mesh_, kTwoBones,
                   solid_of({-0.52, -0.08, -0.08}, {0.52, 0.08, 0.08}, 0.008, within_cylinder(-0.5, 0.5, kRadius)));
};

TEST_F(BentCylinder, WeightsSumToOneAndAreSortedAndPositive) {
  ASSERT_EQ(skin_.num_vertices(), mesh_.num_vertices());
  EXPECT_THAT(skin_.bones, ::testing::ElementsAre("a", "b"));
  for (int v = 0; v < skin_.num_vertices(); ++v) {
    double sum = 0, before = 1;
    for (const double w : skin_.vertex_bones.row_of(skin_.weights, v)) {
      EXPECT_GT(w, 0.0);
      EXPECT_LE(w, before);
      before = w;
      sum += w;
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
}

TEST_F(BentCylinder, WeightsAreSymmetricAndFallWithTheDistance) {
  for (int v = 0; v < mesh_.num_vertices(); ++v) {
    const double x = mesh_.vertices[v].x(), b = weight_of(skin_, v, 1);
    if (std::abs(x) < 1e-9) {
      EXPECT_NEAR(b, 0.5, 0.01);
    }
    if (x > 2.5 * kRadius) {
      EXPECT_GT(b, 0.98) << x;
    }
    if (x < -2.5 * kRadius) {
      EXPECT_LT(b, 0.02) << x;
    }
  }
  // Ring i has its mirror image at ring 100 - i.
  for (int i = 0; i <= 50; ++i)
    for (int k = 0; k < 32; ++k)
      EXPECT_NEAR(weight_of(skin_, 32 * i + k, 1), weight_of(skin_, 32 * (100 - i) + k, 0), 0.01) << i << " " << k;
  for (int i = 0; i < 100; ++i) EXPECT_LE(weight_of(skin_, 32 * i, 1), weight_of(skin_, 32 * (i + 1), 1) + 1e-6);
}

TEST_F(BentCylinder, AnElbowOf90DegreesKeepsItsVolume) {
  const Eigen::Affine3d bent(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitZ()));
  const std::vector<Eigen::Affine3d> motions{Eigen::Affine3d::Identity(), bent};
  const double joint = 4 * kRadius * M_PI * kRadius * kRadius;  // of two radii on both sides
  const double before = support::volume(mesh_.vertices, mesh_.faces);
  for (const bool dual : {false, true}) {
    const SkinningMode mode = dual ? SkinningMode::dual_quaternion : SkinningMode::linear;
    const std::vector<Vector3d> posed = SkinBlend(motions, mode).vertices(mesh_.vertices, skin_);
    const double lost = (before - support::volume(posed, mesh_.faces)) / joint;
    EXPECT_LT(std::abs(lost), 0.12) << (dual ? "dual quaternions" : "linear");
    RecordProperty(dual ? "lost_dual" : "lost_linear", std::to_string(lost));
  }
}

/// The largest weight that a cylinder has of the bone in a second cylinder beside it.
double bleeding(double gap, double cell) {
  const double away = 2 * kRadius + gap;
  TriangleMesh mesh = cylinder(-0.3, 0.3, kRadius);
  const TriangleMesh other = cylinder(-0.3, 0.3, kRadius, {0, away, 0});
  const int n = mesh.num_vertices();
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const Triangle& f : other.faces) mesh.faces.push_back({f[0] + n, f[1] + n, f[2] + n});
  const auto first = within_cylinder(-0.3, 0.3, kRadius), second = within_cylinder(-0.3, 0.3, kRadius, away);
  const SolidGrid solid = solid_of({-0.32, -0.08, -0.08}, {0.32, 0.24, 0.08}, cell,
                                   [&](const Vector3d& p) { return first(p) || second(p); });
  // The second bone is short: most of the second cylinder lies nearer to the first bone than to its own.
  const SkinningWeights skin = heat_weights(mesh,
                                            {{"a", {{Vector3d(-0.3, 0, 0), Vector3d(0.3, 0, 0)}}},
                                             {"b", {{Vector3d(-0.3, away, 0), Vector3d(-0.2, away, 0)}}}},
                                            solid);
  double most = 0;
  for (int v = 0; v < mesh.num_vertices(); ++v) most = std::max(most, weight_of(skin, v, v < n ? 1 : 0));
  return most;
}

TEST(HeatWeights, CloseParallelCylindersDoNotBleed) { EXPECT_LT(bleeding(0.012, 0.008), 0.01); }

TEST(HeatWeights, AGapNarrowerThanACellDoesNotBleed) { EXPECT_LT(bleeding(0.003, 0.008), 0.05); }

TEST(HeatWeights, PartsThatTouchNothingTakeTheWeightsOfTheNearestBody) {
  TriangleMesh mesh = cylinder(-0.5, 0.5, kRadius);
  const int n = mesh.num_vertices();
  // A button two centimetres above the surface, beyond the solid, at the middle of bone b.
  for (const Vector3d& p : {Vector3d(0.3, 0.07, 0), Vector3d(0.31, 0.07, 0), Vector3d(0.3, 0.07, 0.01)})
    mesh.vertices.push_back(p);
  mesh.faces.push_back({n, n + 1, n + 2});
  const SolidGrid solid =
      solid_of({-0.52, -0.08, -0.08}, {0.52, 0.08, 0.08}, 0.01, within_cylinder(-0.5, 0.5, kRadius));
  const SkinningWeights skin = heat_weights(mesh, kTwoBones, solid);
  for (int v = n; v < n + 3; ++v) EXPECT_GT(weight_of(skin, v, 1), 0.95);
}

TEST(HeatWeights, HolesAndSeamsDoNotShow) {
  const TriangleMesh whole = cylinder(-0.5, 0.5, kRadius);
  TriangleMesh torn = whole;
  torn.faces.resize(torn.faces.size() * 3 / 4);  // an open end
  // A seam: the second half has vertices of its own.
  std::map<int, int> twin;
  for (std::size_t f = torn.faces.size() / 2; f < torn.faces.size(); ++f)
    for (int& v : torn.faces[f]) {
      if (!twin.count(v)) {
        twin[v] = torn.num_vertices();
        torn.vertices.push_back(torn.vertices[v]);
      }
      v = twin[v];
    }
  const SolidGrid solid =
      solid_of({-0.52, -0.08, -0.08}, {0.52, 0.08, 0.08}, 0.01, within_cylinder(-0.5, 0.5, kRadius));
  const SkinningWeights skin = heat_weights(torn, kTwoBones, solid), complete = heat_weights(whole, kTwoBones, solid);
  for (const auto& [v, copy] : twin) EXPECT_DOUBLE_EQ(weight_of(skin, v, 1), weight_of(skin, copy, 1));
  for (int v = 0; v < whole.num_vertices(); ++v)
    EXPECT_NEAR(weight_of(skin, v, 1), weight_of(complete, v, 1), 0.02) << v;
}

TEST(HeatWeights, ABlendHasTheSixLargestWeightsOfAHundredthAndMore) {
  WeightField field(2, 8);
  field << 0.05F, 0.1F, 0.1F, 0.1F, 0.1F, 0.1F, 0.1F, 0.35F, 0, 0, 0, 0, 0, 0.5F, 0.495F, 0.005F;
  const SkinningWeights skin = sparse_weights(field, {"a", "b", "c", "d", "e", "f", "g", "h"});
  EXPECT_EQ(skin.vertex_bones.items, (std::vector<int>{7, 1, 2, 3, 4, 5, 5, 6}));
  EXPECT_NEAR(skin.weights[0], 0.35 / 0.85, 1e-6);
}

TEST(HeatWeights, RefusesNothingToHeat) {
  const TriangleMesh mesh = cylinder(-0.1, 0.1, kRadius);
  const SolidGrid solid = solid_of({-0.2, -0.08, -0.08}, {0.2, 0.08, 0.08}, 0.01, within_cylinder(-0.1, 0.1, kRadius));
  SolidGrid empty = solid;
  empty.inside.assign(empty.inside.size(), 0);
  EXPECT_THROW(heat_weights(mesh, {}, solid), Error);
  EXPECT_THROW(heat_weights(mesh, {{"a", {}}}, solid), Error);
  EXPECT_THROW(heat_weights(mesh, kTwoBones, empty), Error);
}

}  // namespace
}  // namespace doppel::heat_weights_test
