#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <iostream>
#include <random>

#include "doppel/character/blend_skin.h"
#include "doppel/core/statistics.h"
#include "doppel/rigging/joints/body_skeleton.h"
#include "doppel/rigging/joints/move_inside.h"
#include "doppel/rigging/make_character.h"
#include "doppel/rigging/weights/bend_report.h"
#include "doppel/rigging/weights/solid_surface.h"
#include "doppel/rigging/weights/test_poses.h"
#include "rigging/rigged_bodies.h"
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
  std::vector<Eigen::Affine3d> by_bone;
  for (const std::string& bone : skin.bones) by_bone.push_back(motions.at(bone));
  const auto ids = read_npy(body.folder / "skin_check_ids.npy").as<std::int64_t>();
  const auto ground_truth = read_npy(body.folder / "skin_check_posed.npy").as<double>();
  const auto posed = SkinBlend(by_bone, SkinningMode::linear).vertices(body.mesh.vertices, skin);
  std::vector<double> errors;
  for (std::size_t i = 0; i < ids.size(); ++i)
    errors.push_back(
        1e3 * (posed[ids[i]] - Vector3d(ground_truth[3 * i], ground_truth[3 * i + 1], ground_truth[3 * i + 2])).norm());
  return errors;
}

void print(const std::string& name, const BendReport& report) {
  std::cout << name << ": " << report.summary() << "\n";
  for (const PoseBend& bend : report.poses)
    std::cout << fmt::format(
        "  {}: {} triangles stretch more than 3 times, {} alone, at most {:.1f} times; {} vertices stick; elbow "
        "{:.3f}, "
        "knee {:.3f}\n",
        bend.pose, bend.stretched, bend.stretched_alone, bend.largest_stretch, bend.sticking,
        bend.elbow_volume.value_or(0.0), bend.knee_volume.value_or(0.0));
}

TEST_P(RealBodies, BendLikeTheirOwnRig) {
  const support::RiggedBody body = read();
  const Character character = make_character(body.name, body.mesh, body.joints, body.solid);
  const std::vector<double> errors = skin_check_errors(body, character.skin);
  std::cout << fmt::format("{}: skin_check mean {:.1f} mm, 95 % {:.1f} mm, graph {} nodes {} edges\n", body.name,
                           mean_of(errors), quantile(errors, 0.95), character.num_nodes(),
                           character.graph.edges.size());
  EXPECT_LT(mean_of(errors), 3.0);
  EXPECT_LT(quantile(errors, 0.95), 20.0);
  EXPECT_LT(skeleton_distance(character), kSkeletonOffTemplate);
  EXPECT_NEAR(character.num_nodes(), 500, 30);
  const BendReport report = examine_bending(character);
  print(body.name, report);
  // Where limbs touch, the limits of the report cannot be met (docs/results/bodies.md): the skirt of the girl joins her
  // legs, and the arms of the old man touch his trunk.
  const bool limbs_touch = body.name == "mh_girl_dress" || body.name == "mh_man_old_suit";
  for (const PoseBend& bend : report.poses) {
    EXPECT_LE(bend.stretched_alone, limbs_touch ? report.triangles / 400 : 0) << bend.pose;
    EXPECT_LT(bend.stretched, report.triangles / 50) << bend.pose;
    EXPECT_LE(bend.sticking, limbs_touch ? report.vertices / 50 : 0) << bend.pose;
    if (body.name != "mh_man_old_suit") {
      EXPECT_NEAR(bend.elbow_volume.value(), 1.0, 0.12) << bend.pose;
    }
    if (body.name == "mh_girl_dress") {
      EXPECT_FALSE(bend.knee_volume.has_value()) << "a skirt is no limb";
    } else {
      EXPECT_NEAR(bend.knee_volume.value(), 1.0, 0.12) << bend.pose;
    }
  }
}

