// Animations of rigged files that people made, retargeted onto the rig itself and onto another body; points that
// another program triangulated.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>

#include "doppel/character/bvh.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/io/rig_import/import_rig.h"
#include "doppel/io/rig_import/landmarks_of_rig.h"
#include "support/rig_reference.h"
#include "test_figure.h"

namespace doppel::real_motion_test {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

/// Bones between landmarks, named by their ends.
const std::vector<std::pair<const char*, const char*>> kLimbs{
    {"shoulder", "elbow"}, {"elbow", "wrist"}, {"hip", "knee"}, {"knee", "ankle"}};

int landmark(const std::string& name) {
  return static_cast<int>(std::find(kBodyLandmarks.begin(), kBodyLandmarks.end(), name) - kBodyLandmarks.begin());
}

struct Angles {
  double mean = 0.0, largest = 0.0;
};

class RealMotions : public support::RigReferenceTest {
 protected:
  void SetUp() override {
    RigReferenceTest::SetUp();
    if (IsSkipped()) return;
    file_ = folder_ / reference_["file"].get<std::string>();
    options_.source.animation = animation().name;
    options_.frames_per_second = 30;
    ImportRigOptions import;
    import.animations = {options_.source.animation};
    import.frames_per_second = 30;
    import.nodes = 20;
    rig_ = import_rig(scene_, import);
  }

  /// The direction of the file's own bone in a frame of the imported motion.
  Vector3d true_direction(std::size_t frame, const std::string& from, const std::string& to) const {
    return position(frame, to) - position(frame, from);
  }
  bool has(const std::string& name) const { return rig_.landmark_joint[landmark(name)] >= 0; }
  /// Whether the one joint carries the other; the feet of some rigs hang on the root.
  bool is_chain(const std::string& from, const std::string& to) const {
    const int above = rig_.landmark_joint[landmark(from)];
    int joint = rig_.landmark_joint[landmark(to)];
    while (joint >= 0 && joint != above) joint = rig_.joints[joint].parent;
    return joint >= 0;
  }
  std::string bone(const std::string& name) const { return rig_.joints[rig_.landmark_joint[landmark(name)]].bone; }
  Vector3d position(std::size_t frame, const std::string& name) const {
    return support::position_of(rig_.character, rig_.motions[0].motion.frames[frame], bone(name));
  }

  /// The angles between limbs of the character and those of the file over some frames, degrees.
  /// @param bone_of_landmark bones of the character
  Angles angles(const Character& character, const Motion& motion,
                const std::function<std::string(const std::string&)>& bone_of_landmark) const {
    Angles result;
    int count = 0;
    const std::size_t frames = std::min(motion.frames.size(), rig_.motions[0].motion.frames.size());
    for (std::size_t f = 0; f < frames; f += 3)
      for (const std::string side : {"left_", "right_"})
        for (const auto& [from, to] : kLimbs) {
          if (!has(side + from) || !has(side + to) || !is_chain(side + from, side + to)) continue;
          const Vector3d ours = support::position_of(character, motion.frames[f], bone_of_landmark(side + to)) -
                                support::position_of(character, motion.frames[f], bone_of_landmark(side + from));
          const double angle = support::degrees_between(ours, true_direction(f, side + from, side + to));
          result.largest = std::max(result.largest, angle);
          result.mean += angle;
          ++count;
        }
    result.mean /= std::max(1, count);
    return result;
  }

  fs::path file_;
  ImportedRig rig_;
  MotionFileOptions options_;
};

TEST_P(RealMotions, OnTheirOwnCharacterKeepTheDirectionsOfLimbs) {
  const MotionFromFile read = read_motion_file(file_, rig_.character, options_);
  EXPECT_NEAR(read.retargeting->scale, 1.0, 1e-6);
  const double angle = angles(rig_.character, read.motion, [&](const std::string& name) { return bone(name); }).largest;
  RecordProperty("largest_angle_degrees", std::to_string(angle));
  // For these two rigs the solver stops before the goals in some frames.
  const std::string rig = GetParam();
  EXPECT_LT(angle, rig == "m2m_male_apose" ? 6.0 : rig == "robot_expressive" ? 2.0 : 1.0);
}

TEST_P(RealMotions, OnAnotherBodyKeepTheDirectionsOfLimbs) {
  const Character character = support::tall_character();
  const MotionFromFile read = read_motion_file(file_, character, options_);
  const std::map<std::string, std::string> bones{{"shoulder", "Arm"}, {"elbow", "ForeArm"}, {"wrist", "Hand"},
                                                 {"hip", "UpLeg"},    {"knee", "Leg"},      {"ankle", "Foot"}};
  const Angles angle = angles(character, read.motion, [&](const std::string& name) {
    return (name[0] == 'l' ? "Left" : "Right") + bones.at(name.substr(name.find('_') + 1));
  });
  RecordProperty("mean_angle_degrees", std::to_string(angle.mean));
  RecordProperty("largest_angle_degrees", std::to_string(angle.largest));
  // The knees and elbows of this character are hinges, and its joints have the limits of a person. The two stylised
  // figures have no such limits, and their feet hang on the root of the rig.
  const bool stylised = !is_chain("left_knee", "left_ankle");
  EXPECT_LT(angle.mean, stylised ? 12.0 : 4.0);
  EXPECT_LT(angle.largest, stylised ? 25.0 : 10.0);
}

INSTANTIATE_TEST_SUITE_P(Real, RealMotions, support::rig_references(),
                         [](const auto& body) { return std::string(body.param); });

class RealCases : public support::SharedFolderTest {
 protected:
  MotionFromFile read(const std::string& name) const { return read_motion_file(shared_ / "cases" / name, character_); }
  /// The largest distance between joints of the character in two motions, metres.
  double largest_distance(const Motion& a, const Motion& b) const {
    double largest = a.num_frames() == b.num_frames() ? 0.0 : HUGE_VAL;
    for (int f = 0; f < std::min(a.num_frames(), b.num_frames()); ++f) {
      const auto here = character_.skeleton.pose(a.frames[f]), there = character_.skeleton.pose(b.frames[f]);
      for (std::size_t j = 0; j < here.size(); ++j)
        largest = std::max(largest, (here[j].translation() - there[j].translation()).norm());
    }
    return largest;
  }
  /// The angle between the trunk and the vertical, degrees.
  double lean(const MotionFromFile& motion) const {
    return support::off_direction(character_, motion.motion.frames[0], "Root", "Head", Vector3d::UnitY());
  }

