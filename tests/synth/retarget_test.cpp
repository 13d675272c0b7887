// The synthetic actor driven by BVH files of other bodies.
#include "doppel/character/retarget.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <chrono>
#include <cmath>
#include <map>

#include "doppel/character/bvh.h"
#include "doppel/core/atomic_file.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/performance.h"
#include "support/temporary_folder.h"

namespace doppel::retarget_test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using support::TemporaryFolder;

bool begins(const std::string& text, const std::string& with) { return text.compare(0, with.size(), with) == 0; }

/// Long arms, short legs, a small head, and names that no one could guess.
Skeleton other_body() {
  Skeleton skeleton = synth::make_skeleton();
  for (Joint& joint : skeleton.joints) {
    const bool arm = joint.name.find("Arm") != std::string::npos,
               leg = joint.name.find("Leg") != std::string::npos || joint.name.find("Foot") != std::string::npos;
    joint.offset *= arm ? 1.25 : leg ? 0.8 : begins(joint.name, "Head") ? 0.9 : 1.0;
    joint.name = "x" + joint.name;
  }
  return skeleton;
}

/// The arms lowered, the elbows bent, the knees too: a rest pose unlike the actor's.
std::vector<double> other_rest(const Skeleton& skeleton) {
  std::vector<double> dofs(skeleton.dofs.size(), 0.0);
  for (const auto& [name, angle] : {std::pair{"LeftArm_rz", -0.6},
                                    {"RightArm_rz", 0.8},
                                    {"LeftForeArm_rx", 0.4},
                                    {"RightForeArm_rx", 0.9},
                                    {"LeftLeg_rx", 0.3}})
    dofs[*skeleton.find_dof(name)] = angle;
  return dofs;
}

const char* const kMap =
    "joints:\n"
    "  Root: xRoot\n"
    "  Head: xHead\n"
    "  HeadEE: xHead_end\n"
    "  LeftArm: xLeftArm\n"
    "  LeftForeArm: xLeftForeArm\n"
    "  LeftForeArmEE: xLeftForeArm_end\n"
    "  LeftUpLeg: xLeftUpLeg\n"
    "  LeftLeg: xLeftLeg\n"
    "  LeftFoot: xLeftFoot\n"
    "  LeftFootEE: xLeftFoot_end\n"
    "  RightArm: xRightArm\n"
    "  RightForeArm: xRightForeArm\n"
    "  RightForeArmEE: xRightForeArm_end\n"
    "  RightUpLeg: xRightUpLeg\n"
    "  RightLeg: xRightLeg\n"
    "  RightFoot: xRightFoot\n"
    "  RightFootEE: xRightFoot_end\n";

/// The scaled source (docs/animate.md), found here once more from the files: the position of every mapped joint.
class ScaledSource {
 public:
  ScaledSource(const Skeleton& target, const JointTracks& source, const JointMap& map)
      : target_(target), source_(source), rest_(target.pose(std::vector<double>(target.dofs.size(), 0.0))) {
    for (const JointMap::Pair& pair : map.pairs) {
      int t = -1;
      for (int j = 0; j < target.num_joints(); ++j)
        if (begins(target.joints[j].name, pair.target + "_") || target.joints[j].name == pair.target) t = j;
      const auto s = std::find(source.names.begin(), source.names.end(), pair.source) - source.names.begin();
      source_of_[t] = static_cast<int>(s);
    }
    scale_ = leg(rest_, [](int t) { return t; }) / leg(source.rest, [this](int t) { return source_of_.at(t); });
    double ours = 0.0, theirs = 0.0;
    for (const auto& [t, s] : source_of_) {
      ours = std::max(ours, rest_[root()].translation().y() - rest_[t].translation().y());
      theirs =
          std::max(theirs, source.rest[source_of_.at(root())].translation().y() - source.rest[s].translation().y());
    }
    lift_ = ours - scale_ * theirs;
  }

