#include "doppel/character/bvh.h"

#include <gmock/gmock.h>

#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::bvh_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Channels in an unusual order, a brace behind the name, a name with a blank, tabs and blanks.
const char* const kText =
    "HIERARCHY\n"
    "ROOT Hips\n"
    "{\n"
    "\tOFFSET 0.0 90.0 0.0\n"
    "\tCHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation\n"
    "\tJOINT Left Leg {\n"
    "\t\tOFFSET 10 -5 0\n"
    "\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n"
    "\t\tEnd Site\n"
    "\t\t{\n"
    "\t\t\tOFFSET 0 -80 0\n"
    "\t\t}\n"
    "\t}\n"
    "}\n"
    "MOTION\n"
    "Frames: 2\n"
    "Frame Time: 0.04\n"
    "0 90 0 0 0 0 0 0 0\n"
    "100 90 0 90 0 0 0 90 0\n";

std::string with(const std::string& from, const std::string& to) {
  std::string text = kText;
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::runtime_error("not in the text: " + from);
  return text.replace(at, from.size(), to);
}

class BvhFile {
 public:
  BvhClip read(const std::string& text) {
    write_atomically(folder_ / "a.bvh", text);
    return read_bvh(folder_ / "a.bvh");
  }
  std::string complaint(const std::string& text) {
    return message_of<FileError>([&] { read(text); });
  }
  TemporaryFolder folder_;
};

TEST(BvhReference, ReadsHierarchyUnitsAndMotion) {
  BvhFile file;
  const BvhClip clip = file.read(kText);
  ASSERT_EQ(clip.joints.size(), 3u);
  EXPECT_EQ(clip.joints[1].name, "Left Leg");
  EXPECT_EQ(clip.joints[2].name, "Left Leg_end");
  EXPECT_EQ(clip.joints[2].parent, 1);
  EXPECT_EQ(clip.metres_per_unit, 0.01);
  EXPECT_DOUBLE_EQ(clip.joints[1].offset.y(), -0.05);
  EXPECT_EQ(clip.joints[0].channels[3], BvhChannel::y_rotation);
  EXPECT_DOUBLE_EQ(clip.seconds_per_frame, 0.04);
  EXPECT_THAT(clip.frames[1][0], ::testing::DoubleEq(1.0));
  EXPECT_THAT(clip.frames[1][3], ::testing::DoubleEq(M_PI / 2));
}

TEST(BvhReference, PosesByHand) {
  BvhFile file;
  const BvhClip clip = file.read(kText);
  const auto still = clip.pose(clip.frames[0]);
  EXPECT_LT((still[2].translation() - Eigen::Vector3d(0.1, 0.05, 0)).norm(), 1e-12);
  // Hips at (1, 0.9, 0) turned by 90 degrees about y: x goes to -z. The leg, which would hang 0.8 m down, is turned by
  // 90 degrees about x: down goes to -z of the hips, which is -x of the world.
  const auto turned = clip.pose(clip.frames[1]);
  EXPECT_LT((turned[1].translation() - Eigen::Vector3d(1, 0.85, -0.1)).norm(), 1e-12);
  EXPECT_LT((turned[2].translation() - Eigen::Vector3d(0.2, 0.85, -0.1)).norm(), 1e-12);
}

TEST(BvhReference, CarriageReturnsChangeNothing) {
  BvhFile file;
  EXPECT_EQ(file.read(support::with_crlf(kText)).frames, file.read(kText).frames);
}

