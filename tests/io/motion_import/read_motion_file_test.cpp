// One motion, written in each format by an independent writer: the left elbow is bent by 90 degrees about the vertical,
// the right knee by 60 degrees about the axis from right to left, and the body moves 1 m to its left in one second. In
// the files the body stands in a T-pose otherwise and looks along z.
#include "doppel/io/motion_import/read_motion_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "motion_writers.h"
#include "support/gltf_writer.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "test_figure.h"

namespace doppel::read_motion_file_test {
namespace {

using Eigen::Vector3d;
using support::off_direction;
using support::position_of;

constexpr int kFrames = 11;
constexpr double kRate = 10.0, kKnee = M_PI / 3;
/// The direction of the right shank: bent backwards.
const Vector3d kShank(0, -std::cos(kKnee), -std::sin(kKnee));

class MotionOfAnotherBody : public ::testing::Test {
 protected:
  MotionFromFile read(const std::string& name, const std::string& content, const MotionFileOptions& options = {}) {
    support::write_bytes(folder_ / name, content);
    return read_motion_file(folder_ / name, character_, options);
  }
  std::string refusal(const std::string& name, const std::string& content, const MotionFileOptions& options = {}) {
    return support::message_of([&] { read(name, content, options); });
  }

  /// @param leg of the source, hip to toe, metres
  void expect_the_motion(const MotionFromFile& read, double leg, double degrees = 1.0) {
    ASSERT_EQ(read.motion.num_frames(), kFrames);
    EXPECT_NEAR(read.frames_per_second, kRate, 1e-4);
    const std::vector<double>&first = read.motion.frames.front(), &last = read.motion.frames.back();
    EXPECT_LT(off_direction(character_, last, "LeftArm", "LeftForeArm", Vector3d::UnitX()), degrees);
    EXPECT_LT(off_direction(character_, last, "LeftForeArm", "LeftHand", Vector3d::UnitZ()), degrees);
    EXPECT_LT(off_direction(character_, last, "RightArm", "RightForeArm", -Vector3d::UnitX()), degrees);
    EXPECT_LT(off_direction(character_, last, "RightForeArm", "RightHand", -Vector3d::UnitX()), degrees);
    EXPECT_LT(off_direction(character_, last, "LeftUpLeg", "LeftLeg", -Vector3d::UnitY()), degrees);
    EXPECT_LT(off_direction(character_, last, "LeftLeg", "LeftFoot", -Vector3d::UnitY()), degrees);
    EXPECT_LT(off_direction(character_, last, "RightUpLeg", "RightLeg", -Vector3d::UnitY()), degrees);
    EXPECT_LT(off_direction(character_, last, "RightLeg", "RightFoot", kShank), degrees);
    EXPECT_LT(off_direction(character_, first, "LeftForeArm", "LeftHand", Vector3d::UnitX()), degrees);
    // The way of the body is scaled by the length of the legs.
    const auto length = [&](const char* a, const char* b) {
      return (position_of(character_, character_.rest_dofs, a) - position_of(character_, character_.rest_dofs, b))
          .norm();
    };
    const double ours =
        length("LeftUpLeg", "LeftLeg") + length("LeftLeg", "LeftFoot") + length("LeftFoot", "LeftToeBase");
    const Vector3d way = position_of(character_, last, "Root") - position_of(character_, first, "Root");
    EXPECT_NEAR(way.x(), ours / leg, 0.01);
    EXPECT_NEAR(way.y(), 0.0, 0.01);
    EXPECT_NEAR(way.z(), 0.0, 0.01);
    // It stands on the floor.
    EXPECT_NEAR(position_of(character_, first, "LeftToeBase").y(), 0.02, 0.04);
  }

