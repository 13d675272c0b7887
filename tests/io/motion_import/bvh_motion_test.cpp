// One walk in BVH files of other conventions: bones along the axes of their joints in place of a rest pose, other
// verticals, other units. All must move the character as the file whose rest pose is a T-pose with y up.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "doppel/character/bvh.h"
#include "doppel/core/error.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "test_figure.h"

namespace doppel::bvh_motion_test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using support::position_of;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kFrames = 16;

struct Part {
  std::string name;
  int parent;
  Vector3d position;  ///< T-pose, metres, y up
};

/// The joints of LAFAN1, with the spine or a leg as the first child of the hips.
std::vector<Part> parts(bool leg_first) {
  std::vector<Part> all{{"Hips", -1, {0, 0.94, 0}}};
  const auto add = [&](const std::string& name, const std::string& parent, const Vector3d& at) {
    int above = 0;
    while (all[above].name != parent) ++above;
    all.push_back({name, above, at});
  };
  const auto add_legs = [&] {
    for (const std::string side : {"Left", "Right"}) {
      const double x = side == "Left" ? 1 : -1;
      add(side + "UpLeg", "Hips", {0.09 * x, 0.90, 0});
      add(side + "Leg", side + "UpLeg", {0.09 * x, 0.48, 0.01});
      add(side + "Foot", side + "Leg", {0.09 * x, 0.07, 0});
      add(side + "Toe", side + "Foot", {0.09 * x, 0.02, 0.12});
    }
  };
  if (leg_first) add_legs();
  add("Spine", "Hips", {0, 1.04, 0});
  add("Spine1", "Spine", {0, 1.16, -0.01});
  add("Spine2", "Spine1", {0, 1.28, -0.01});
  add("Neck", "Spine2", {0, 1.46, -0.01});
  add("Head", "Neck", {0, 1.56, 0.01});
  add("Head_end", "Head", {0, 1.74, 0.01});
  for (const std::string side : {"Left", "Right"}) {
    const double x = side == "Left" ? 1 : -1;
    add(side + "Shoulder", "Spine2", {0.04 * x, 1.42, 0});
    add(side + "Arm", side + "Shoulder", {0.18 * x, 1.41, -0.01});
    add(side + "ForeArm", side + "Arm", {0.45 * x, 1.41, -0.01});
    add(side + "Hand", side + "ForeArm", {0.69 * x, 1.41, -0.01});
  }
  if (!leg_first) add_legs();
  return all;
}

/// Rotations of the joints relative to the joints above them, since the T-pose: a walk with a bow and a look around.
Matrix3d local_turn(const std::string& name, int frame) {
  const double phase = 2 * M_PI * frame / (kFrames - 1.0), swing = 0.45 * std::sin(phase);
  const auto about = [](double angle, const Vector3d& axis) { return Eigen::AngleAxisd(angle, axis); };
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const double side = name.starts_with("Left") ? 1 : -1;
  if (name == "Hips")
    return (about(0.3 + 0.2 * std::sin(phase), y) * about(0.05 * std::cos(phase), x)).toRotationMatrix();
  if (name == "Spine1") return about(0.1 + 0.08 * std::sin(phase), x).toRotationMatrix();
  if (name == "Head") return (about(0.25 * std::sin(phase), y) * about(0.1 * std::cos(phase), x)).toRotationMatrix();
  if (name.ends_with("UpLeg")) return (about(side * swing, x) * about(0.05 * side, z)).toRotationMatrix();
  if (name.ends_with("Leg")) return about(0.35 - 0.3 * std::cos(phase + (side > 0 ? 0 : M_PI)), x).toRotationMatrix();
  if (name.ends_with("Foot")) return about(0.15 * std::sin(phase), x).toRotationMatrix();
  if (name.ends_with("ForeArm")) return about(-side * (0.7 + 0.3 * std::sin(phase)), y).toRotationMatrix();
  if (name.ends_with("Arm")) return (about(-side * 1.1, z) * about(side * swing, y)).toRotationMatrix();
  return Matrix3d::Identity();
}