  Vector3d position(int joint, int frame) const {
    const auto& pose = source_.frames[frame];
    const int s = source_of_.at(joint);
    if (joint == root()) return scale_ * pose[s].translation() + turn(joint, frame) * Vector3d(0, lift_, 0);
    const int above = above_of(joint), s_above = source_of_.at(above);
    const Vector3d bone = rest_[joint].translation() - rest_[above].translation();
    const Vector3d now = pose[s].translation() - pose[s_above].translation();
    // One bone from a joint: its direction is the source's. Several: the angle between them stays our own.
    if (bones_from(above) == 1) return position(above, frame) + bone.norm() * now.normalized();
    const Vector3d rest = source_.rest[s].translation() - source_.rest[s_above].translation();
    return position(above, frame) + Eigen::Quaterniond::FromTwoVectors(turn(above, frame) * rest, now) *
                                        (turn(above, frame) * whole_body(above) * bone);
  }
  int root() const { return source_of_.begin()->first; }
  double scale() const { return scale_; }

 private:
  int above_of(int joint) const {
    int above = target_.joints[joint].parent;
    while (source_of_.count(above) == 0) above = target_.joints[above].parent;
    return above;
  }
  int bones_from(int joint) const {
    int count = 0;
    for (const auto& entry : source_of_) count += entry.first != root() && above_of(entry.first) == joint;
    return count;
  }
  /// How the source's joint has turned since its rest pose.
  Matrix3d turn(int joint, int frame) const {
    const int s = source_of_.at(joint);
    return source_.frames[frame][s].linear() * source_.rest[s].linear().transpose();
  }
  /// The rotation between the two rest poses, by the bones from one joint.
  Matrix3d whole_body(int joint) const {
    Eigen::Matrix3Xd ours(3, 2 * bones_from(joint)), theirs(3, 2 * bones_from(joint));
    int column = 0;
    for (const auto& [t, s] : source_of_) {
      if (t == root() || above_of(t) != joint) continue;
      const Vector3d bone = rest_[t].translation() - rest_[joint].translation();
      const Vector3d other = source_.rest[s].translation() - source_.rest[source_of_.at(joint)].translation();
      for (const double sign : {1.0, -1.0}) {  // so that their mean is 0, which umeyama takes away
        ours.col(column) = sign * bone;
        theirs.col(column++) = sign * bone.norm() * other.normalized();
      }
    }
    return Eigen::umeyama(ours, theirs, false).topLeftCorner<3, 3>();
  }
  /// The length of the left leg in the rest pose, hip to toes.
  template <typename Index>
  double leg(const std::vector<Eigen::Affine3d>& rest, const Index& index) const {
    double length = 0.0;
    for (int t = *target_.find_joint("LeftFootEE"); above_of(t) != root(); t = above_of(t))
      length += (rest[index(t)].translation() - rest[index(above_of(t))].translation()).norm();
    return length;
  }

  const Skeleton& target_;
  const JointTracks& source_;
  std::vector<Eigen::Affine3d> rest_;
  std::map<int, int> source_of_;
  double scale_ = 1.0, lift_ = 0.0;
};

const std::vector<std::string> kEnds{"HeadEE", "LeftForeArmEE", "RightForeArmEE", "LeftFootEE", "RightFootEE"};

/// The farthest that feet, head and hands are from the scaled source, in any frame.
double farthest_end(const Skeleton& skeleton, const Motion& motion, const ScaledSource& source, int frames_per_row) {
  double farthest = 0.0;
  for (int f = 0; f < motion.num_frames(); ++f) {
    const auto pose = skeleton.pose(motion.frames[f]);
    for (const std::string& end : kEnds) {
      const int j = *skeleton.find_joint(end);
      farthest = std::max(farthest, (pose[j].translation() - source.position(j, f * frames_per_row)).norm());
    }
  }
  return farthest;
}

void expect_within_limits(const Skeleton& skeleton, const Motion& motion) {
  for (const auto& row : motion.frames)
    for (std::size_t d = 0; d < row.size(); ++d)
      if (const auto& limits = skeleton.dofs[d].limits) {
        ASSERT_GE(row[d], (*limits)[0]) << skeleton.dofs[d].name;
        ASSERT_LE(row[d], (*limits)[1]) << skeleton.dofs[d].name;
      }
}