  Character character_ = support::tall_character();
  support::TemporaryFolder folder_;
};

// ---- SMPL ----

/// Segments of the figure that SMPL files are read with, metres: thigh, shank, foot.
const double kSmplLeg = 0.245 * 1.70 + 0.246 * 1.70 + std::hypot(0.0663 - 0.020, 0.130);

/// @param up of the file's world; AMASS has z @param width numbers of a pose
/// @param amass the names of the arrays are those of AMASS @param factor of the angles
std::string smpl_file(char up, int width, bool deflated = false, bool amass = true, double factor = 1.0) {
  std::vector<double> poses, positions;
  for (int f = 0; f < kFrames; ++f) {
    const double share = f / (kFrames - 1.0);
    std::vector<double> row(width, 0.0);
    if (up == 'z') row[0] = M_PI / 2;     // y of the body to z of the world
    row[18 * 3 + 1] = -share * M_PI / 2;  // left elbow: from x towards z
    row[5 * 3] = share * kKnee;           // right knee: from -y towards -z
    for (double& angle : row) angle *= factor;
    poses.insert(poses.end(), row.begin(), row.end());
    const double height = 0.9;
    const std::vector<double> position{share, up == 'z' ? 0.0 : height, up == 'z' ? height : 0.0};
    positions.insert(positions.end(), position.begin(), position.end());
  }
  support::NpzWriter file(deflated);
  file.add("poses", poses, {kFrames, width});
  file.add(amass ? "trans" : "transl", positions, {kFrames, 3});
  file.add(amass ? "mocap_framerate" : "fps", {kRate}, {});
  file.add("betas", std::vector<double>(16, 0.0), {16});
  file.add_bytes("gender.npy", "not read");
  return file.bytes();
}

class SmplMotion : public MotionOfAnotherBody {};

TEST_F(SmplMotion, OfAmassMovesTheCharacter) {
  for (const int width : {66, 72, 156, 165})
    for (const bool deflated : {false, true}) {
      SCOPED_TRACE(std::to_string(width) + (deflated ? " deflated" : " stored"));
      expect_the_motion(read("walk_poses.npz", smpl_file('z', width, deflated)), kSmplLeg);
    }
}

TEST_F(SmplMotion, OfAnotherProgramHasTheVerticalOfTheTrunk) {
  for (const char up : {'y', 'z'}) {
    const MotionFromFile motion = read("walk.npz", smpl_file(up, 165, false, false));
    expect_the_motion(motion, kSmplLeg);
    EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr(std::string("the trunk stands along ") + up)));
    EXPECT_THAT(motion.warnings, ::testing::IsEmpty());
  }
}

TEST_F(SmplMotion, OfAmassThatLiesLiesAndIsNamed) {
  // Upright along y is lying on the floor of AMASS, whose vertical is z.
  const MotionFromFile motion = read("lying.npz", smpl_file('y', 165));
  const std::vector<double>& first = motion.motion.frames.front();
  EXPECT_LT(off_direction(character_, first, "Root", "Head", -Vector3d::UnitZ()), 10.0);
  for (const char* bone : {"Root", "Head", "LeftFoot"})
    EXPECT_NEAR(position_of(character_, first, bone).y(), 0.45, 0.1) << bone;  // its bent shank is below it later
  EXPECT_THAT(motion.warnings, ::testing::ElementsAre(::testing::AllOf(::testing::HasSubstr("points along y"),
                                                                       ::testing::HasSubstr("as in AMASS"),
                                                                       ::testing::HasSubstr("--up y"))));
  MotionFileOptions stated;
  stated.source.up = 'y';
  const MotionFromFile standing = read("walk.npz", smpl_file('y', 165), stated);
  expect_the_motion(standing, kSmplLeg);
  EXPECT_THAT(standing.warnings, ::testing::IsEmpty());
}

TEST_F(SmplMotion, ThatIsNoAxisAnglesIsRefused) {
  for (const auto& [width, form] : std::vector<std::pair<int, std::string>>{{132, "the 6 numbers of two columns of 22"},
                                                                            {144, "the 6 numbers of two columns of 24"},
                                                                            {312, "the 6 numbers of two columns of 52"},
                                                                            {88, "quaternions of 22 joints"},
                                                                            {96, "quaternions of 24 joints"},
                                                                            {198, "matrices of 22 joints"},
                                                                            {216, "matrices of 24 joints"}})
    EXPECT_THAT(refusal("x.npz", smpl_file('z', width)),
                ::testing::AllOf(::testing::HasSubstr(std::to_string(width) + " numbers of pose"),
                                 ::testing::HasSubstr("156 (SMPL-H)"), ::testing::HasSubstr(form)));
  for (const int width : {69, 75, 90, 168})
    EXPECT_THAT(refusal("x.npz", smpl_file('z', width)), ::testing::HasSubstr("no body of SMPL"));
}

TEST_F(SmplMotion, InDegreesIsRefused) {
  // A person who stands with lowered arms: hips, knees, shoulders and elbows are bent by some degrees.
  const auto standing = [](double unit) {
    std::vector<double> row(66, 0.0);
    row[0] = 90 * unit;
    for (const auto& [joint, degrees] : std::vector<std::pair<int, double>>{
             {1, 4}, {2, -5}, {4, 9}, {5, 11}, {16, -65}, {17, 68}, {18, -20}, {19, 15}})
      row[3 * joint + 1] = degrees * unit;
    support::NpzWriter file;
    file.add("poses", row, {1, 66});
    file.add("trans", {0, 0, 0.9}, {1, 3});
    file.add("mocap_framerate", {30}, {});
    return file.bytes();
  };
  EXPECT_THAT(refusal("x.npz", standing(1.0)),
              ::testing::AllOf(::testing::HasSubstr("angles up to 68"), ::testing::HasSubstr("pi / 180")));
  EXPECT_EQ(read("x.npz", standing(M_PI / 180)).motion.num_frames(), 1);
}