struct Convention {
  /// The axis of each joint along which its first child lies; nothing: a T-pose as rest.
  std::optional<Vector3d> bone_axis;
  double twist = 0.0;  ///< about this axis, another multiple of it for each joint
  bool leg_first = false;
  Matrix3d rest = Matrix3d::Identity();   ///< rotation of the rest pose
  Matrix3d world = Matrix3d::Identity();  ///< rotation of the motion
};

/// The rotation of each joint's axes in the T-pose.
std::vector<Matrix3d> axes_of(const std::vector<Part>& all, const Convention& convention) {
  std::vector<Matrix3d> axes(all.size(), convention.rest.transpose());
  if (!convention.bone_axis) return axes;
  for (std::size_t j = 0; j < all.size(); ++j) {
    // An end has the axes of the joint above.
    axes[j] = all[j].parent < 0 ? Matrix3d::Identity() : axes[all[j].parent];
    const auto child =
        std::find_if(all.begin(), all.end(), [&](const Part& p) { return p.parent == static_cast<int>(j); });
    if (child == all.end()) continue;
    axes[j] = (Eigen::Quaterniond::FromTwoVectors(*convention.bone_axis, child->position - all[j].position) *
               Eigen::AngleAxisd(convention.twist * static_cast<double>(j), *convention.bone_axis))
                  .toRotationMatrix();
  }
  return axes;
}

BvhClip clip_of(const Convention& convention) {
  const std::vector<Part> all = parts(convention.leg_first);
  const std::vector<Matrix3d> axes = axes_of(all, convention);
  BvhClip clip;
  clip.seconds_per_frame = 0.04;
  using Channel = BvhChannel;
  for (std::size_t j = 0; j < all.size(); ++j) {
    BvhJoint joint{all[j].name, all[j].parent, Vector3d::Zero(), {}};
    if (joint.parent < 0)
      joint.channels = {Channel::x_position, Channel::y_position, Channel::z_position};
    else
      joint.offset = axes[joint.parent].transpose() * (all[j].position - all[joint.parent].position);
    if (joint.name != "Head_end")
      joint.channels.insert(joint.channels.end(), {Channel::z_rotation, Channel::y_rotation, Channel::x_rotation});
    clip.joints.push_back(joint);
  }
  for (int f = 0; f < kFrames; ++f) {
    std::vector<double> row;
    for (std::size_t j = 0; j < all.size(); ++j) {
      Matrix3d turn = local_turn(all[j].name, f) * axes[j];
      if (all[j].parent < 0) {
        const Vector3d at = convention.world * Vector3d(0.02 * f, 0.94, 0.06 * f);
        row.insert(row.end(), at.data(), at.data() + 3);
        turn = convention.world * turn;
      } else {
        turn = axes[all[j].parent].transpose() * turn;
      }
      if (all[j].name == "Head_end") continue;
      const Vector3d angles = turn.eulerAngles(2, 1, 0);
      row.insert(row.end(), angles.data(), angles.data() + 3);
    }
    clip.frames.push_back(row);
  }
  return clip;
}

class BvhMotion : public ::testing::Test {
 protected:
  MotionFromFile read(const Convention& convention, const MotionFileOptions& options = {}, double unit = 0.01) {
    write_bvh(folder_ / "walk.bvh", clip_of(convention), unit);
    return read_motion_file(folder_ / "walk.bvh", character_, options);
  }

  /// All joints of the character are where those of the T-pose's file put them.
  void expect_same(const MotionFromFile& found, double metres) {
    static const MotionFromFile expected = read({});
    ASSERT_EQ(found.motion.num_frames(), kFrames);
    double sum = 0.0, largest = 0.0;
    int count = 0;
    for (int f = 0; f < kFrames; ++f) {
      const auto a = character_.skeleton.pose(expected.motion.frames[f]),
                 b = character_.skeleton.pose(found.motion.frames[f]);
      for (std::size_t j = 0; j < a.size(); ++j, ++count) {
        const double distance = (a[j].translation() - b[j].translation()).norm();
        sum += distance;
        largest = std::max(largest, distance);
      }
    }
    EXPECT_LT(sum / count, metres);
    EXPECT_LT(largest, 4 * metres);
  }

  Character character_ = support::tall_character();
  support::TemporaryFolder folder_;
};

const Matrix3d kZUp = Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitX()).toRotationMatrix();

