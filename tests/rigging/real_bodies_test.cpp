#include <fmt/format.h>
#include <gmock/gmock.h>

#include <iostream>
#include <random>

#include "doppel/core/statistics.h"
#include "doppel/rigging/body_skeleton.h"
#include "doppel/rigging/make_character.h"
#include "doppel/rigging/place_inside.h"
#include "doppel/rigging/solid_surface.h"
#include "rigging/rigged_bodies.h"
#include "rigging/skinning_in_double.h"
#include "support/shared_folder.h"

namespace doppel::real_bodies_test {
namespace {

using Eigen::Vector3d;

class RealBodies : public support::SharedFolderTest, public ::testing::WithParamInterface<std::string> {
 protected:
  support::RiggedBody read(double cell = 0.01) const {
    return support::read_rigged_body(shared_ / "bodies", GetParam(), cell);
  }
};

/// Distances in millimetres to the vertices that the body's own rig poses.
std::vector<double> skin_check_errors(const support::RiggedBody& body, const SkinningWeights& skin) {
  const auto motions = support::skin_check_motions(body);
  support::Motions by_bone;
  for (const std::string& bone : skin.bones) by_bone.push_back(motions.at(bone));
  const auto ids = read_npy(body.folder / "skin_check_ids.npy").as<std::int64_t>();
  const auto truth = read_npy(body.folder / "skin_check_posed.npy").as<double>();
  const auto posed = support::blend_linear(body.mesh.vertices, skin, by_bone);
  std::vector<double> errors;
  for (std::size_t i = 0; i < ids.size(); ++i)
    errors.push_back(1e3 * (posed[ids[i]] - Vector3d(truth[3 * i], truth[3 * i + 1], truth[3 * i + 2])).norm());
  return errors;
}

/// Pairs of bones that share no joint: a vertex that has both, each with much weight, sticks.
bool are_far_apart(const std::string& a, const std::string& b) {
  const auto limb = [](const std::string& bone) {
    const bool arm = bone.ends_with("Arm") || bone.ends_with("ForeArmRoll") || bone.ends_with("Hand");
    const bool leg = bone.ends_with("Leg") || bone.ends_with("Foot") || bone.ends_with("ToeBase");
    if (!arm && !leg) return std::string();
    return (bone.starts_with("Left") ? "left" : "right") + std::string(arm ? "arm" : "leg");
  };
  const auto forearm = [](const std::string& bone) {
    return bone.find("ForeArm") != std::string::npos || bone.ends_with("Hand");
  };
  const auto trunk = [](const std::string& bone) {
    return bone == "Root" || bone == "Spine" || bone == "Chest" || bone == "Spine1";
  };
  const auto shin = [](const std::string& bone) { return bone.ends_with("tLeg") || bone.ends_with("Foot"); };
  if (!limb(a).empty() && !limb(b).empty() && limb(a) != limb(b)) return !a.ends_with("UpLeg") || !b.ends_with("UpLeg");
  return (forearm(a) && trunk(b)) || (forearm(b) && trunk(a)) || (shin(a) && trunk(b)) || (shin(b) && trunk(a));
}

int sticking_vertices(const SkinningWeights& skin) {
  int count = 0;
  for (int v = 0; v < skin.num_vertices(); ++v) {
    bool sticks = false;
    for (int i = skin.vertex_bones.offsets[v]; i < skin.vertex_bones.offsets[v + 1]; ++i)
      for (int j = skin.vertex_bones.offsets[v]; j < i; ++j)
        sticks =
            sticks || (std::min(skin.weights[i], skin.weights[j]) > 0.2 &&
                       are_far_apart(skin.bones[skin.vertex_bones.items[i]], skin.bones[skin.vertex_bones.items[j]]));
    count += sticks;
  }
  return count;
}

using Pose = std::vector<std::pair<std::string, double>>;
/// `Side` stands for both sides.
const std::vector<std::pair<std::string, Pose>> kExtremePoses{
    {"arms up",
     {{"SideShoulder_rz", 0.4}, {"SideArm_rz", 1.4}, {"SideArm_ry", 0.1}, {"SideArm_rx", 0}, {"SideForeArm_ry", 0.1}}},
    {"arms forward, elbows 120 degrees",
     {{"SideArm_rz", 0}, {"SideArm_ry", 1.4}, {"SideArm_rx", 0}, {"SideForeArm_ry", 2.09}}},
    {"squat",
     {{"SideUpLeg_rx", 1.9}, {"SideUpLeg_rz", 0.35}, {"SideLeg_rx", 2.2}, {"SideFoot_rx", 0.4}, {"Spine_rx", 0.5}}},
    {"kick", {{"LeftUpLeg_rx", 1.6}, {"LeftLeg_rx", 0.05}, {"RightUpLeg_rx", -0.2}}},
    {"twist", {{"Spine_ry", 0.8}, {"Head_ry", 1.0}}}};

std::vector<double> pose_dofs(const Character& character, const Pose& pose) {
  std::vector<double> dofs = character.rest_dofs;
  for (const auto& [name, value] : pose)
    for (const std::string side : {"Left", "Right"})
      dofs[*character.skeleton.find_dof(name.starts_with("Side") ? side + name.substr(4) : name)] = value;
  return dofs;
}

support::Motions bone_motions(const Character& character, const std::vector<double>& dofs) {
  const auto rest = character.skeleton.pose(character.rest_dofs), posed = character.skeleton.pose(dofs);
  support::Motions motions;
  for (const int joint : character.bone_joint) motions.push_back(posed[joint] * rest[joint].inverse());
  return motions;
}

struct Stretches {
  int more_than_3 = 0, alone = 0;  ///< alone: no neighbour stretches half as much
  double largest = 0, quantile_999 = 0;
};

Stretches measure_stretches(const Character& character, const Pose& pose) {
  const TriangleMesh& mesh = character.mesh;
  const auto posed = support::blend_dual_quaternions(mesh.vertices, character.skin,
                                                     bone_motions(character, pose_dofs(character, pose)));
  std::vector<double> stretch;
  std::map<std::array<int, 2>, std::vector<int>> faces_of_edge;
  for (int f = 0; f < mesh.num_faces(); ++f) {
    const Triangle& t = mesh.faces[f];
    stretch.push_back(support::stretch({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]},
                                       {posed[t[0]], posed[t[1]], posed[t[2]]}));
    for (int k = 0; k < 3; ++k)
      faces_of_edge[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}].push_back(f);
  }
  Stretches result;
  for (int f = 0; f < mesh.num_faces(); ++f) {
    if (stretch[f] <= 3) continue;
    ++result.more_than_3;
    double around = 0;
    const Triangle& t = mesh.faces[f];
    for (int k = 0; k < 3; ++k)
      for (const int other : faces_of_edge[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}])
        if (other != f) around = std::max(around, stretch[other]);
    result.alone += around < 0.5 * stretch[f];
  }
  result.largest = *std::max_element(stretch.begin(), stretch.end());
  result.quantile_999 = quantile(stretch, 0.999);
  return result;
}

