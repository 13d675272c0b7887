#include "doppel/synth/other_body.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/data/capture/capture.h"
#include "doppel/rigging/body/girths.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/posed_body.h"
#include "doppel/synth/synth.h"
#include "doppel/synth/xpbd_cloth.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::other_body_test {
namespace {

using Eigen::Vector3d;
using synth::Actor;
using testing::HasSubstr;

const Actor& own_actor() {
  static const Actor kActor = synth::make_actor(synth::SynthOptions::preset("tiny").actor);
  return kActor;
}

Actor actor_with(std::vector<double> measures) {
  Actor actor = own_actor();
  synth::give_body(actor, measures);
  return actor;
}

double height(const Actor& actor) {
  double top = 0;
  for (const Vector3d& p : actor.character.mesh.vertices) top = std::max(top, p.y());
  return top;
}

/// Position of a joint in the rest pose.
Vector3d joint_of(const Actor& actor, const char* name) {
  const Skeleton& skeleton = actor.character.skeleton;
  return skeleton.pose(actor.character.rest_dofs)[*skeleton.find_joint(name)].translation();
}

double bone(const Actor& actor, const char* from, const char* to) {
  return (joint_of(actor, to) - joint_of(actor, from)).norm();
}

TEST(OtherBody, HasTheLengthsOfTheMeasures) {
  for (const std::uint64_t seed : {2u, 5u, 11u}) {
    const std::vector<double> m = random_measures(seed);
    const Actor actor = actor_with(m);
    const auto measure = [&](const char* name) { return m[measure_index(name)]; };
    EXPECT_NEAR(bone(actor, "LeftArm_rz", "LeftForeArm_rx"), measure("upper_arm_length"), 1e-9);
    EXPECT_NEAR(bone(actor, "RightForeArm_rx", "RightForeArmEE"), measure("forearm_length"), 1e-9);
    EXPECT_NEAR(bone(actor, "LeftUpLeg_rx", "LeftLeg_rx"), measure("thigh_length"), 1e-9);
    EXPECT_NEAR(bone(actor, "RightLeg_rx", "RightFoot_rx"), measure("shin_length"), 1e-9);
    EXPECT_NEAR(bone(actor, "LeftArm_rz", "RightArm_rz"), measure("shoulder_breadth"), 1e-9);
    EXPECT_NEAR(joint_of(actor, "LeftFoot_rx").y(), measure("ankle_height"), 1e-9);
  }
}

TEST(OtherBody, StandsOnTheGroundWithTheTopologyOfTheActor) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Actor actor = actor_with(random_measures(seed));
    EXPECT_EQ(actor.character.fingerprint(), own_actor().character.fingerprint());
    double lowest = 1;
    for (const Vector3d& p : actor.character.mesh.vertices) lowest = std::min(lowest, p.y());
    EXPECT_NEAR(lowest, 0, 0.01) << "seed " << seed << "; the actor itself is right to 10 mm with so few vertices";
    const TriangleMesh &before = own_actor().character.mesh, &after = actor.character.mesh;
    int over = 0;
    for (const Triangle& f : after.faces) {
      const auto normal = [&](const TriangleMesh& mesh) {
        return Vector3d((mesh.vertices[f[1]] - mesh.vertices[f[0]]).cross(mesh.vertices[f[2]] - mesh.vertices[f[0]]));
      };
      over += normal(before).dot(normal(after)) < 0;
    }
    EXPECT_LE(over, 2) << "seed " << seed << ", in the folds between skirt and legs";
  }
}

TEST(OtherBody, WithTheActorsMeasuresIsTheActor) {
  const Actor& own = own_actor();
  const Actor same = actor_with(synth::actor_measures());
  for (int v = 0; v < own.character.num_vertices(); ++v)
    ASSERT_NEAR((same.character.mesh.vertices[v] - own.character.mesh.vertices[v]).norm(), 0, 1e-9);
  for (std::size_t k = 0; k < own.character.skeleton.markers.size(); ++k)
    EXPECT_NEAR((same.character.skeleton.markers[k].position - own.character.skeleton.markers[k].position).norm(), 0,
                1e-9);
}

TEST(OtherBody, HeavyAndTallPeopleDiffer) {
  std::vector<double> heavy = mean_measures(), tall = mean_measures();
  for (const char* name : {"waist_girth", "belly_depth", "hip_girth", "chest_girth", "chest_depth"})
    heavy[measure_index(name)] *= 1.3;
  for (const char* name : {"thigh_length", "shin_length", "trunk_length"}) tall[measure_index(name)] *= 1.1;
  const Actor average = actor_with(mean_measures()), big = actor_with(heavy), long_one = actor_with(tall);
  EXPECT_NEAR(height(big), height(average), 0.005);
  EXPECT_GT(height(long_one), height(average) + 0.1);
  const auto girth = [](const Actor& actor) {
    const double y = joint_of(actor, "LeftUpLeg_rx").y();
    const double chest = y + 0.6 * (joint_of(actor, "Head_ry").y() - y);
    const TriangleMesh& mesh = actor.character.mesh;
    return loop_length(nearest_section(mesh, {0, chest, 0}, Vector3d::UnitY()), mesh.vertices);
  };
  EXPECT_NEAR(girth(big) / girth(average), 1.3, 0.08);
  EXPECT_NEAR(girth(long_one) / girth(average), 1.0, 0.04);
}