TEST(BvhReference, SpellingsOfOtherProgramsChangeNothing) {
  BvhFile file;
  const BvhClip expected = file.read(kText);
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"HIERARCHY", "Hierarchy"},
           {"ROOT Hips", "Root Hips"},
           {"OFFSET 0.0", "Offset 0.0"},
           {"CHANNELS 6", "channels 6"},
           {"JOINT", "Joint"},
           {"End Site", "End site"},
           {"End Site", "END SITE"},
           {"End Site", "End Site Toe tip"},
           {"Xposition Yposition Zposition", "Xposition Yposition ZPosition"},
           {"Xposition Yposition Zposition", "XPOSITION YPOSITION ZPOSITION"},
           {"Yrotation Xrotation Zrotation", "yrotation xRotation ZRotation"},
           {"MOTION", "Motion"},
           {"Frames: 2", "Frames:2"},
           {"Frames: 2", "FRAMES :\t2"},
           {"Frame Time: 0.04", "Frame Time:0.04"},
           {"Frame Time: 0.04", "Frame time:\t.04"},
           {"Frame Time: 0.04", "FrameTime: 4e-2"}}) {
    SCOPED_TRACE(to);
    const BvhClip clip = file.read(with(from, to));
    EXPECT_EQ(clip.frames, expected.frames);
    EXPECT_EQ(clip.seconds_per_frame, expected.seconds_per_frame);
    ASSERT_EQ(clip.joints.size(), expected.joints.size());
    for (std::size_t j = 0; j < clip.joints.size(); ++j) {
      EXPECT_EQ(clip.joints[j].name, expected.joints[j].name);
      EXPECT_EQ(clip.joints[j].channels, expected.joints[j].channels);
    }
  }
}

TEST(BvhReference, ScalesOfOneChangeNothing) {
  BvhFile file;
  std::string text =
      with("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 6 Zrotation Xrotation Yrotation Xscale YScale zscale");
  const auto end_rows = [&](const std::string& scales) {
    std::string ended = text;
    for (const std::string row : {"0 90 0 0 0 0 0 0 0\n", "100 90 0 90 0 0 0 90 0\n"})
      ended.insert(ended.find(row) + row.size() - 1, scales);
    return ended;
  };
  EXPECT_EQ(file.read(end_rows(" 1 1.0 1.00001")).frames, file.read(kText).frames);
  EXPECT_THAT(file.complaint(end_rows(" 1 1.1 1")), AllOf(HasSubstr("a.bvh:18"), HasSubstr("by 1.1")));
  EXPECT_THAT(file.complaint(end_rows(" 1 1")), AllOf(HasSubstr("11 numbers"), HasSubstr("12 channels")));
  text = with("CHANNELS 6 Xposition", "CHANNELS 9 Xscale Yscale Zscale Xposition");
  text.replace(text.find("\n0 90"), 1, "\n1 1 1 ");
  text.replace(text.find("\n100 90"), 1, "\n1 1 1 ");
  EXPECT_EQ(file.read(text).frames, file.read(kText).frames);
}

TEST(BvhReference, AJointMayHaveSeveralEndSites) {
  BvhFile file;
  const BvhClip clip = file.read(with("\t\tEnd Site\n", "\t\tEnd Site { OFFSET 5 0 0 }\n\t\tEnd Site\n"));
  ASSERT_EQ(clip.joints.size(), 4u);
  EXPECT_EQ(clip.joints[2].name, "Left Leg_end");
  EXPECT_EQ(clip.joints[3].name, "Left Leg_end2");
  EXPECT_DOUBLE_EQ(clip.joints[3].offset.y(), -0.8);
}

TEST(BvhReference, AStatedUnitIsTaken) {
  const TemporaryFolder folder;
  write_atomically(folder / "a.bvh", kText);
  EXPECT_DOUBLE_EQ(read_bvh(folder / "a.bvh", 0.0254).joints[2].offset.y(), -80 * 0.0254);
}