TEST_P(RealBodies, BendLikeTheirOwnRig) {
  const support::RiggedBody body = read();
  const Character character = make_character(body.name, body.mesh, body.joints, body.solid);
  const std::vector<double> errors = skin_check_errors(body, character.skin);
  const int sticking = sticking_vertices(character.skin);
  std::cout << fmt::format(
      "{}: skin_check mean {:.1f} mm, 95 % {:.1f} mm, sticking {} of {}, graph {} nodes {} edges\n", body.name,
      mean_of(errors), quantile(errors, 0.95), sticking, character.num_vertices(), character.num_nodes(),
      character.graph.edges.size());
  EXPECT_LT(mean_of(errors), 3.0);
  EXPECT_LT(quantile(errors, 0.95), 20.0);
  EXPECT_LT(sticking, character.num_vertices() / 200);
  EXPECT_LT(skeleton_distance(character), kSkeletonOffTemplate);
  EXPECT_NEAR(character.num_nodes(), 500, 30);
  for (const auto& [name, pose] : kExtremePoses) {
    const Stretches stretches = measure_stretches(character, pose);
    std::cout << fmt::format(
        "  {}: {} of {} triangles stretch more than 3 times, {} alone; largest {:.1f}, 99.9 % {:.1f}\n", name,
        stretches.more_than_3, character.mesh.num_faces(), stretches.alone, stretches.largest, stretches.quantile_999);
    EXPECT_LE(stretches.alone, character.mesh.num_faces() / 2000) << name;
    EXPECT_LT(stretches.more_than_3, character.mesh.num_faces() / 50) << name;
  }
}

