#include "doppel/character/retarget.h"

#include <gmock/gmock.h>

#include <cmath>

#include "doppel/character/pose_solver.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::retarget_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// A pose well within all limits.
std::vector<double> bent_pose(double amount) {
  std::vector<double> dofs = test_actor().rest_dofs;
  for (std::size_t d = 0; d < dofs.size(); ++d) {
    dofs[d] += amount * std::sin(1.0 + 2.3 * static_cast<double>(d));
    if (const auto& limits = test_actor().skeleton.dofs[d].limits)
      dofs[d] = std::clamp(dofs[d], 0.8 * (*limits)[0], 0.8 * (*limits)[1]);
  }
  return dofs;
}

std::vector<PoseGoal> goals_at(const std::vector<double>& dofs) {
  const auto world = test_actor().skeleton.pose(dofs);
  std::vector<PoseGoal> goals;
  for (int i = 0; i < 5; ++i) {
    PoseGoal goal;
    goal.joint = test_character::segment_joint(i);
    goal.position = world[goal.joint].translation();
    goal.rotation = world[goal.joint].linear();
    goals.push_back(goal);
  }
  return goals;
}

TEST(PoseSolverRecovers, APoseFromItsJoints) {
  const std::vector<double> wanted = bent_pose(0.35);
  std::vector<double> dofs = test_actor().rest_dofs;
  const PoseSolver solver(test_actor().skeleton, 100);
  solver.solve(goals_at(wanted), dofs);
  solver.solve(goals_at(wanted), dofs);  // the inertia is about the start, so the second time it pulls less
  EXPECT_LT(solver.mean_distance(goals_at(wanted), dofs), 1e-3);
  const auto expected = test_actor().skeleton.pose(wanted), found = test_actor().skeleton.pose(dofs);
  for (int i = 0; i < 5; ++i) {
    const auto j = as_size(test_character::segment_joint(i));
    EXPECT_LT((expected[j].linear() - found[j].linear()).norm(), 0.02) << "segment " << i;
  }
}

TEST(PoseSolverRecovers, NothingBeyondTheLimitsAndNothingThatIsFree) {
  std::vector<double> wanted = test_actor().rest_dofs;
  const auto lean = as_size(*test_actor().skeleton.find_dof("lean_4"));
  const auto idle = as_size(*test_actor().skeleton.find_dof("idle"));
  wanted[lean] = 1.4;  // the limit is 0.9
  std::vector<double> dofs = test_actor().rest_dofs;
  dofs[idle] = 0.123;
  PoseSolver(test_actor().skeleton).solve(goals_at(wanted), dofs);
  EXPECT_DOUBLE_EQ(dofs[lean], 0.9);
  EXPECT_DOUBLE_EQ(dofs[idle], 0.123);
  for (std::size_t d = 0; d < dofs.size(); ++d)
    if (const auto& limits = test_actor().skeleton.dofs[d].limits) {
      EXPECT_GE(dofs[d], (*limits)[0]);
      EXPECT_LE(dofs[d], (*limits)[1]);
    }
}

JointMap chain_map() {
  JointMap map;
  map.scale = JointMap::Scale::number;
  for (const char* name : {"Root", "Seg1", "Seg2", "Seg3", "Seg4"}) map.pairs.push_back({name, name, {0, 0, 0}, {}});
  return map;
}

/// No bone changes its length: `stretch` rests.
Motion swaying(int frames) {
  Motion motion;
  const auto stretch = as_size(*test_actor().skeleton.find_dof("stretch"));
  for (int f = 0; f < frames; ++f) {
    motion.frames.push_back(bent_pose(0.3 * std::sin(0.2 * f)));
    motion.frames.back()[stretch] = test_actor().rest_dofs[stretch];
  }
  return motion;
}