TEST(BvhAgrees, WrittenAndReadItIsTheSame) {
  const TemporaryFolder folder;
  BvhFile file;
  const BvhClip clip = file.read(kText);
  write_bvh(folder / "b.bvh", clip);
  const BvhClip again = read_bvh(folder / "b.bvh");
  ASSERT_EQ(again.joints.size(), clip.joints.size());
  for (std::size_t j = 0; j < clip.joints.size(); ++j) {
    EXPECT_EQ(again.joints[j].name, clip.joints[j].name);
    EXPECT_EQ(again.joints[j].parent, clip.joints[j].parent);
    EXPECT_EQ(again.joints[j].channels, clip.joints[j].channels);
    EXPECT_LT((again.joints[j].offset - clip.joints[j].offset).norm(), 1e-12);
  }
  for (std::size_t f = 0; f < clip.frames.size(); ++f)
    for (std::size_t c = 0; c < clip.frames[f].size(); ++c) EXPECT_NEAR(again.frames[f][c], clip.frames[f][c], 1e-12);
}

/// Every joint of the skeleton that ends a run lies where the clip says, with the same turn since the rest pose.
void expect_same_motion(const Skeleton& skeleton, const Motion& motion, const std::vector<double>& rest,
                        const BvhClip& clip) {
  const auto rest_pose = skeleton.pose(rest);
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    const auto expected = skeleton.pose(motion.frames[f]);
    const auto found = clip.pose(clip.frames[f]);
    for (std::size_t b = 0; b < clip.joints.size(); ++b) {
      if (clip.joints[b].channels.empty()) continue;
      const auto j = as_size(skeleton.joint_of_bone(clip.joints[b].name, BoneRule::exact));
      EXPECT_LT((found[b].translation() - expected[j].translation()).norm(), 1e-9) << clip.joints[b].name;
      EXPECT_LT((found[b].linear() * rest_pose[j].linear() - expected[j].linear()).norm(), 1e-9)
          << clip.joints[b].name << " frame " << f;
    }
  }
}

TEST(BvhAgrees, AMotionWithTheSkeletonItCameFrom) {
  const TemporaryFolder folder;
  const Character character = make_test_character();
  Motion motion;
  for (int f = 0; f < 12; ++f) {
    motion.frames.push_back(character.rest_dofs);
    for (std::size_t d = 0; d < motion.frames.back().size(); ++d)
      motion.frames.back()[d] += 0.9 * std::sin(0.7 * f + static_cast<double>(d));
    motion.ids.push_back(f);
  }
  for (const std::vector<double>& rest :
       {std::vector<double>(character.rest_dofs.size(), 0.0), character.rest_dofs, motion.frames[3]}) {
    const BvhClip clip = bvh_from_motion(character.skeleton, motion, 25.0, rest);
    EXPECT_LT(clip.joints.size(), character.skeleton.joints.size());
    expect_same_motion(character.skeleton, motion, rest, clip);
    write_bvh(folder / "m.bvh", clip);
    expect_same_motion(character.skeleton, motion, rest, read_bvh(folder / "m.bvh"));
    for (std::size_t f = 1; f < clip.frames.size(); ++f)
      for (std::size_t c = 0; c < clip.frames[f].size(); ++c)
        EXPECT_LT(std::abs(clip.frames[f][c] - clip.frames[f - 1][c]), M_PI + 1e-9) << "a channel jumps";
  }
}

TEST(BvhAgrees, ZUpTurnsTheWholeMotion) {
  const Character character = make_test_character();
  Motion motion;
  motion.frames.push_back(character.rest_dofs);
  for (std::size_t d = 0; d < motion.frames[0].size(); ++d)
    motion.frames[0][d] += std::sin(1.0 + static_cast<double>(d));
  const BvhClip clip = bvh_from_motion(character.skeleton, motion, 25.0);
  const BvhClip turned = with_z_up(clip);
  const Eigen::Matrix3d to_z_up = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const auto before = clip.pose(clip.frames[0]), after = turned.pose(turned.frames[0]);
  for (std::size_t j = 0; j < clip.joints.size(); ++j) {
    EXPECT_LT((after[j].translation() - to_z_up * before[j].translation()).norm(), 1e-12) << clip.joints[j].name;
    EXPECT_LT((after[j].linear() - to_z_up * before[j].linear() * to_z_up.transpose()).norm(), 1e-12)
        << clip.joints[j].name;
  }
}