TEST(RetargetRecovers, ABvhOfAnotherBodyWithinFiveCentimetres) {
  const TemporaryFolder folder;
  const Skeleton other = other_body(), skeleton = synth::make_skeleton();
  for (const std::uint64_t seed : {3, 8}) {
    const Motion performed = synth::make_motion(skeleton, 200, 50.0, seed);
    write_bvh(folder / "other.bvh", bvh_from_motion(other, performed, 50.0, other_rest(skeleton)));
    write_atomically(folder / "map.yaml", kMap);
    const JointTracks source = joint_tracks(read_bvh(folder / "other.bvh"));
    const JointMap map = read_joint_map(folder / "map.yaml");
    const auto start = std::chrono::steady_clock::now();
    const RetargetResult result = retarget(skeleton, source, map);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_EQ(result.motion.num_frames(), 100);
    const ScaledSource scaled(skeleton, source, map);
    EXPECT_NEAR(result.scale, scaled.scale(), 1e-9);
    EXPECT_GT(result.scale, 1.1);
    const double farthest = farthest_end(skeleton, result.motion, scaled, 2);
    EXPECT_LT(farthest, 0.05);
    RecordProperty("farthest_end_mm_seed_" + std::to_string(seed), std::to_string(1e3 * farthest));
    RecordProperty("ms_per_frame_seed_" + std::to_string(seed),
                   std::to_string(1e3 * seconds / result.motion.num_frames()));
    expect_within_limits(skeleton, result.motion);
    // The same body stands behind it, so the motion itself comes back, not only the ends of it.
    const auto performed_pose = skeleton.pose(performed.frames[150]),
               found_pose = skeleton.pose(result.motion.frames[75]);
    const int head = *skeleton.find_joint("Head_rx");
    EXPECT_LT((performed_pose[head].linear() - found_pose[head].linear()).norm(), 0.4);
  }
}

/// A figure with a spine of three joints, arms out to the sides, and names as Mixamo gives them; it walks in a circle,
/// bends and looks about.
BvhClip walking_figure(int frames) {
  struct Part {
    const char *name, *parent;
    Vector3d position;
  };
  const std::vector<Part> middle{{"Hips", "", {0, 0.95, 0}},        {"Spine", "Hips", {0, 1.05, 0}},
                                 {"Spine1", "Spine", {0, 1.2, 0}},  {"Neck", "Spine1", {0, 1.45, 0}},
                                 {"Head", "Neck", {0, 1.53, 0.01}}, {"HeadTop_End", "Head", {0, 1.72, 0.01}}};
  const std::vector<Part> side{{"Shoulder", "Spine1", {0.05, 1.4, 0}}, {"Arm", "Shoulder", {0.18, 1.42, 0}},
                               {"ForeArm", "Arm", {0.45, 1.42, 0}},    {"Hand", "ForeArm", {0.7, 1.42, 0}},
                               {"UpLeg", "Hips", {0.1, 0.92, 0}},      {"Leg", "UpLeg", {0.1, 0.5, 0}},
                               {"Foot", "Leg", {0.1, 0.09, -0.02}},    {"ToeBase", "Foot", {0.1, 0.02, 0.13}}};
  BvhClip clip;
  clip.seconds_per_frame = 1.0 / 30.0;
  std::map<std::string, int> index;
  std::vector<Vector3d> positions;
  const auto add = [&](const std::string& name, const std::string& parent, const Vector3d& position) {
    const int above = parent.empty() ? -1 : index.at(parent);
    BvhJoint joint{"mixamorig:" + name, above, above < 0 ? position : Vector3d(position - positions[above]), {}};
    if (above < 0) joint.channels = {BvhChannel::x_position, BvhChannel::y_position, BvhChannel::z_position};
    for (const auto c : {BvhChannel::z_rotation, BvhChannel::x_rotation, BvhChannel::y_rotation})
      joint.channels.push_back(c);
    index[name] = static_cast<int>(positions.size());
    positions.push_back(position);
    clip.joints.push_back(joint);
  };
  for (const Part& part : middle) add(part.name, part.parent, part.position);
  for (const std::string which : {"Left", "Right"})
    for (const Part& part : side) {
      const std::string parent = part.parent;
      const bool shared = parent == "Hips" || parent == "Spine1";
      const double x = which == "Left" ? part.position.x() : -part.position.x();
      add(which + part.name, shared ? parent : which + parent, {x, part.position.y(), part.position.z()});
    }
  for (int f = 0; f < frames; ++f) {
    const double t = 0.15 * f, swing = std::sin(t);
    std::vector<double> row{0.5 * std::sin(0.2 * t), 0.95 + 0.02 * std::cos(2 * t), 0.5 * std::cos(0.2 * t)};
    const std::map<std::string, Vector3d> angles{// about z, x, y
                                                 {"Hips", {0, 0, 0.2 * t}},
                                                 {"Spine", {0, 0.1 + 0.05 * swing, 0.1 * swing}},
                                                 {"Head", {0, 0.1, 0.5 * std::sin(0.3 * t)}},
                                                 {"LeftArm", {-1.1, 0, -0.3 * swing}},
                                                 {"RightArm", {1.1, 0, -0.3 * swing}},
                                                 {"LeftForeArm", {0, 0, -0.5 - 0.2 * swing}},
                                                 {"RightForeArm", {0, 0, 0.5 - 0.2 * swing}},
                                                 {"LeftUpLeg", {0, -0.35 * swing, 0}},
                                                 {"RightUpLeg", {0, 0.35 * swing, 0}},
                                                 {"LeftLeg", {0, 0.3 + 0.3 * std::cos(t), 0}},
                                                 {"RightLeg", {0, 0.3 - 0.3 * std::cos(t), 0}}};
    for (const BvhJoint& joint : clip.joints) {
      const auto found = angles.find(joint.name.substr(10));
      const Vector3d turn = found == angles.end() ? Vector3d::Zero() : found->second;
      row.insert(row.end(), turn.data(), turn.data() + 3);
    }
    clip.frames.push_back(row);
  }
  return clip;
}