/// Height of the lowest vertex in the frames of a motion, which is made for the actor's skeleton.
std::vector<double> soles(const Actor& actor) {
  const Motion motion = synth::make_motion(actor.character.skeleton, 60, 25, 3);
  std::vector<double> heights;
  for (const synth::Points& frame : synth::skin_motion(actor.character, motion, {})) {
    heights.push_back(1);
    for (const Vector3d& p : frame) heights.back() = std::min(heights.back(), p.y());
  }
  return heights;
}

TEST(OtherBody, KeepsItsSolesOnTheFloorAsTheActorDoes) {
  const std::vector<double> own = soles(own_actor());
  for (const std::uint64_t seed : {4u, 5u, 11u}) {
    const std::vector<double> other = soles(actor_with(random_measures(seed)));
    for (std::size_t f = 0; f < own.size(); ++f) EXPECT_NEAR(other[f], own[f], 0.02) << "seed " << seed << ", " << f;
  }
}

TEST(OtherBody, IsNamedByAWord) {
  EXPECT_EQ(synth::measures_of("average"), mean_measures());
  EXPECT_EQ(synth::measures_of("random:7"), random_measures(7));
  for (const char* wrong : {"", "random", "random:", "random:x", "random:7x", "random:-1", "woman"})
    EXPECT_THAT(support::message_of<UsageError>([&] { synth::measures_of(wrong); }), HasSubstr("random:7")) << wrong;
}

synth::SynthOptions short_capture(const std::string& body) {
  synth::SynthOptions o = synth::SynthOptions::preset("tiny");
  o.cameras = 2;
  o.size = 96;
  o.frames = 6;
  o.test_frames = 4;
  o.body = body;
  return o;
}

TEST(OtherBody, IsFilmedAsPlausiblyAsTheActor) {
  const support::TemporaryFolder folder;
  const double own =
      synth::write_synthetic_capture(folder / "own", short_capture(synth::kOwnBody)).value().skinning_iou;
  for (const char* body : {"random:2", "random:5"}) {
    const synth::SynthReport report = synth::write_synthetic_capture(folder / body, short_capture(body)).value();
    EXPECT_NEAR(report.skinning_iou, own, 0.05) << body;
    const Character written = load_character(folder / body / "character" / "actor.character");
    EXPECT_NEAR((written.mesh.vertices[0] - actor_with(synth::measures_of(body)).character.mesh.vertices[0]).norm(), 0,
                1e-5);
  }
}

TEST(OtherBody, IsWhereItsPartsSayForContact) {
  const Actor own = own_actor();
  for (const std::uint64_t seed : {2u, 5u, 11u}) {
    const Actor other = actor_with(random_measures(seed));
    ASSERT_EQ(other.own_rest, own.character.mesh.vertices);
    const synth::PosedBody own_body(own), body(other);
    // Distances of shoes, hands and trousers below the skirt, which no part of the clothes covers.
    double farthest = 0, moved = 0;
    for (int v = 0; v < own.character.num_vertices(); ++v) {
      const Vector3d &before = own.character.mesh.vertices[v], &now = other.character.mesh.vertices[v];
      const int label = own.character.labels[v];
      const bool below_skirt = label == 9 && before.y() < 0.45;
      if (!below_skirt && label != 18 && label != 19) continue;
      farthest = std::max(farthest, std::abs(body.distance(now) - own_body.distance(before)));
      moved = std::max(moved, std::abs(own_body.distance(now)));
    }
    EXPECT_LT(farthest, 0.012) << "of seed " << seed;
    EXPECT_GT(moved, 2 * farthest) << "the measures do not test the warp of seed " << seed;
  }
}

TEST(OtherBody, WearsClothThatStaysOutOfIt) {
  const Actor actor = actor_with(random_measures(5));
  // She stands, then raises a thigh under the skirt.
  Motion motion;
  const int lead = synth::lead_in(25), thigh = *actor.character.skeleton.find_dof("LeftUpLeg_rx");
  for (int f = 0; f < lead + 20; ++f) {
    motion.frames.push_back(actor.character.rest_dofs);
    motion.frames.back()[thigh] = 1.2 * std::clamp((f - lead) / 12.0, 0.0, 1.0);
    motion.ids.push_back(f);
  }
  const synth::Take take = synth::perform(actor, motion, 25, {synth::ClothModel::xpbd, {}});
  const std::vector<synth::Points> rigid = synth::skin_motion(actor.character, take.motion, {});
  const std::vector<synth::ClothRole> roles = synth::cloth_roles(actor, synth::XpbdOptions{}.pinned);
  EXPECT_EQ(roles, synth::cloth_roles(own_actor(), synth::XpbdOptions{}.pinned));
  synth::PosedBody body(actor);
  double deepest = 0, skinned = 0;
  for (std::size_t f = 0; f < take.ground_truth.size(); ++f) {
    body.move(take.motion.frames[f]);
    for (std::size_t v = 0; v < roles.size(); ++v) {
      if (roles[v] != synth::ClothRole::woven) continue;
      deepest = std::max(deepest, -body.distance(take.ground_truth[f][v]));
      skinned = std::max(skinned, -body.distance(rigid[f][v]));
    }
  }
  EXPECT_LT(deepest, 0.004);
  EXPECT_GT(skinned, 0.01) << "the motion does not test the contact";
}

}  // namespace
}  // namespace doppel::other_body_test