TEST(RetargetReference, OntoItselfItIsTheSameMotion) {
  const Motion motion = swaying(10);
  RetargetOptions options;
  options.rest_dofs = test_actor().rest_dofs;
  const JointTracks tracks = joint_tracks(test_actor().skeleton, motion, 25.0, test_actor().rest_dofs);
  const RetargetResult result = retarget(test_actor().skeleton, tracks, chain_map(), options);
  ASSERT_EQ(result.motion.num_frames(), 10);
  EXPECT_EQ(result.scale, 1.0);
  for (int f = 0; f < 10; ++f) {
    const auto expected = test_actor().skeleton.pose(motion.frames[f]),
               found = test_actor().skeleton.pose(result.motion.frames[f]);
    for (const auto& track : result.tracks) {
      EXPECT_LT((expected[track.joint].translation() - found[track.joint].translation()).norm(), 2e-3)
          << track.target << " frame " << f;
      EXPECT_LT((expected[track.joint].linear() - found[track.joint].linear()).norm(), 0.05)
          << track.target << " frame " << f;
    }
  }
  EXPECT_TRUE(result.tracks.back().end);
  EXPECT_FALSE(result.tracks.front().end);
}

TEST(RetargetReference, TheScaledSourceByHand) {
  // Twice as large, from the root upwards, at half the rate.
  JointMap map = chain_map();
  map.factor = 2.0;
  RetargetOptions options;
  options.frames_per_second = 12.5;
  const Motion motion = swaying(5);
  const JointTracks tracks = joint_tracks(test_actor().skeleton, motion, 25.0);
  const RetargetResult result = retarget(test_actor().skeleton, tracks, map, options);
  ASSERT_EQ(result.motion.num_frames(), 3);
  for (int f = 0; f < 3; ++f) {
    const auto pose = tracks.frames[2 * f];
    Eigen::Vector3d expected = 2.0 * pose[result.tracks[0].joint].translation();
    EXPECT_LT((result.goals[f][0] - expected).norm(), 1e-9);
    for (std::size_t n = 1; n < result.tracks.size(); ++n) {
      const int a = result.tracks[n - 1].joint, b = result.tracks[n].joint;
      const double length = (tracks.rest[b].translation() - tracks.rest[a].translation()).norm();
      expected += length * (pose[b].translation() - pose[a].translation()).normalized();
      EXPECT_LT((result.goals[f][n] - expected).norm(), 1e-9);
    }
  }
}

TEST(RetargetReference, AWorldWithZUpIsTurned) {
  const JointTracks tracks = joint_tracks(test_actor().skeleton, swaying(2), 25.0, test_actor().rest_dofs);
  JointTracks turned = tracks;
  const Eigen::Affine3d z_up(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()));
  for (auto& joint : turned.rest) joint = z_up * joint;
  for (auto& frame : turned.frames)
    for (auto& joint : frame) joint = z_up * joint;
  JointMap map = chain_map();
  const auto expected = retarget(test_actor().skeleton, tracks, map).goals;
  map.z_up = true;
  const auto found = retarget(test_actor().skeleton, turned, map).goals;
  for (std::size_t n = 0; n < expected[1].size(); ++n) EXPECT_LT((expected[1][n] - found[1][n]).norm(), 1e-9);
}

TEST(RetargetRejects, MapsThatDoNotFit) {
  const JointTracks tracks = joint_tracks(test_actor().skeleton, swaying(2), 25.0);
  const auto complaint = [&](const std::function<void(JointMap&)>& spoil) {
    JointMap map = chain_map();
    for (auto& pair : map.pairs) pair.where = {"map.yaml", 7};
    spoil(map);
    return message_of<FileError>([&] { retarget(test_actor().skeleton, tracks, map); });
  };
  EXPECT_THAT(
      complaint([](JointMap& map) { map.pairs[2].target = "Sog2"; }),
      AllOf(HasSubstr("map.yaml:7"), HasSubstr("character has no joint 'Sog2'"), HasSubstr("did you mean Seg2")));
  EXPECT_THAT(complaint([](JointMap& map) { map.pairs[2].source = "Seg2_rq"; }),
              AllOf(HasSubstr("motion's skeleton has no joint 'Seg2_rq'"), HasSubstr("did you mean Seg2_r")));
  EXPECT_THAT(complaint([](JointMap& map) { map.pairs[2].target = "Seg1"; }), HasSubstr("mapped twice"));
  EXPECT_THAT(complaint([](JointMap& map) { map.pairs.resize(1); }), HasSubstr("at least two"));
  EXPECT_THAT(complaint([](JointMap& map) { map.scale = JointMap::Scale::hip_height; }),
              AllOf(HasSubstr("no scale can be found"), HasSubstr("as a number")));
}