TEST_P(RealBodies, HaveMarkersAndLabelsWhereTheyBelong) {
  const support::RiggedBody body = read(0.02);
  const Character character = make_character(body.name, body.mesh, body.joints, body.solid);
  const auto rest = character.skeleton.pose(character.rest_dofs);
  std::map<std::string, Vector3d> place;
  for (const Marker& marker : character.skeleton.markers) place[marker.name] = rest[marker.joint] * marker.position;
  const double trunk = (body.joints.at("neck") - body.joints.at("pelvis")).norm();
  // All bodies of this folder look along +z.
  EXPECT_GT(place["nose"].z(), body.joints.at("head").z() + 0.1 * trunk);
  EXPECT_GT(place["nose"].y(), body.joints.at("neck").y());
  EXPECT_GT(place["left_eye"].y(), place["nose"].y());
  EXPECT_LT(place["left_eye"].y(), place["head_top"].y());
  EXPECT_GT(place["left_ear"].x(), place["left_eye"].x());
  EXPECT_LT(place["left_ear"].z(), place["nose"].z());
  EXPECT_LT(place["face-8"].y(), place["left_mouth"].y());
  for (const std::string side : {"left_", "right_"}) {
    EXPECT_GT(place[side + "big_toe"].z(), place[side + "ankle"].z() + 0.1 * trunk) << side;
    EXPECT_LT(place[side + "heel"].z(), place[side + "ankle"].z() + 0.05 * trunk) << side;
    EXPECT_LT(place[side + "heel"].y(), 0.15 * trunk) << side;
    const double out = side == "left_" ? 1 : -1;
    EXPECT_GT(out * (place[side + "small_toe"].x() - place[side + "big_toe"].x()), 0.02 * trunk) << side;
  }
  std::map<int, Vector3d> sum;
  std::map<int, int> count;
  for (int v = 0; v < character.num_vertices(); ++v) {
    sum.emplace(character.labels[v], Vector3d::Zero()).first->second += character.mesh.vertices[v];
    ++count[character.labels[v]];
  }
  const auto middle = [&](int label) { return Vector3d(sum[label] / std::max(count[label], 1)); };
  for (const int label : {2, 5, 9, 13, 14, 15, 18, 19}) EXPECT_GT(count[label], 0) << label;
  EXPECT_GT(middle(13).z(), middle(2).z());               // the face is in front of the hair
  EXPECT_GT(middle(14).x(), middle(15).x() + trunk / 2);  // left and right forearm
  EXPECT_GT(middle(18).x(), middle(19).x());
  EXPECT_LT(middle(18).y(), 0.2 * trunk);
  EXPECT_LT(middle(9).y(), middle(5).y());
}

TEST_P(RealBodies, PosesOfTheSameDofsLookTheSame) {
  const support::RiggedBody body = read(0.02);
  const BodySkeleton skeleton = make_body_skeleton(body.joints);
  Character character;
  character.skeleton = skeleton.skeleton;
  character.rest_dofs = skeleton.rest_dofs;
  const auto place = [&](const Pose& pose, const std::string& joint) {
    const auto all = character.skeleton.pose(pose_dofs(character, pose));
    return Vector3d(all[*character.skeleton.find_joint(joint)].translation());
  };
  const double trunk = (body.joints.at("neck") - body.joints.at("pelvis")).norm();
  for (const std::string side : {"Left", "Right"}) {
    const Pose &up = kExtremePoses[0].second, &forward = kExtremePoses[1].second, &squat = kExtremePoses[2].second;
    EXPECT_GT(place(up, side + "Hand_ry").y(), place(up, "Head_rx").y() + 0.3 * trunk);
    EXPECT_GT(place(forward, side + "ForeArm_ry").z(), place(forward, side + "Arm_rx").z() + 0.3 * trunk);
    EXPECT_LT((place(forward, side + "Hand_ry") - place(forward, side + "Arm_rx")).norm(), 0.75 * trunk);
    EXPECT_LT(place(squat, "Root_rx").y() - place(squat, side + "Foot_rz").y(), 1.2 * trunk);
    EXPECT_GT(place(squat, side + "Leg_rx").z(), place(squat, "Root_rx").z() + 0.4 * trunk);
  }
}