TEST_F(SmplMotion, MayWindTheRootAndAJointSeveralTimes) {
  std::vector<double> row(66, 0.0);
  row[0] = M_PI / 2 + 6 * M_PI;
  row[3 * 20] = 2.5 * M_PI;
  support::NpzWriter file;
  file.add("poses", row, {1, 66});
  file.add("fps", {30}, {});
  const MotionFromFile motion = read("x.npz", file.bytes());
  EXPECT_LT(off_direction(character_, motion.motion.frames[0], "Root", "Head", Vector3d::UnitY()), 10.0);
}

TEST_F(SmplMotion, InPartsIsTheSame) {
  support::NpzWriter file;
  std::vector<double> root, body;
  for (int f = 0; f < 2; ++f) {
    root.insert(root.end(), {M_PI / 2, 0, 0});
    std::vector<double> row(63, 0.0);
    row[17 * 3 + 1] = -M_PI / 2;
    body.insert(body.end(), row.begin(), row.end());
  }
  file.add("root_orient", root, {2, 3});
  file.add("pose_body", body, {2, 63});
  MotionFileOptions options;
  options.source.frames_per_second = 30;
  const MotionFromFile motion = read("x.npz", file.bytes(), options);
  EXPECT_EQ(motion.frames_per_second, 30);
  EXPECT_LT(off_direction(character_, motion.motion.frames[1], "LeftForeArm", "LeftHand", Vector3d::UnitZ()), 1.0);
  EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr("no 'trans'")));
}

TEST_F(SmplMotion, IsResampledToTheRateThatIsAskedFor) {
  MotionFileOptions options;
  options.frames_per_second = 20;
  const MotionFromFile motion = read("x.npz", smpl_file('z', 72), options);
  EXPECT_EQ(motion.motion.num_frames(), 2 * kFrames - 1);
  EXPECT_EQ(motion.frames_per_second, 20);
}

TEST_F(SmplMotion, ThatIsWrongIsRefusedByName) {
  const auto with = [](const std::vector<double>& poses, std::vector<std::int64_t> shape) {
    support::NpzWriter file;
    file.add("poses", poses, shape);
    file.add("fps", {30}, {});
    return file.bytes();
  };
  std::vector<double> nan(2 * 66, 0.0);
  nan[70] = NAN;
  EXPECT_THAT(refusal("x.npz", with(nan, {2, 66})), ::testing::HasSubstr("'poses' holds nan in frame 1"));
  EXPECT_THAT(refusal("x.npz", with(std::vector<double>(48, 0), {1, 48})), ::testing::HasSubstr("48 numbers of pose"));
  EXPECT_THAT(refusal("x.npz", with({}, {0, 66})), ::testing::HasSubstr("has 0 frames"));
  EXPECT_THAT(refusal("x.npz", with(std::vector<double>(66 * 9, 0), {1, 66, 9})), ::testing::HasSubstr("(1, 66, 9)"));
  support::NpzWriter other;
  other.add("vertices", {1, 2, 3}, {1, 3});
  EXPECT_THAT(refusal("x.npz", other.bytes()), ::testing::HasSubstr("It has: vertices"));
  support::NpzWriter no_rate;
  no_rate.add("poses", std::vector<double>(66, 0), {1, 66});
  EXPECT_THAT(refusal("x.npz", no_rate.bytes()), ::testing::HasSubstr("no frame rate"));
  EXPECT_THAT(refusal("x.npz", "PK but no more of it"), ::testing::HasSubstr("truncated"));
}

TEST_F(SmplMotion, BombsAreRefusedBeforeMemoryIsTaken) {
  // The directory claims 4 GB unpacked from a few bytes.
  std::string bytes = smpl_file('z', 66, true);
  for (std::size_t at = bytes.find("PK\x01\x02"); at != std::string::npos; at = bytes.find("PK\x01\x02", at + 4))
    for (std::size_t i = 0; i < 4; ++i) bytes[at + 24 + i] = static_cast<char>(i == 3 ? 0x7f : 0xff);
  EXPECT_THAT(refusal("x.npz", bytes), ::testing::HasSubstr("claims 2147483647 bytes"));
}

TEST_F(SmplMotion, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(folder_ / "x.npz", smpl_file('z', 66, true),
                                         [&](const auto& path) { read_motion_file(path, character_); });
}