TEST(BvhAgrees, GimbalLockKeepsTheRotation) {
  Skeleton skeleton;
  skeleton.joints.push_back({"A_rx", Joint::Type::revolute, -1, {0, 1, 0}, Eigen::Vector3d::UnitX()});
  skeleton.joints.push_back({"A_ry", Joint::Type::revolute, 0, {0, 0, 0}, Eigen::Vector3d::UnitY()});
  skeleton.dofs.push_back({"x", {{0, 1.0}}, std::nullopt});
  skeleton.dofs.push_back({"y", {{1, 1.0}}, std::nullopt});
  Motion motion;
  for (const double x : {0.3, M_PI / 2, -M_PI / 2, 2.0}) motion.frames.push_back({x, 0.8});
  expect_same_motion(skeleton, motion, {0, 0}, bvh_from_motion(skeleton, motion, 25.0));
}

TEST(JointTracksReference, ResamplingKeepsBonesAndEnds) {
  const Character character = make_test_character();
  Motion motion;
  for (int f = 0; f < 7; ++f) {
    motion.frames.push_back(character.rest_dofs);
    motion.frames.back()[0] = 0.1 * f;
    motion.frames.back()[4] += 0.1 * f;
  }
  const JointTracks tracks = joint_tracks(character.skeleton, motion, 30.0);
  const JointTracks denser = resample(tracks, 60.0);
  ASSERT_EQ(denser.num_frames(), 13);
  for (int f = 0; f < 7; ++f)
    for (std::size_t j = 0; j < tracks.names.size(); ++j)
      EXPECT_LT((denser.frames[2 * f][j].matrix() - tracks.frames[f][j].matrix()).norm(), 1e-9);
  EXPECT_NEAR(denser.frames[5][0].translation().x(), 0.25 + character.skeleton.joints[0].offset.x(), 1e-9);
  const auto length = [&](const std::vector<Eigen::Affine3d>& pose, int a, int b) {
    return (pose[a].translation() - pose[b].translation()).norm();
  };
  const int a = test_character::segment_joint(2), b = test_character::segment_joint(3);
  for (const auto& pose : denser.frames) EXPECT_NEAR(length(pose, a, b), length(tracks.rest, a, b), 1e-9);
  EXPECT_EQ(resample(tracks, 12.0).num_frames(), 3);
  EXPECT_THROW(resample(tracks, 0.0), UsageError);
  EXPECT_THROW(resample(tracks, std::nan("")), UsageError);
  JointTracks slow = tracks;
  slow.seconds_per_frame = 1e4;
  EXPECT_THROW(resample(slow, 1000.0), UsageError);
}