TEST(RetargetRecovers, AWalkingFigureWhoseNamesAreGuessed) {
  const TemporaryFolder folder;
  write_bvh(folder / "walk.bvh", walking_figure(120));
  const JointTracks source = joint_tracks(read_bvh(folder / "walk.bvh"));
  const Skeleton skeleton = synth::make_skeleton();
  std::vector<std::string> joints;
  for (const Joint& joint : skeleton.joints) joints.push_back(joint.name);
  const JointMap map = guess_joint_map(joints, source.names);
  EXPECT_EQ(map.pairs.size(), 19u);
  RetargetOptions options;
  options.frames_per_second = 15.0;
  const RetargetResult result = retarget(skeleton, source, map, options);
  ASSERT_EQ(result.motion.num_frames(), 60);
  EXPECT_LT(farthest_end(skeleton, result.motion, ScaledSource(skeleton, source, map), 2), 0.05);
  expect_within_limits(skeleton, result.motion);
  // No bone's direction says where the head looks.
  const auto head = std::find(source.names.begin(), source.names.end(), "mixamorig:Head") - source.names.begin();
  const int ours = *skeleton.find_joint("Head_rx");
  for (int f = 0; f < 60; ++f) {
    const Vector3d theirs = source.frames[2 * f][head].linear().col(2);
    const Vector3d looks = skeleton.pose(result.motion.frames[f])[ours].linear().col(2);
    EXPECT_GT(theirs.dot(looks), 0.96) << "frame " << f;
  }
  // No frame is lost on the way: nothing turns by more than 0.5 rad from one to the next, where the source never does.
  for (int f = 1; f < 60; ++f)
    for (int d = 3; d < skeleton.num_dofs(); ++d)
      EXPECT_LT(std::abs(result.motion.frames[f][d] - result.motion.frames[f - 1][d]), 0.5)
          << skeleton.dofs[d].name << " frame " << f;
}

}  // namespace
}  // namespace doppel::retarget_test