TEST_F(SmplMotion, SurvivesEveryTruncation) {
  support::NpzWriter file(true);
  file.add("poses", std::vector<double>(66, 0.1), {1, 66});
  file.add("fps", {30}, {});
  const std::string bytes = file.bytes();
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_NE(refusal("x.npz", bytes.substr(0, n)), "nothing was thrown") << n;
}

// ---- points in space ----

/// A body of 1.6 m in a T-pose; the joints of one side and the middle.
const std::map<std::string, Vector3d> kPoints{
    {"Neck", {0, 1.36, 0}},     {"Head", {0, 1.52, 0.03}},  {"Shoulder", {0.16, 1.34, 0}},
    {"Elbow", {0.43, 1.34, 0}}, {"Wrist", {0.66, 1.34, 0}}, {"Hip", {0.08, 0.86, 0}},
    {"Knee", {0.08, 0.46, 0}},  {"Ankle", {0.08, 0.07, 0}}, {"BigToe", {0.08, 0.02, 0.12}}};
const double kPointLeg = 0.40 + 0.39 + std::hypot(0.05, 0.12);

/// Positions of the points at one time: y up, metres. @param share of the motion that is done
std::map<std::string, Vector3d> posed_points(double share) {
  std::map<std::string, Vector3d> placed;
  for (const auto& [name, at] : kPoints)
    if (at.x() == 0)
      placed[name] = at;
    else
      for (const bool left : {true, false})
        placed[(left ? "L" : "R") + name] = Vector3d(left ? at.x() : -at.x(), at.y(), at.z());
  const auto turn = [&](const char* centre, const Eigen::AngleAxisd& by, std::initializer_list<const char*> moved) {
    for (const char* name : moved) placed[name] = placed[centre] + by * (placed[name] - placed[centre]);
  };
  turn("LElbow", {-share * M_PI / 2, Vector3d::UnitY()}, {"LWrist"});
  turn("RKnee", {share * kKnee, Vector3d::UnitX()}, {"RAnkle", "RBigToe"});
  for (auto& [name, at] : placed) at.x() += share;
  return placed;
}

/// y up to the world of a C3D file: z up.
Vector3d z_up(const Vector3d& p) { return {p.x(), -p.z(), p.y()}; }

support::C3dWriter c3d_file() {
  support::C3dWriter file;
  file.rate = kRate;
  for (const auto& [name, at] : posed_points(0)) file.labels.push_back(name);
  for (int f = 0; f < kFrames; ++f) {
    auto& frame = file.frames.emplace_back();
    for (const auto& [name, at] : posed_points(f / (kFrames - 1.0))) frame.push_back(1000 * z_up(at));
  }
  return file;
}

class MarkerMotion : public MotionOfAnotherBody {};

TEST_F(MarkerMotion, OfC3dMovesTheCharacter) {
  for (const int machine : {84, 85, 86})
    for (const double scale : {-1.0, 0.1}) {
      SCOPED_TRACE(std::to_string(machine) + (scale < 0 ? " floats" : " integers"));
      support::C3dWriter file = c3d_file();
      file.machine = machine;
      file.scale = scale;
      expect_the_motion(read("take.c3d", file.bytes()), kPointLeg, 1.5);
    }
}

TEST_F(MarkerMotion, OfC3dInCentimetresWithASubjectIsTheSame) {
  support::C3dWriter file = c3d_file();
  file.units = "cm";
  file.first_frame = 301;
  for (std::string& label : file.labels) label = "Anna:" + label;
  for (auto& frame : file.frames)
    for (Vector3d& point : frame) point /= 10;
  expect_the_motion(read("take.c3d", file.bytes()), kPointLeg, 1.5);
}

TEST_F(MarkerMotion, OfC3dBehindTheLastFrameOfTheHeaderIsRead) {
  support::C3dWriter file = c3d_file();
  file.first_frame = 65530;
  expect_the_motion(read("take.c3d", file.bytes()), kPointLeg, 1.5);
}

TEST_F(MarkerMotion, OfC3dWithMissingPointsIsFilledIn) {
  support::C3dWriter file = c3d_file();
  const auto wrist = as_size(std::find(file.labels.begin(), file.labels.end(), "LWrist") - file.labels.begin());
  for (const std::size_t frame : {2U, 5U, 6U}) file.frames[frame][wrist].setConstant(NAN);
  const MotionFromFile motion = read("take.c3d", file.bytes());
  expect_the_motion(motion, kPointLeg, 1.5);
  EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr("3 positions of joints were missing")));
}