TEST_P(RealBodies, HaveMarkersAndLabelsWhereTheyBelong) {
  const support::RiggedBody body = read(0.02);
  const Character character = make_character(body.name, body.mesh, body.joints, body.solid);
  const auto rest = character.skeleton.pose(character.rest_dofs);
  std::map<std::string, Vector3d> position;
  for (const Marker& marker : character.skeleton.markers) position[marker.name] = rest[marker.joint] * marker.position;
  const double trunk = (body.joints.at("neck") - body.joints.at("pelvis")).norm();
  // All bodies of this folder look along +z.
  EXPECT_GT(position["nose"].z(), body.joints.at("head").z() + 0.1 * trunk);
  EXPECT_GT(position["nose"].y(), body.joints.at("neck").y());
  EXPECT_GT(position["left_eye"].y(), position["nose"].y());
  EXPECT_LT(position["left_eye"].y(), position["head_top"].y());
  EXPECT_GT(position["left_ear"].x(), position["left_eye"].x());
  EXPECT_LT(position["left_ear"].z(), position["nose"].z());
  EXPECT_LT(position["face-8"].y(), position["left_mouth"].y());
  EXPECT_LT((position["face_mesh_4"] - position["nose"]).norm(), 0.05 * trunk) << "the tip of the nose";
  EXPECT_GT(position["face_mesh_10"].y(), position["left_eye"].y()) << "the forehead";
  EXPECT_GT(position["face_mesh_356"].x(), position["face_mesh_263"].x()) << "temple and corner of the left eye";
  EXPECT_LT(position["face_mesh_33"].x(), position["face_mesh_133"].x()) << "the corners of the right eye";
  for (const std::string side : {"left_", "right_"}) {
    EXPECT_GT(position[side + "big_toe"].z(), position[side + "ankle"].z() + 0.1 * trunk) << side;
    EXPECT_LT(position[side + "heel"].z(), position[side + "ankle"].z() + 0.05 * trunk) << side;
    EXPECT_LT(position[side + "heel"].y(), 0.15 * trunk) << side;
    const double out = side == "left_" ? 1 : -1;
    EXPECT_GT(out * (position[side + "small_toe"].x() - position[side + "big_toe"].x()), 0.02 * trunk) << side;
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
  const std::vector<TestPose> poses = test_poses(skeleton.skeleton, skeleton.rest_dofs);
  const auto position = [&](const TestPose& pose, const std::string& joint) {
    return Vector3d(skeleton.skeleton.pose(pose.dofs)[*skeleton.skeleton.find_joint(joint)].translation());
  };
  const double trunk = (body.joints.at("neck") - body.joints.at("pelvis")).norm();
  for (const std::string side : {"Left", "Right"}) {
    const TestPose &up = poses[0], &forward = poses[1], &squat = poses[2];
    EXPECT_GT(position(up, side + "Hand_ry").y(), position(up, "Head_rx").y() + 0.3 * trunk);
    EXPECT_GT(position(forward, side + "ForeArm_ry").z(), position(forward, side + "Arm_rx").z() + 0.3 * trunk);
    EXPECT_LT((position(forward, side + "Hand_ry") - position(forward, side + "Arm_rx")).norm(), 0.75 * trunk);
    EXPECT_LT(position(squat, "Root_rx").y() - position(squat, side + "Foot_rz").y(), 1.2 * trunk);
    EXPECT_GT(position(squat, side + "Leg_rx").z(), position(squat, "Root_rx").z() + 0.4 * trunk);
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
        const auto num_outside = [&] {
          return std::ranges::count_if(body_joint_names(), [&](const std::string& name) {
            return joints.has(name) && !body.solid.is_inside(joints.at(name));
          });
        };
        const auto outside_before = num_outside();
        move_inside(joints, body.solid);
        EXPECT_LE(num_outside(), outside_before);
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
  nlohmann::json ground_truth;
  std::ifstream(folder / "scan_truth.json") >> ground_truth;
  Eigen::Affine3d scan_from_body;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) scan_from_body.matrix()(r, c) = ground_truth["scan_from_body"][r][c].get<double>();
  TriangleMesh mesh = read_obj(folder / "scan.obj", 1.0);
  const Eigen::Affine3d body_from_scan = scan_from_body.inverse();
  for (Vector3d& p : mesh.vertices) p = body_from_scan * p;
  BodyJoints joints = support::true_joints(ground_truth["landmarks"], 1.0);
  for (auto& entry : joints.positions) entry.second = body_from_scan * entry.second;
  VoxelSolidOptions options;
  options.cell = 0.01;
  const Character character = make_character("scan", mesh, joints, solid_grid(VoxelSolid(mesh, options)));
  const BendReport report = examine_bending(character);
  print(GetParam(), report);
  // The legs of the girl and her skirt are one solid in the scan, as are the arms and the trunk of the man.
  for (const PoseBend& bend : report.poses) EXPECT_LT(bend.sticking, report.vertices / 8) << bend.pose;
}

INSTANTIATE_TEST_SUITE_P(Real, RealScans, ::testing::Values("mh_girl_dress", "mh_man_old_suit"));

}  // namespace
}  // namespace doppel::real_bodies_test