TEST(RetargetRejects, AMapWithTwoRoots) {
  Skeleton skeleton;
  skeleton.joints.push_back({"Base_tx", Joint::Type::prismatic, -1, {0, 0, 0}, {0.001, 0, 0}});
  for (const char* name : {"A_rx", "B_rx"})
    skeleton.joints.push_back({name, Joint::Type::revolute, 0, {0, 1, 0}, Eigen::Vector3d::UnitX()});
  JointMap map;
  map.pairs = {{"A", "A", {0, 0, 0}, {}}, {"B", "B", {0, 0, 0}, {}}};
  Motion motion;
  motion.frames.push_back({});
  EXPECT_THAT(message_of([&] { retarget(skeleton, joint_tracks(skeleton, motion, 25.0), map); }),
              AllOf(HasSubstr("two roots"), HasSubstr("A_rx"), HasSubstr("B_rx")));
}

const char* const kMap =
    "joints:\n"
    "  Root: Hips\n"
    "  LeftArm: LeftUpperArm\n"
    "scale: 1.25\n"
    "up: z\n"
    "rest_rotation:\n"
    "  LeftArm: [0, 0, 90]\n";

JointMap read_map(const std::string& text) {
  const TemporaryFolder folder;
  write_atomically(folder / "map.yaml", text);
  return read_joint_map(folder / "map.yaml");
}

TEST(JointMapReference, ReadsAndWrites) {
  for (const JointMap& map : {read_map(kMap), read_map(joint_map_text(read_map(kMap)))}) {
    ASSERT_EQ(map.pairs.size(), 2u);
    EXPECT_EQ(map.pairs[1].target, "LeftArm");
    EXPECT_EQ(map.pairs[1].source, "LeftUpperArm");
    EXPECT_EQ(map.pairs[1].where.line, 3);
    EXPECT_NEAR(map.pairs[1].rest_rotation.z(), M_PI / 2, 1e-12);
    EXPECT_TRUE(map.scale == JointMap::Scale::number);
    EXPECT_EQ(map.factor, 1.25);
    EXPECT_EQ(map.z_up, true);
  }
  EXPECT_TRUE(read_map("joints: {Root: Hips}\nscale: leg_length\n").scale == JointMap::Scale::leg_length);
}

TEST(JointMapRejects, FaultsWithTheirLine) {
  const auto complaint = [](const std::string& text) { return message_of<FileError>([&] { read_map(text); }); };
  EXPECT_THAT(complaint("scale: 1\n"), HasSubstr("joints"));
  EXPECT_THAT(complaint("joints: {Root: Hips}\nscale: tall\n"), AllOf(HasSubstr(":2"), HasSubstr("hip_height")));
  EXPECT_THAT(complaint("joints: {Root: Hips}\nscale: 0\n"), HasSubstr(":2"));
  EXPECT_THAT(complaint("joints: {Root: Hips}\nup: x\n"), HasSubstr(":2"));
  EXPECT_THAT(complaint("joints: {Root: Hips}\nscales: 2\n"), HasSubstr("scale"));
  EXPECT_THAT(complaint("joints:\n  Root: [1, 2]\n"), HasSubstr(":2"));
  EXPECT_THAT(complaint("joints: {LeftArm: a}\nrest_rotation: {LeftArn: [0, 0, 0]}\n"),
              AllOf(HasSubstr("LeftArn"), HasSubstr("did you mean LeftArm")));
  EXPECT_THAT(complaint("joints: {A: a}\nrest_rotation: {A: [0, 0]}\n"), HasSubstr("three angles"));
  EXPECT_THAT(complaint("joints: {A: a}\nrest_rotation: {A: [0, 0, 1e9]}\n"), HasSubstr("360"));
}

TEST(JointMapRejects, HostileFiles) {
  const TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "map.yaml", kMap, [](const auto& path) { read_joint_map(path); });
}

const std::vector<std::string> kActorJoints{
    "Root_tx",       "Root_ry",     "Head_ry",          "Head_rx",       "HeadEE",          "LeftShoulder_ry",
    "LeftArm_rz",    "LeftArm_rx",  "LeftForeArm_rx",   "LeftForeArmEE", "LeftUpLeg_rx",    "LeftLeg_rx",
    "LeftFoot_rx",   "LeftFootEE",  "RightShoulder_ry", "RightArm_rz",   "RightForeArm_rx", "RightForeArmEE",
    "RightUpLeg_rx", "RightLeg_rx", "RightFoot_rx",     "RightFootEE"};