/// A TRC file of the frames of a C3D file, in its axes.
std::string trc_file(const support::C3dWriter& file) {
  std::string names = "Frame#\tTime", axes = "\t", rows;
  for (std::size_t i = 0; i < file.labels.size(); ++i) {
    names += "\t" + file.labels[i] + "\t\t";
    axes += fmt::format("\tX{0}\tY{0}\tZ{0}", i + 1);
  }
  for (std::size_t f = 0; f < file.frames.size(); ++f) {
    rows += fmt::format("{}\t{}", f + 1, static_cast<double>(f) / kRate);
    for (const Vector3d& at : file.frames[f]) rows += fmt::format("\t{}\t{}\t{}", at.x(), at.y(), at.z());
    rows += "\n";
  }
  return fmt::format(
      "PathFileType\t4\t(X/Y/"
      "Z)\tx.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n10\t10\t{}\t{}\tmm\n{}\n{}\n"
      "{}",
      file.frames.size(), file.labels.size(), names, axes, rows);
}

/// The file with all points rotated about the origin.
support::C3dWriter turned(support::C3dWriter file, const Eigen::AngleAxisd& turn) {
  for (auto& frame : file.frames)
    for (Vector3d& point : frame) point = turn * point;
  return file;
}
/// From z up to y up, lying in a file with z up.
const Eigen::AngleAxisd kLaidDown(-M_PI / 2, Vector3d::UnitX());

TEST_F(MarkerMotion, OfTrcMovesTheCharacter) {
  const MotionFromFile motion = read("take.trc", trc_file(turned(c3d_file(), kLaidDown)));
  expect_the_motion(motion, kPointLeg, 1.5);
  EXPECT_THAT(motion.warnings, ::testing::IsEmpty());
}

TEST_F(MarkerMotion, ThatLiesByItsFileLiesAndIsNamed) {
  const auto expect_lying = [&](const MotionFromFile& motion, const std::string& reason) {
    const std::vector<double>& last = motion.motion.frames.back();
    EXPECT_NEAR(off_direction(character_, last, "Root", "Head", Vector3d::UnitY()), 90.0, 10.0);
    EXPECT_NEAR(off_direction(character_, last, "LeftUpLeg", "LeftFoot", Vector3d::UnitY()), 90.0, 10.0);
    EXPECT_THAT(motion.warnings,
                ::testing::ElementsAre(::testing::AllOf(::testing::HasSubstr(reason), ::testing::HasSubstr("--up"))));
  };
  expect_lying(read("take.c3d", turned(c3d_file(), kLaidDown).bytes()), "POINT:Y_SCREEN");
  expect_lying(read("take.trc", trc_file(c3d_file())), "as usual in TRC files");
  MotionFileOptions stated;
  stated.source.up = 'z';
  const MotionFromFile standing = read("take.trc", trc_file(c3d_file()), stated);
  expect_the_motion(standing, kPointLeg, 1.5);
  EXPECT_THAT(standing.warnings, ::testing::IsEmpty());
}

TEST_F(MarkerMotion, OnTheHandsIsUpsideDown) {
  const Eigen::AngleAxisd over(M_PI, Vector3d::UnitX());
  for (const MotionFromFile& motion : {read("take.c3d", turned(c3d_file(), over).bytes()),
                                       read("take.trc", trc_file(turned(turned(c3d_file(), kLaidDown), over)))}) {
    const std::vector<double>& first = motion.motion.frames.front();
    EXPECT_LT(position_of(character_, first, "Head").y(), position_of(character_, first, "LeftFoot").y() - 1.0);
    EXPECT_THAT(motion.warnings, ::testing::ElementsAre(::testing::HasSubstr("177 degrees")));
  }
}

TEST_F(MarkerMotion, OfC3dThatStatesNoVerticalStands) {
  support::C3dWriter file = turned(c3d_file(), kLaidDown);
  file.up = "";
  const MotionFromFile motion = read("take.c3d", file.bytes());
  expect_the_motion(motion, kPointLeg, 1.5);
  EXPECT_THAT(motion.notes,
              ::testing::Contains(::testing::HasSubstr("y is taken as the vertical, as the body stands")));
}

/// Two people 3 m apart: the first lacks the right foot, the second stands in a T-pose.
/// @param anna what stands before the names of her points @param bert of his
support::C3dWriter two_people(const std::string& anna, const std::string& bert) {
  const support::C3dWriter alone = c3d_file();
  support::C3dWriter file = alone;
  file.labels.clear();
  for (auto& frame : file.frames) frame.clear();
  for (const bool first : {true, false})
    for (std::size_t i = 0; i < alone.labels.size(); ++i) {
      const std::string& label = alone.labels[i];
      if (first && (label == "RAnkle" || label == "RBigToe")) continue;
      file.labels.push_back((first ? anna : bert) + label);
      for (std::size_t f = 0; f < alone.frames.size(); ++f)
        file.frames[f].push_back(first ? alone.frames[f][i] : Vector3d(alone.frames[0][i] + Vector3d(3000, 0, 0)));
    }
  return file;
}

