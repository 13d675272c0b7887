#include "doppel/rigging/weights/bend_report.h"

#include <gmock/gmock.h>

#include "doppel/character/blend_skin.h"
#include "doppel/rigging/joints/limb_piece.h"
#include "doppel/rigging/joints/sticking.h"
#include "doppel/rigging/weights/stretch.h"
#include "doppel/rigging/weights/test_poses.h"
#include "rigging/plain_body.h"
#include "rigging/tubes.h"
#include "support/message_of.h"

namespace doppel::bend_report_test {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// -- Stretch

const std::vector<Vector3d> kTriangle{{0, 0, 0}, {2, 0, 0}, {0.5, 1, 0}};

double stretch_under(const Eigen::Matrix3d& map, const std::vector<Vector3d>& rest = kTriangle) {
  std::vector<Vector3d> posed;
  for (const Vector3d& p : rest) posed.push_back(map * p + Vector3d(1, 2, 3));
  return triangle_stretches({{0, 1, 2}}, rest, posed)[0];
}

TEST(Stretch, IsTheLargerSingularValue) {
  EXPECT_NEAR(stretch_under(AngleAxisd(2.0, Vector3d(1, -2, 3).normalized()).toRotationMatrix()), 1.0, 1e-12);
  EXPECT_NEAR(stretch_under(Vector3d(0.5, 3.5, 1).asDiagonal()), 3.5, 1e-12);
  EXPECT_NEAR(stretch_under(Vector3d(0.5, 0.25, 1).asDiagonal()), 0.5, 1e-12);
  for (const double shear : {0.3, 2.0, 8.0}) {  // x + shear y
    Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
    map(0, 1) = shear;
    EXPECT_NEAR(stretch_under(map), 0.5 * (shear + std::sqrt(shear * shear + 4)), 1e-12);
  }
}

TEST(Stretch, OfATriangleThatIsNearlyALineIsThatOfItsLongestEdge) {
  const std::vector<Vector3d> line{{0, 0, 0}, {1, 0, 0}, {0.4, 1e-6, 0}};
  EXPECT_NEAR(stretch_under(Vector3d(1, 1000, 1).asDiagonal(), line), 1.0, 1e-9);
  EXPECT_NEAR(stretch_under(Vector3d(4, 1, 1).asDiagonal(), line), 4.0, 1e-9);
  EXPECT_EQ(stretch_under(Vector3d(4, 4, 4).asDiagonal(), {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}), 1.0);
}

TEST(Stretch, ASingleBadVertexStretchesAloneAndAJointDoesNot) {
  TriangleMesh tube = support::cylinder(-0.1, 0.1, 0.05);
  tube.faces.resize(tube.faces.size() - 2 * support::kTubeCorners);  // without the ends
  const IndexRows neighbours = face_neighbours(tube.faces);
  const auto count = [&](const std::vector<Vector3d>& posed) {
    return count_stretched(triangle_stretches(tube.faces, tube.vertices, posed), neighbours, 3.0);
  };
  std::vector<Vector3d> posed = tube.vertices;
  EXPECT_EQ(count(posed).all, 0);
  const int bad = 10 * support::kTubeCorners + 5;
  posed[bad] *= 3.0;
  EXPECT_EQ(count(posed).all, 6);
  EXPECT_EQ(count(posed).alone, 6);
  for (std::size_t v = 0; v < posed.size(); ++v) {  // up to 7 times along x, little more from ring to ring
    const double x = tube.vertices[v].x();
    posed[v] = Vector3d(x + 30 * x * std::abs(x), tube.vertices[v].y(), tube.vertices[v].z());
  }
  EXPECT_GT(count(posed).all, 100);
  EXPECT_EQ(count(posed).alone, 0);
  EXPECT_NEAR(count(posed).largest, 1 + 30 * 0.19, 0.1);
}

// -- Volume

constexpr double kRadius = 0.05, kStep = 0.05;
/// Rings lie at multiples of 5 cm; the piece reaches from -25 cm to 25 cm.
const TriangleMesh kLimb = support::cylinder(-0.5, 0.5, kRadius, Vector3d::Zero(), kStep);
const LimbPositions kLimbPositions{{-0.52, 0, 0}, {0, 0, 0}, {0.52, 0, 0}};

LimbPiece piece_of(const TriangleMesh& mesh) {
  return LimbPiece(mesh.vertices, mesh.faces, std::vector<bool>(mesh.vertices.size(), true), kLimbPositions);
}

/// The upper bone moves the rings below 0, the lower bone those above, both the ring at 0.
SkinningWeights two_bones() {
  SkinningWeights skin;
  skin.bones = {"upper", "lower"};
  for (const Vector3d& p : kLimb.vertices) {
    if (std::abs(p.x()) < 1e-9) {
      skin.vertex_bones.items.insert(skin.vertex_bones.items.end(), {0, 1});
      skin.weights.insert(skin.weights.end(), {0.5, 0.5});
    } else {
      skin.vertex_bones.items.push_back(p.x() < 0 ? 0 : 1);
      skin.weights.push_back(1.0);
    }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
  }
  return skin;
}

TEST(LimbPieces, AStraightLimbHasTheVolumeOfAPrismWhereverItIs) {
  const double expected = 0.5 * support::area_of_ring(kRadius);
  const LimbPiece piece = piece_of(kLimb);
  EXPECT_NEAR(piece.volume(kLimb.vertices), expected, 1e-15);
  const Affine3d motion = Eigen::Translation3d(3, -1, 2) * AngleAxisd(1.3, Vector3d(1, 1, 0).normalized());
  std::vector<Vector3d> moved;
  for (const Vector3d& p : kLimb.vertices) moved.push_back(motion * p);
  EXPECT_NEAR(piece.volume(moved), expected, 1e-14);
}

TEST(LimbPieces, AHoleIsClosed) {
  TriangleMesh torn = kLimb;
  torn.faces.erase(torn.faces.begin() + 20 * support::kTubeCorners);  // a triangle at x = 0
  EXPECT_NEAR(piece_of(torn).volume(torn.vertices), 0.5 * support::area_of_ring(kRadius), 1e-14);
}

TEST(LimbPieces, ASurfaceThatIsOpenAlongTheLimbIsNone) {
  TriangleMesh slit = kLimb;
  // Without the strip at one side, from end to end.
  std::erase_if(slit.faces, [&](const Triangle& face) {
    return std::all_of(face.begin(), face.end(), [&](int v) { return slit.vertices[v].y() > 0.97 * kRadius; });
  });
  ASSERT_LT(slit.num_faces(), kLimb.num_faces());
  EXPECT_TRUE(piece_of(slit).empty());
  EXPECT_EQ(piece_of(slit).volume(slit.vertices), 0.0);
  EXPECT_THAT(piece_of(slit).vertices(), ::testing::IsEmpty());
}

TEST(LimbPieces, AHalfTurnLosesVolumeAsTheSkinningSays) {
  const std::vector<Affine3d> motions{Affine3d::Identity(), Affine3d(AngleAxisd(M_PI, Vector3d::UnitX()))};
  const LimbPiece piece = piece_of(kLimb);
  // The ring at 0 shrinks to a point, and the prisms on both sides of it become pyramids.
  const double expected = support::area_of_ring(kRadius) * (0.5 - 2 * kStep * 2 / 3);
  EXPECT_NEAR(piece.volume(SkinBlend(motions, SkinningMode::linear).vertices(kLimb.vertices, two_bones())), expected,
              1e-14);
  // Dual quaternions turn the ring by 90 degrees. Between two such rings, the share of the area that straight lines
  // enclose is 1 - 2 t (1 - t), which is 2/3 on average. The triangles between the rings are no such lines.
  const double ruled = support::area_of_ring(kRadius) * (0.5 - 2 * kStep / 3);
  EXPECT_NEAR(piece.volume(SkinBlend(motions, SkinningMode::dual_quaternion).vertices(kLimb.vertices, two_bones())),
              ruled, 0.01 * ruled);
}

TEST(LimbPieces, OtherLimbsDoNotCount) {
  const std::vector<bool> nothing(kLimb.vertices.size(), false);
  const LimbPiece piece(kLimb.vertices, kLimb.faces, nothing, kLimbPositions);
  EXPECT_TRUE(piece.empty());
  EXPECT_EQ(piece.volume(kLimb.vertices), 0.0);
}

// -- Poses

class TestPoses : public ::testing::Test {
 protected:
  Vector3d position(int pose, const std::string& joint) const {
    return body_.skeleton.pose(poses_[pose].dofs)[*body_.skeleton.find_joint(joint)].translation();
  }
  BodySkeleton body_ = make_body_skeleton(support::plain_body());
  std::vector<TestPose> poses_ = test_poses(body_.skeleton, body_.rest_dofs);
};

TEST_F(TestPoses, AreFiveWithinTheLimits) {
  ASSERT_EQ(poses_.size(), 5u);
  for (const TestPose& pose : poses_)
    for (int d = 0; d < body_.skeleton.num_dofs(); ++d)
      if (const auto& limits = body_.skeleton.dofs[d].limits) {
        EXPECT_GE(pose.dofs[d], (*limits)[0]) << pose.name << " " << body_.skeleton.dofs[d].name;
        EXPECT_LE(pose.dofs[d], (*limits)[1]) << pose.name << " " << body_.skeleton.dofs[d].name;
      }
}

TEST_F(TestPoses, LookAsTheirNamesSay) {
  for (const std::string side : {"Left", "Right"}) {
    EXPECT_GT(position(0, side + "Hand_ry").y(), position(0, "HeadEE").y()) << "arms overhead";
    EXPECT_GT(position(1, side + "ForeArm_ry").z(), position(1, side + "Arm_rx").z() + 0.2) << "elbows in front";
    EXPECT_LT((position(1, side + "Hand_ry") - position(1, side + "Arm_rx")).norm(), 0.2) << "hands at the shoulders";
    EXPECT_LT(position(2, "Root_rx").y() - position(2, side + "Foot_rz").y(), 0.35) << "a deep squat";
    EXPECT_LT(position(2, "Root_rx").y(), position(2, side + "Leg_rx").y() + 0.1) << "hips as low as the knees";
  }
  EXPECT_GT(position(3, "LeftFoot_rz").y(), position(3, "LeftUpLeg_ry").y() - 0.1) << "the foot as high as the hip";
  EXPECT_LT(position(3, "RightFoot_rz").z(), position(3, "RightUpLeg_ry").z() - 0.2) << "the other foot behind";
  const Vector3d shoulders = position(4, "LeftArm_rx") - position(4, "RightArm_rx");
  EXPECT_NEAR(std::atan2(-shoulders.z(), shoulders.x()), 0.8, 0.05) << "the chest turns to the left";
}

TEST_F(TestPoses, ASkeletonOfAnotherKindIsRefused) {
  Skeleton other = body_.skeleton;
  other.dofs[*other.find_dof("LeftArm_rz")].name = "arm";
  EXPECT_THAT(support::message_of([&] { test_poses(other, body_.rest_dofs); }), HasSubstr("no DoF 'LeftArm_rz'"));
}

// -- Sticking vertices and the whole

class BentTubes : public ::testing::Test {
 protected:
  int bone(const std::string& name) const {
    const auto& bones = body_.skin.bones;
    return static_cast<int>(std::find(bones.begin(), bones.end(), name) - bones.begin());
  }
  /// A vertex in the middle of the last tube of a bone.
  int vertex_of(const std::string& name) const {
    int last = -1;
    for (int v = 0; v < body_.num_vertices(); ++v)
      if (body_.skin.vertex_bones.row(v).front() == bone(name)) last = v;
    return last - 1 - 4 * support::kTubeCorners;
  }
  /// Gives a vertex to another bone. @param share of the weight that the other bone takes
  void drag(int vertex, const std::string& other, double share) {
    SkinningWeights skin;
    skin.bones = body_.skin.bones;
    for (int v = 0; v < body_.num_vertices(); ++v) {
      const int own = body_.skin.vertex_bones.row(v).front();
      const double taken = v == vertex ? share : 0.0;
      for (const auto& [b, weight] : {std::pair(own, 1.0 - taken), std::pair(bone(other), taken)}) {
        if (weight == 0.0) continue;
        skin.vertex_bones.items.push_back(b);
        skin.weights.push_back(weight);
      }
      skin.vertex_bones.offsets.push_back(static_cast<int>(skin.weights.size()));
    }
    body_.skin = skin;
  }
  std::vector<int> sticking(int pose) const {
    const auto dofs = test_poses(body_.skeleton, body_.rest_dofs)[pose].dofs;
    const SkinBlend blend(bone_motions(body_, dofs), body_.skinning);
    return StickingVertices(body_).find(blend, blend.vertices(body_.mesh.vertices, body_.skin));
  }
  Character body_ = support::tube_body(support::plain_body());
};

TEST_F(BentTubes, RigidTubesBendWithoutAnyFault) {
  for (const SkinningMode mode : {SkinningMode::dual_quaternion, SkinningMode::linear}) {
    body_.skinning = mode;
    const BendReport report = examine_bending(body_);
    ASSERT_EQ(report.poses.size(), 5u);
    EXPECT_EQ(report.triangles, body_.mesh.num_faces());
    for (const PoseBend& bend : report.poses) {
      EXPECT_EQ(bend.stretched, 0) << bend.pose;
      EXPECT_EQ(bend.stretched_alone, 0) << bend.pose;
      EXPECT_NEAR(bend.largest_stretch, 1.0, 1e-9) << bend.pose;
      EXPECT_EQ(bend.sticking, 0) << bend.pose;
      EXPECT_NEAR(bend.elbow_volume.value(), 1.0, 1e-9) << bend.pose;
      EXPECT_NEAR(bend.knee_volume.value(), 1.0, 1e-9) << bend.pose;
    }
    EXPECT_THAT(report.faults(), ::testing::IsEmpty());
  }
}

TEST_F(BentTubes, AVertexOfTheHandThatTheThighDragsSticks) {
  const int vertex = vertex_of("LeftHand");
  for (const double share : {0.3, 1.0}) {
    drag(vertex, "LeftUpLeg", share);
    EXPECT_THAT(sticking(0), ElementsAre(vertex)) << share;
    const BendReport report = examine_bending(body_);
    EXPECT_EQ(report.poses[0].sticking, 1);
    EXPECT_GT(report.poses[0].stretched_alone, 0);
    ASSERT_FALSE(report.faults().empty());
    EXPECT_THAT(report.faults()[0], HasSubstr("in the pose 'arms overhead'"));
    EXPECT_THAT(report.summary(), HasSubstr("1 of"));
  }
}

TEST_F(BentTubes, AThumbBesideTheThighDoesNotStick) {
  const auto rest = body_.skeleton.pose(body_.rest_dofs);
  const Vector3d hand = rest[body_.bone_joint[bone("LeftHand")]].translation();
  const Vector3d end = rest[*body_.skeleton.find_joint("LeftHandEE")].translation();
  const Vector3d hip = rest[body_.bone_joint[bone("LeftUpLeg")]].translation();
  const Vector3d along = (end - hand).normalized();
  Vector3d towards_thigh = hip - hand;
  towards_thigh -= towards_thigh.dot(along) * along;
  body_.mesh.vertices.push_back(hand + 0.07 * along + 0.1 * towards_thigh.normalized());
  body_.skin.vertex_bones.items.push_back(bone("LeftHand"));
  body_.skin.vertex_bones.offsets.push_back(body_.num_vertices());
  body_.skin.weights.push_back(1.0);
  for (int pose = 0; pose < 5; ++pose) EXPECT_THAT(sticking(pose), ::testing::IsEmpty()) << pose;
}

TEST_F(BentTubes, AVertexThatItsNeighbourBoneMovesDoesNotStick) {
  drag(vertex_of("LeftForeArm"), "LeftArm", 0.5);
  for (int pose = 0; pose < 5; ++pose) EXPECT_THAT(sticking(pose), ::testing::IsEmpty()) << pose;
}

TEST_F(BentTubes, AnElbowThatLosesVolumeIsNamed) {
  body_.skinning = SkinningMode::linear;
  // The forearm shrinks towards its axis where it follows the upper arm as well, which stands at another angle.
  const int own = bone("LeftForeArm"), upper = bone("LeftArm");
  SkinningWeights skin;
  skin.bones = body_.skin.bones;
  for (int v = 0; v < body_.num_vertices(); ++v) {
    const int b = body_.skin.vertex_bones.row(v).front();
    skin.vertex_bones.items.push_back(b);
    skin.weights.push_back(b == own ? 0.5 : 1.0);
    if (b == own) {
      skin.vertex_bones.items.push_back(upper);
      skin.weights.push_back(0.5);
    }
    skin.vertex_bones.offsets.push_back(static_cast<int>(skin.weights.size()));
  }
  body_.skin = skin;
  const BendReport report = examine_bending(body_);
  EXPECT_LT(report.poses[1].elbow_volume.value(), 0.88);
  EXPECT_NEAR(report.poses[1].knee_volume.value(), 1.0, 1e-9);
  EXPECT_THAT(report.faults(), ::testing::Contains(HasSubstr("in the pose 'elbows bent' an elbow loses")));
}

TEST_F(BentTubes, ACharacterOfAnotherKindIsRefused) {
  body_.skin.bones[bone("LeftForeArm")] = "left_elbow";
  EXPECT_THAT(support::message_of([&] { examine_bending(body_); }), HasSubstr("no bone 'LeftForeArm'"));
}

}  // namespace
}  // namespace doppel::bend_report_test
