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
std::string smpl_file(char up, int width, bool deflated = false, const std::string& poses_name = "poses") {
  std::vector<double> poses, positions;
  for (int f = 0; f < kFrames; ++f) {
    const double share = f / (kFrames - 1.0);
    std::vector<double> row(width, 0.0);
    if (up == 'z') row[0] = M_PI / 2;     // y of the body to z of the world
    row[18 * 3 + 1] = -share * M_PI / 2;  // left elbow: from x towards z
    row[5 * 3] = share * kKnee;           // right knee: from -y towards -z
    poses.insert(poses.end(), row.begin(), row.end());
    const double height = 0.9;
    const std::vector<double> position{share, up == 'z' ? 0.0 : height, up == 'z' ? height : 0.0};
    positions.insert(positions.end(), position.begin(), position.end());
  }
  support::NpzWriter file(deflated);
  file.add(poses_name, poses, {kFrames, width});
  file.add("trans", positions, {kFrames, 3});
  file.add("mocap_framerate", {kRate}, {});
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

TEST_F(SmplMotion, WithYUpIsFoundByTheTrunk) {
  const MotionFromFile motion = read("walk.npz", smpl_file('y', 165));
  expect_the_motion(motion, kSmplLeg);
  EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr("the trunk stands along y")));
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

TEST_F(MarkerMotion, OfC3dWithMissingPointsIsFilledIn) {
  support::C3dWriter file = c3d_file();
  const auto wrist = as_size(std::find(file.labels.begin(), file.labels.end(), "LWrist") - file.labels.begin());
  for (const std::size_t frame : {2U, 5U, 6U}) file.frames[frame][wrist].setConstant(NAN);
  const MotionFromFile motion = read("take.c3d", file.bytes());
  expect_the_motion(motion, kPointLeg, 1.5);
  EXPECT_THAT(motion.notes, ::testing::Contains(::testing::HasSubstr("3 positions of joints were missing")));
}

TEST_F(MarkerMotion, OfTrcMovesTheCharacter) {
  std::string names = "Frame#\tTime", axes = "\t", rows;
  int count = 0;
  for (const auto& [name, at] : posed_points(0)) {
    names += "\t" + name + "\t\t";
    ++count;
    axes += fmt::format("\tX{0}\tY{0}\tZ{0}", count);
  }
  for (int f = 0; f < kFrames; ++f) {
    rows += fmt::format("{}\t{}", f + 1, f / kRate);
    for (const auto& [name, at] : posed_points(f / (kFrames - 1.0)))
      rows += fmt::format("\t{}\t{}\t{}", at.x(), at.y(), at.z());
    rows += "\n";
  }
  const std::string file =
      "PathFileType\t4\t(X/Y/Z)\tx.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n10\t10\t11\t" +
      std::to_string(count) + "\tm\n" + names + "\n" + axes + "\n" + rows;
  expect_the_motion(read("take.trc", file), kPointLeg, 1.5);
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

TEST_F(RigMotion, OfUnknownExtensionIsRefused) {
  EXPECT_THAT(refusal("x.mvnx", "x"), ::testing::HasSubstr("this extension is not one of them"));
}

}  // namespace
}  // namespace doppel::read_motion_file_test