TEST_F(MarkerMotion, OfTwoPeopleIsThatOfOne) {
  support::C3dWriter alone = two_people("", "Bert:");
  const std::size_t count = as_size(
      std::find_if(alone.labels.begin(), alone.labels.end(), [](const std::string& name) { return name[0] == 'B'; }) -
      alone.labels.begin());
  alone.labels.resize(count);
  for (auto& frame : alone.frames) frame.resize(count);
  const MotionFromFile expected = read("alone.c3d", alone.bytes());
  EXPECT_THAT(expected.warnings, ::testing::IsEmpty());
  for (const std::string divider : {":", "_", ".", " ", "-", "/", "|"}) {
    SCOPED_TRACE(divider);
    const support::C3dWriter both = two_people("Anna" + divider, "Bert" + divider);
    for (const bool trc : {false, true}) {
      const std::string name = trc ? "both.trc" : "both.c3d";
      const std::string content = trc ? trc_file(turned(both, kLaidDown)) : both.bytes();
      const MotionFromFile found = read(name, content);
      EXPECT_THAT(found.warnings,
                  ::testing::ElementsAre(::testing::AllOf(::testing::HasSubstr("2 people (Anna, Bert); Anna is taken"),
                                                          ::testing::HasSubstr("--person"))));
      for (int f = 0; f < kFrames; ++f)
        for (const char* bone : {"Root", "Head", "RightLeg", "RightFoot", "LeftFoot", "LeftHand"})
          EXPECT_LT((position_of(character_, found.motion.frames[f], bone) -
                     position_of(character_, expected.motion.frames[f], bone))
                        .norm(),
                    1e-3)
              << bone;
      MotionFileOptions options;
      options.source.person = "Bert";
      const MotionFromFile bert = read(name, content, options);
      EXPECT_THAT(bert.warnings, ::testing::IsEmpty());
      EXPECT_GT(position_of(character_, bert.motion.frames[0], "Root").x(), 2.5);
      options.source.person = "Berta";
      EXPECT_THAT(refusal(name, content, options),
                  ::testing::AllOf(::testing::HasSubstr("--person Berta"), ::testing::HasSubstr("Anna, Bert"),
                                   ::testing::HasSubstr("did you mean Bert")));
    }
  }
}

TEST_F(MarkerMotion, OfSomebodyBesideAPersonWithoutANameIsApart) {
  const support::C3dWriter both = two_people("", "Bert:");
  EXPECT_THAT(read("both.c3d", both.bytes()).warnings,
              ::testing::ElementsAre(::testing::HasSubstr("2 people (unnamed, Bert); unnamed is taken")));
  MotionFileOptions options;
  options.source.person = "Bert";
  EXPECT_GT(position_of(character_, read("both.c3d", both.bytes(), options).motion.frames[0], "Root").x(), 2.5);
}

TEST_F(MarkerMotion, OfOnePersonWithToolsNamesNobody) {
  support::C3dWriter file = c3d_file();
  for (std::string& label : file.labels)
    if (label != "Neck") label = "Anna:" + label;
  file.labels.insert(file.labels.begin(), {"Wand:Tip", "Wand:Neck"});
  for (auto& frame : file.frames) frame.insert(frame.begin(), {{5000, 0, 0}, {5000, 0, 100}});
  const MotionFromFile motion = read("take.c3d", file.bytes());
  expect_the_motion(motion, kPointLeg, 1.5);
  EXPECT_THAT(motion.warnings, ::testing::IsEmpty());
}

TEST_F(MarkerMotion, OfSkinMarkersSaysSo) {
  support::C3dWriter file = c3d_file();
  const std::map<std::string, std::string> gait{{"Shoulder", "SHO"}, {"Elbow", "ELB"}, {"Wrist", "WRA"},
                                                {"Knee", "KNE"},     {"Ankle", "ANK"}, {"BigToe", "TOE"},
                                                {"Hip", "HJC"}};
  for (std::string& label : file.labels)
    if (gait.count(label.substr(1)) != 0) label = label[0] + gait.at(label.substr(1));
  const MotionFromFile motion = read("take.c3d", file.bytes());
  EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr("markers on the skin")));
  EXPECT_LT(off_direction(character_, motion.motion.frames.back(), "RightLeg", "RightFoot", kShank), 1.5);
}