  Character character_ = support::tall_character();
};

TEST_F(RealCases, SpellingsOfBvhHoldTheSameMotion) {
  const fs::path folder = shared_ / "cases" / "14-bvh-spellings";
  const BvhClip expected = read_bvh(folder / "reference.bvh");
  for (const char* name : {"capital_ZPosition.bvh", "end_site_lower.bvh"}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(read_bvh(folder / name).frames, expected.frames);
  }
}

TEST_F(RealCases, BvhWithBonesAlongTheirAxesIsTheReference) {
  const std::string folder = "04-bvh-bones-along-their-own-axes/";
  const MotionFromFile found = read(folder + "bones_along_x.bvh"),
                       expected = read(folder + "reference_standing_rest.bvh");
  EXPECT_TRUE(found.retargeting->rest_from_motion);
  EXPECT_FALSE(expected.retargeting->rest_from_motion);
  EXPECT_LT(largest_distance(found.motion, expected.motion), 0.03);
}

TEST_F(RealCases, BvhWithZUpIsTheReference) {
  const MotionFromFile found = read("06-bvh-z-up/z_up.bvh"), expected = read("06-bvh-z-up/reference_y_up.bvh");
  EXPECT_LT(largest_distance(found.motion, expected.motion), 1e-3);
  EXPECT_TRUE(found.warnings.empty());
}

TEST_F(RealCases, PeopleWhoLieOrStandOnTheirHandsDoSo) {
  const std::string folder = "08-lying-and-upside-down/";
  const MotionFromFile lying = read(folder + "lying_Y_SCREEN_is_Z.c3d");
  EXPECT_NEAR(lean(lying), 90.0, 15.0);
  EXPECT_EQ(lying.warnings.size(), 1U);
  const MotionFromFile handstand = read(folder + "handstand_Y_SCREEN_is_Z.c3d");
  EXPECT_NEAR(lean(handstand), 180.0, 15.0);
  EXPECT_EQ(handstand.warnings.size(), 1U);
}

TEST_F(RealCases, TheFirstOfTwoPeopleIsAsAlone) {
  const std::string folder = "09-c3d-two-people/";
  const MotionFromFile found = read(folder + "anna_without_right_foot_and_bert.c3d"),
                       expected = read(folder + "anna_without_right_foot.c3d");
  EXPECT_LT(largest_distance(found.motion, expected.motion), 1e-3);
  EXPECT_EQ(found.warnings.size(), 1U);
  EXPECT_TRUE(expected.warnings.empty());
}

TEST_F(RealCases, PosesThatAreNoAxisAnglesAreRefused) {
  const std::string folder = "10-smpl-poses-that-are-no-axis-angles/";
  EXPECT_GT(read(folder + "axis_angle_control.npz").motion.num_frames(), 0);
  EXPECT_THROW(read(folder + "rot6d_132.npz"), FileError);
  EXPECT_THROW(read(folder + "rot6d_144.npz"), FileError);
}

class RealMarkers : public support::SharedFolderTest {};

TEST_F(RealMarkers, OfPose2SimMoveTheCharacterAsTheyMove) {
  const fs::path file = shared_ / "captures/p2s/reference/pose2sim_filtered.trc";
  const Character character = support::tall_character();
  const MotionFromFile read = read_motion_file(file, character);
  const SpacePoints points = read_space_points(file);
  ASSERT_EQ(read.motion.frames.size(), points.frames.size());
  const auto point = [&](std::size_t frame, const std::string& name) {
    const auto& row = std::next(points.frames.begin(), static_cast<long>(frame))->second;
    return *row[std::find(points.names.begin(), points.names.end(), name) - points.names.begin()];
  };
  double sum = 0.0;
  int count = 0;
  for (std::size_t f = 0; f < read.motion.frames.size(); f += 5)
    for (const std::string side : {"L", "R"})
      for (const auto& [a, b, from, to] : {std::tuple{"Hip", "Knee", "UpLeg", "Leg"},
                                           {"Knee", "Ankle", "Leg", "Foot"},
                                           {"Shoulder", "Elbow", "Arm", "ForeArm"},
                                           {"Elbow", "Wrist", "ForeArm", "Hand"}}) {
        const std::string bone = side == "L" ? "Left" : "Right";
        sum += support::off_direction(character, read.motion.frames[f], bone + from, bone + to,
                                      point(f, side + b) - point(f, side + a));
        ++count;
      }
  RecordProperty("mean_angle_degrees", std::to_string(sum / count));
  EXPECT_LT(sum / count, 3.0);
}

}  // namespace
}  // namespace doppel::real_motion_test