TEST(BvhRejects, FaultsWithTheirLine) {
  BvhFile file;
  EXPECT_THAT(file.complaint(with("HIERARCHY", "Hierarchie")), AllOf(HasSubstr("a.bvh:1"), HasSubstr("HIERARCHY")));
  EXPECT_THAT(file.complaint(with("JOINT Left Leg", "JOINT Hips")),
              AllOf(HasSubstr("a.bvh:6"), HasSubstr("line 2"), HasSubstr("Hips")));
  EXPECT_THAT(file.complaint(with("OFFSET 10 -5 0", "OFFSET 10 -5")), HasSubstr("a.bvh:8"));
  EXPECT_THAT(file.complaint(with("OFFSET 10 -5 0", "OFFSET nan 0 0")), HasSubstr("a.bvh:7"));
  EXPECT_THAT(file.complaint(with("\t\tOFFSET 10 -5 0\n", "")), HasSubstr("no OFFSET"));
  EXPECT_THAT(file.complaint(with("OFFSET 0.0 90.0 0.0", "OFFSET 0 0 0 OFFSET 0 0 0")), HasSubstr("second OFFSET"));
  EXPECT_THAT(file.complaint(with("CHANNELS 3 Z", "CHANNELS 10 Z")), AllOf(HasSubstr("a.bvh:8"), HasSubstr("10")));
  EXPECT_THAT(file.complaint(with("CHANNELS 3 Zrotation", "CHANNELS 3 Xrotation")), HasSubstr("twice"));
  EXPECT_THAT(file.complaint(with("CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation")),
              AllOf(HasSubstr("Wrotation"), HasSubstr("Xposition")));
  EXPECT_THAT(file.complaint(with("Frames: 2", "Frames: 3")), HasSubstr("a.bvh:19"));
  EXPECT_THAT(file.complaint(with("Frames: 2", "Frames: 1")), HasSubstr("more lines"));
  EXPECT_THAT(file.complaint(with("Frames: 2", "Frames: 99999999999")), HasSubstr("a.bvh:16"));
  for (const char* frames : {"Frames: 0", "Frames: 1.5", "Frames:", "Frames: nan", "Frames 2"})
    EXPECT_THAT(file.complaint(with("Frames: 2", frames)), HasSubstr("a.bvh:16"));
  EXPECT_THAT(file.complaint(with("0.04", "0")), HasSubstr("a.bvh:17"));
  EXPECT_THAT(file.complaint(with("Frame Time", "Time")), HasSubstr("expected 'Frame Time: <seconds>', found 'Time:"));
  EXPECT_THAT(file.complaint(with("0 90 0 0 0 0 0 0 0", "0 90 0 0 0 0 0 0")),
              AllOf(HasSubstr("a.bvh:18"), HasSubstr("8 numbers"), HasSubstr("9 channels")));
  EXPECT_THAT(file.complaint(with("0 90 0 0 0 0 0 0 0", "0 90 0 0 inf 0 0 0 0")), HasSubstr("a.bvh:18"));
  EXPECT_THAT(file.complaint(with("MOTION", "ROOT")), HasSubstr("second skeleton"));
}

TEST(BvhRejects, ASizeThatNoUnitExplains) {
  BvhFile file;
  EXPECT_THAT(file.complaint(with("OFFSET 0 -80 0", "OFFSET 0 -30 0")),
              AllOf(HasSubstr("35"), HasSubstr("--unit"), HasSubstr("0.0254")));
}

TEST(BvhRejects, ClipsThatCannotBeWritten) {
  const TemporaryFolder folder;
  BvhFile file;
  BvhClip clip = file.read(kText);
  clip.frames[0][2] = std::nan("");
  EXPECT_THROW(write_bvh(folder / "x.bvh", clip), Error);
  clip.frames[0] = {1.0};
  EXPECT_THROW(write_bvh(folder / "x.bvh", clip), Error);
  EXPECT_THROW(clip.pose(clip.frames[0]), Error);
  clip.joints[1].parent = 2;
  EXPECT_THROW(write_bvh(folder / "x.bvh", clip), Error);
  EXPECT_THROW(write_bvh(folder / "x.bvh", BvhClip{}), Error);
}

TEST(BvhRejects, HostileFiles) {
  const TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "h.bvh", kText, [](const auto& path) { read_bvh(path, 0.01); });
}

TEST(BvhRejects, AHundredThousandJointsWithinEachOtherWithoutRunningOutOfStack) {
  BvhFile file;
  std::string text = "HIERARCHY\nROOT r { OFFSET 0 0 0 CHANNELS 3 Xrotation Yrotation Zrotation\n";
  for (int i = 0; i < 100000; ++i) text += "JOINT j" + std::to_string(i) + " { OFFSET 0 0 0\n";
  EXPECT_THAT(file.complaint(text), HasSubstr("a.bvh:"));
}

}  // namespace
}  // namespace doppel::bvh_test