std::string source_of(const JointMap& map, const std::string& target) {
  for (const JointMap::Pair& pair : map.pairs)
    if (pair.target == target) return pair.source;
  return "";
}

TEST(JointMapReference, CommonNamesAreRecognised) {
  struct Convention {
    std::vector<std::string> names;
    std::map<std::string, std::string> expected;
  };
  const std::vector<Convention> conventions{
      {{"mixamorig:Hips", "mixamorig:Neck", "mixamorig:Head", "mixamorig:HeadTop_End", "mixamorig:LeftShoulder",
        "mixamorig:LeftArm", "mixamorig:LeftForeArm", "mixamorig:LeftHand", "mixamorig:LeftUpLeg", "mixamorig:LeftLeg",
        "mixamorig:LeftFoot", "mixamorig:LeftToeBase", "mixamorig:RightUpLeg", "mixamorig:RightFoot"},
       {{"Root", "mixamorig:Hips"},
        {"HeadEE", "mixamorig:HeadTop_End"},
        {"LeftShoulder", "mixamorig:LeftShoulder"},
        {"LeftArm", "mixamorig:LeftArm"},
        {"LeftForeArmEE", "mixamorig:LeftHand"},
        {"LeftFootEE", "mixamorig:LeftToeBase"},
        {"RightUpLeg", "mixamorig:RightUpLeg"},
        {"RightArm", ""}}},
      {{"Hips", "Neck", "Head", "Head_end", "LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "LeftHip",
        "LeftKnee", "LeftAnkle", "LeftAnkle_end"},
       {{"LeftShoulder", "LeftCollar"},
        {"LeftArm", "LeftShoulder"},
        {"LeftForeArm", "LeftElbow"},
        {"LeftForeArmEE", "LeftWrist"},
        {"LeftUpLeg", "LeftHip"},
        {"LeftLeg", "LeftKnee"},
        {"LeftFoot", "LeftAnkle"},
        {"LeftFootEE", "LeftAnkle_end"}}},
      {{"hip", "neck", "head", "lCollar", "lShldr", "lForeArm", "lHand", "lThigh", "lShin", "lFoot"},
       {{"Root", "hip"},
        {"LeftShoulder", "lCollar"},
        {"LeftArm", "lShldr"},
        {"LeftUpLeg", "lThigh"},
        {"LeftLeg", "lShin"}}},
      // Where a skeleton has ankles and feet, or wrists and hands, the former are our feet and hands.
      {{"Pelvis", "Neck", "Head", "L_Collar", "L_Shoulder", "L_Elbow", "L_Wrist", "L_Hand", "L_Hip", "L_Knee",
        "L_Ankle", "L_Foot", "R_Hip", "R_Ankle", "R_Foot"},
       {{"LeftForeArmEE", "L_Wrist"},
        {"LeftFoot", "L_Ankle"},
        {"LeftFootEE", "L_Foot"},
        {"RightFoot", "R_Ankle"},
        {"LeftArm", "L_Shoulder"}}},
      {{"SpineBase", "Neck", "Head", "ShoulderLeft", "ElbowLeft", "WristLeft", "HandLeft", "HipLeft", "KneeLeft",
        "AnkleLeft", "FootLeft"},
       {{"LeftForeArmEE", "WristLeft"}, {"LeftFoot", "AnkleLeft"}, {"LeftFootEE", "FootLeft"}}},
      {{"hip", "neckLower", "head", "lCollar", "lShldrBend", "lForearmBend", "lHand", "lThighBend", "lShin", "lFoot"},
       {{"LeftArm", "lShldrBend"}, {"LeftForeArm", "lForearmBend"}, {"LeftUpLeg", "lThighBend"}}},
      {kActorJoints, {{"Root", "Root"}, {"LeftArm", "LeftArm"}, {"LeftForeArmEE", "LeftForeArmEE"}}}};
  for (const Convention& convention : conventions) {
    const JointMap map = guess_joint_map(kActorJoints, convention.names);
    for (const auto& [target, source] : convention.expected) EXPECT_EQ(source_of(map, target), source) << target;
  }
  EXPECT_THAT(message_of<UsageError>([] {
                guess_joint_map(kActorJoints, {"a", "b"});
              }),
              AllOf(HasSubstr("--map"), HasSubstr("LeftForeArm"), HasSubstr("a b")));
}

}  // namespace
}  // namespace doppel::retarget_test