TEST_F(BvhMotion, WithATPoseKeepsItsRestPose) {
  const MotionFromFile motion = read({});
  EXPECT_FALSE(motion.retargeting->rest_from_motion);
  EXPECT_THAT(motion.notes, IsEmpty());
  EXPECT_THAT(motion.warnings, IsEmpty());
}

TEST_F(BvhMotion, OfBonesAlongTheirAxesIsThatOfATPose) {
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(-1, 0, 0), Vector3d(0, 0, 1)})
    for (const double twist : {0.0, 0.8})
      for (const bool leg_first : {false, true}) {
        SCOPED_TRACE(fmt::format("{} {} {} twist {}{}", axis.x(), axis.y(), axis.z(), twist, leg_first ? " leg" : ""));
        const MotionFromFile motion = read({axis, twist, leg_first});
        EXPECT_TRUE(motion.retargeting->rest_from_motion);
        EXPECT_THAT(motion.notes, Contains(HasSubstr("rest pose of the skeleton is no pose of a body")));
        EXPECT_THAT(motion.warnings, IsEmpty());
        expect_same(motion, 0.01);
      }
}

TEST_F(BvhMotion, OfBonesAlongTheirAxesMayHaveAnotherUnit) {
  for (const double unit : {1.0, 0.001}) expect_same(read({Vector3d::UnitX()}, {}, unit), 0.01);
}

TEST_F(BvhMotion, OfBonesAlongTheirAxesWithZUpIsTurnedWithAWarning) {
  Convention z_up{Vector3d::UnitX()};
  z_up.world = kZUp;
  const MotionFromFile motion = read(z_up);
  EXPECT_THAT(motion.warnings, Contains(HasSubstr("--up y")));
  expect_same(motion, 0.01);
}

TEST_F(BvhMotion, WithARestPoseAndFramesAlongZIsTurned) {
  Convention z_up;
  z_up.rest = z_up.world = kZUp;
  const MotionFromFile motion = read(z_up);
  EXPECT_THAT(motion.notes, Contains(HasSubstr("the rest pose stands along z, so z is taken as the vertical")));
  EXPECT_THAT(motion.warnings, IsEmpty());
  ASSERT_TRUE(motion.guessed_map);
  EXPECT_EQ(motion.guessed_map->z_up, true);
  expect_same(motion, 1e-4);
}

TEST_F(BvhMotion, WithARestPoseAndFramesAlongXIsTurned) {
  Convention x_up;
  x_up.rest = x_up.world = Eigen::AngleAxisd(-M_PI / 2, Vector3d::UnitZ()).toRotationMatrix();
  MotionFileOptions stated;
  stated.source.up = 'x';
  for (const MotionFileOptions& options : {MotionFileOptions{}, stated}) expect_same(read(x_up, options), 1e-4);
}

TEST_F(BvhMotion, WithARestPoseAlongZAndFramesAlongYStands) {
  Convention turned;
  turned.rest = kZUp;
  const MotionFromFile motion = read(turned);
  EXPECT_THAT(motion.warnings, IsEmpty());
  expect_same(motion, 1e-4);
}

TEST_F(BvhMotion, ThatLiesInAFileWithYUpLiesAndIsNamed) {
  Convention lying;
  lying.world = kZUp;
  const MotionFromFile motion = read(lying);
  EXPECT_THAT(motion.warnings, Contains(::testing::AllOf(HasSubstr("points along z"), HasSubstr("--up z"))));
  const std::vector<double>& first = motion.motion.frames.front();
  const Vector3d trunk = position_of(character_, first, "Head") - position_of(character_, first, "Root");
  EXPECT_LT(support::degrees_between(trunk, Vector3d::UnitZ()), 20.0);
  MotionFileOptions stated;
  stated.source.up = 'z';
  const MotionFromFile standing = read(lying, stated);
  EXPECT_THAT(standing.warnings, IsEmpty());
  expect_same(standing, 1e-4);
}

TEST_F(BvhMotion, HasNoPeopleToChooseFrom) {
  MotionFileOptions options;
  options.source.person = "Anna";
  EXPECT_THAT(support::message_of<UsageError>([&] { read({}, options); }), HasSubstr("--person"));
}

}  // namespace
}  // namespace doppel::bvh_motion_test