TEST_F(MarkerMotion, ThatIsWrongIsRefusedByName) {
  support::C3dWriter file = c3d_file();
  file.units = "furlong";
  EXPECT_THAT(refusal("x.c3d", file.bytes()), ::testing::HasSubstr("the unit is 'furlong'"));
  MotionFileOptions millimetres;
  millimetres.source.metres_per_unit = 0.001;
  expect_the_motion(read("x.c3d", file.bytes(), millimetres), kPointLeg, 1.5);
  file = c3d_file();
  for (std::string& label : file.labels) label = "*" + std::to_string(label.size()) + label.substr(0, 1);
  EXPECT_THAT(refusal("x.c3d", file.bytes()), ::testing::HasSubstr("show too little of a body"));
  file = c3d_file();
  file.frames.clear();
  EXPECT_THAT(refusal("x.c3d", file.bytes()), ::testing::HasSubstr("so there are none"));
  const std::string bytes = c3d_file().bytes();
  EXPECT_THAT(refusal("x.c3d", bytes.substr(0, bytes.size() - 1)), ::testing::HasSubstr("it is truncated"));
}

TEST_F(MarkerMotion, SurvivesHostileFiles) {
  support::expect_survives_hostile_files(folder_ / "x.c3d", c3d_file().bytes(),
                                         [&](const auto& path) { read_motion_file(path, character_); });
}

TEST_F(MarkerMotion, SurvivesEveryTruncation) {
  support::C3dWriter file = c3d_file();
  file.frames.resize(1);
  const std::string bytes = file.bytes();
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_NE(refusal("x.c3d", bytes.substr(0, n)), "nothing was thrown") << n;
}

// ---- rigged figures ----

struct RigNode {
  const char* name;
  int parent;
  Vector3d position;
};
const std::vector<RigNode> kRig{{"mixamorig:Hips", -1, {0, 0.95, 0}},
                                {"mixamorig:Spine", 0, {0, 1.05, 0}},
                                {"mixamorig:Neck", 1, {0, 1.40, 0}},
                                {"mixamorig:Head", 2, {0, 1.50, 0}},
                                {"mixamorig:LeftArm", 1, {0.17, 1.38, 0}},
                                {"mixamorig:LeftForeArm", 4, {0.43, 1.38, 0}},
                                {"mixamorig:LeftHand", 5, {0.66, 1.38, 0}},
                                {"mixamorig:RightArm", 1, {-0.17, 1.38, 0}},
                                {"mixamorig:RightForeArm", 7, {-0.43, 1.38, 0}},
                                {"mixamorig:RightHand", 8, {-0.66, 1.38, 0}},
                                {"mixamorig:LeftUpLeg", 0, {0.09, 0.90, 0}},
                                {"mixamorig:LeftLeg", 10, {0.09, 0.48, 0}},
                                {"mixamorig:LeftFoot", 11, {0.09, 0.07, 0}},
                                {"mixamorig:LeftToeBase", 12, {0.09, 0.02, 0.12}},
                                {"mixamorig:RightUpLeg", 0, {-0.09, 0.90, 0}},
                                {"mixamorig:RightLeg", 14, {-0.09, 0.48, 0}},
                                {"mixamorig:RightFoot", 15, {-0.09, 0.07, 0}},
                                {"mixamorig:RightToeBase", 16, {-0.09, 0.02, 0.12}}};
const double kRigLeg = 0.42 + 0.41 + std::hypot(0.05, 0.12);

/// The nodes alone, with the motion as the animation `bend`: a file without a surface.
support::GltfWriter rig_file() {
  support::GltfWriter file;
  using Json = support::GltfWriter::Json;
  for (std::size_t i = 0; i < kRig.size(); ++i) {
    const Vector3d at =
        kRig[i].parent < 0 ? kRig[i].position : Vector3d(kRig[i].position - kRig[kRig[i].parent].position);
    Json node{{"name", kRig[i].name}, {"translation", {at.x(), at.y(), at.z()}}};
    for (std::size_t j = 0; j < kRig.size(); ++j)
      if (kRig[j].parent == static_cast<int>(i)) node["children"].push_back(j);
    file.json["nodes"].push_back(node);
  }
  std::vector<float> times, positions, elbow, knee;
  for (int f = 0; f < kFrames; ++f) {
    const double share = f / (kFrames - 1.0), e = -share * M_PI / 4, k = share * kKnee / 2;
    times.push_back(static_cast<float>(f / kRate));
    for (const double x : {share, 0.95, 0.0}) positions.push_back(static_cast<float>(x));
    for (const double x : {0.0, std::sin(e), 0.0, std::cos(e)}) elbow.push_back(static_cast<float>(x));
    for (const double x : {std::sin(k), 0.0, 0.0, std::cos(k)}) knee.push_back(static_cast<float>(x));
  }
  const int input = file.floats(times, "SCALAR", 1);
  const auto sampler = [&](int output) { return Json{{"input", input}, {"output", output}}; };
  const auto channel = [](int index, int node, const char* path) {
    return Json{{"sampler", index}, {"target", {{"node", node}, {"path", path}}}};
  };
  file.json["animations"] = Json::array(
      {{{"name", "bend"},
        {"samplers", Json::array({sampler(file.floats(positions, "VEC3", 3)), sampler(file.floats(elbow, "VEC4", 4)),
                                  sampler(file.floats(knee, "VEC4", 4))})},
        {"channels",
         Json::array({channel(0, 0, "translation"), channel(1, 5, "rotation"), channel(2, 15, "rotation")})}}});
  return file;
}