INSTANTIATE_TEST_SUITE_P(Real, RealBodies, ::testing::ValuesIn(support::kRealisticBodies));

class RealPlacement : public support::SharedFolderTest {};

TEST_F(RealPlacement, ImprovesDisturbedJointsAndKeepsGoodOnes) {
  const std::vector<double> kNoise{0.0, 0.015, 0.03, 0.05};
  const std::vector<double> kAllowed{0.002, 0.015, 0.02, 0.024};
  std::map<double, std::vector<double>> errors;
  for (const std::string& name : support::kRealisticBodies) {
    const support::RiggedBody body = support::read_rigged_body(shared_ / "bodies", name);
    for (const double noise : kNoise)
      for (unsigned seed = 0; seed < (noise == 0 ? 1u : 4u); ++seed) {
        std::mt19937 random(seed);
        std::normal_distribution<double> normal;
        BodyJoints joints = body.joints;
        for (auto& entry : joints.positions)
          entry.second += noise * Vector3d(normal(random), normal(random), normal(random)).normalized();
        const Placement placement = place_inside(joints, body.solid);
        EXPECT_LE(placement.outside_after, placement.outside_before);
        for (const std::string part : {"elbow", "wrist", "knee", "ankle"})
          for (const std::string side : {"left_", "right_"})
            errors[noise].push_back((joints.at(side + part) - body.joints.at(side + part)).norm());
      }
  }
  for (std::size_t i = 0; i < kNoise.size(); ++i) {
    const double after = median(errors[kNoise[i]]);
    std::cout << fmt::format(
        "noise {:.0f} mm: median error of elbows, wrists, knees, ankles {:.1f} mm, 95 % {:.1f} mm\n", 1e3 * kNoise[i],
        1e3 * after, 1e3 * quantile(errors[kNoise[i]], 0.95));
    EXPECT_LE(after, kAllowed[i]) << kNoise[i];
  }
}

class RealScans : public support::SharedFolderTest, public ::testing::WithParamInterface<std::string> {};

TEST_P(RealScans, OfOneSurfaceBecomeCharacters) {
  const auto folder = shared_ / "bodies" / GetParam();
  nlohmann::json truth;
  std::ifstream(folder / "scan_truth.json") >> truth;
  Eigen::Affine3d scan_from_body;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) scan_from_body.matrix()(r, c) = truth["scan_from_body"][r][c].get<double>();
  TriangleMesh mesh = read_obj(folder / "scan.obj", 1.0);
  const Eigen::Affine3d body_from_scan = scan_from_body.inverse();
  for (Vector3d& p : mesh.vertices) p = body_from_scan * p;
  BodyJoints joints = support::true_joints(truth["landmarks"], 1.0);
  for (auto& entry : joints.positions) entry.second = body_from_scan * entry.second;
  VoxelSolidOptions options;
  options.cell = 0.01;
  const Character character = make_character("scan", mesh, joints, solid_grid(VoxelSolid(mesh, options)));
  const int sticking = sticking_vertices(character.skin);
  std::cout << fmt::format("{}: {} vertices, {} stick\n", GetParam(), character.num_vertices(), sticking);
  // The legs of the girl and her skirt are one solid in the scan: 3.5 % of the vertices stick there. 0.2 % for the man.
  EXPECT_LT(sticking, character.num_vertices() / 25);
  for (const auto& [name, pose] : kExtremePoses) {
    const Stretches stretches = measure_stretches(character, pose);
    std::cout << fmt::format("  {}: {} of {} triangles stretch more than 3 times, {} alone; largest {:.1f}\n", name,
                             stretches.more_than_3, character.mesh.num_faces(), stretches.alone, stretches.largest);
  }
}

INSTANTIATE_TEST_SUITE_P(Real, RealScans, ::testing::Values("mh_girl_dress", "mh_man_old_suit"));

}  // namespace
}  // namespace doppel::real_bodies_test