class RigMotion : public MotionOfAnotherBody {};

TEST_F(RigMotion, OfNodesWithoutASurfaceMovesTheCharacter) {
  MotionFileOptions options;
  options.frames_per_second = kRate;
  expect_the_motion(read("walk.glb", rig_file().glb(), options), kRigLeg);
}

TEST_F(RigMotion, HasTheRateOfItsKeysTimesAWholeNumber) {
  const MotionFromFile motion = read("walk.glb", rig_file().glb());
  EXPECT_EQ(motion.frames_per_second, 30);
  EXPECT_EQ(motion.motion.num_frames(), 31);
  ASSERT_TRUE(motion.guessed_map);
  EXPECT_GE(motion.guessed_map->pairs.size(), 17U);
}

TEST_F(RigMotion, IsChosenByName) {
  support::GltfWriter file = rig_file();
  file.json["animations"].push_back(file.json["animations"][0]);
  file.json["animations"][1]["name"] = "run";
  EXPECT_THAT(refusal("x.glb", file.glb()),
              ::testing::HasSubstr("2 animations; choose one by its name: 'bend', 'run'"));
  MotionFileOptions options;
  options.source.animation = "run";
  EXPECT_EQ(read("x.glb", file.glb(), options).motion.num_frames(), 31);
  options.source.animation = "jump";
  EXPECT_THAT(refusal("x.glb", file.glb(), options), ::testing::HasSubstr("it has 'bend', 'run'"));
  file.json.erase("animations");
  EXPECT_THAT(refusal("x.glb", file.glb()), ::testing::HasSubstr("has no animation"));
}

TEST_F(RigMotion, OfNoBodyIsRefusedByTheNamesOfItsJoints) {
  EXPECT_THAT(refusal("arm.glb", support::bending_arm().glb()),
              ::testing::HasSubstr("Joints of the motion: upper lower"));
}

class OwnMotion : public MotionOfAnotherBody {
 protected:
  /// A motion of the character itself: its pelvis moves by 1 m in ten steps.
  MotionFromFile walk(const MotionFileOptions& options) {
    Motion motion;
    for (int f = 0; f < kFrames; ++f) {
      motion.frames.push_back(character_.rest_dofs);
      motion.frames.back()[0] += f / (kFrames - 1.0);
    }
    write_motion(folder_ / "own.motion", motion);
    return read_motion_file(folder_ / "own.motion", character_, options);
  }
};

TEST_F(OwnMotion, IsResampledFromTheRateThatIsStated) {
  MotionFileOptions options;
  options.source.frames_per_second = 10.0;
  options.frames_per_second = 20.0;
  const MotionFromFile read = walk(options);
  EXPECT_EQ(read.frames_per_second, 20.0);
  ASSERT_EQ(read.motion.num_frames(), 2 * kFrames - 1);
  EXPECT_NEAR(read.motion.frames[3][0], character_.rest_dofs[0] + 0.15, 1e-8);
}

TEST_F(OwnMotion, IsResampledFromTheRateOfItsImport) {
  write_atomically(folder_ / "motions.json", R"({"motions": [{"file": "own.motion", "frames_per_second": 50}]})");
  MotionFileOptions options;
  EXPECT_EQ(walk(options).frames_per_second, 50.0);
  options.frames_per_second = 25.0;
  EXPECT_EQ(walk(options).motion.num_frames(), (kFrames - 1) / 2 + 1);
}

TEST_F(OwnMotion, OfUnknownRateIsPlayedRowByRow) {
  MotionFileOptions options;
  EXPECT_EQ(walk(options).frames_per_second, 25.0);
  options.frames_per_second = 60.0;
  EXPECT_EQ(walk(options).motion.num_frames(), kFrames);
}

TEST_F(RigMotion, OfUnknownExtensionIsRefused) {
  EXPECT_THAT(refusal("x.mvnx", "x"), ::testing::HasSubstr("this extension is not one of them"));
}

}  // namespace
}  // namespace doppel::read_motion_file_test
