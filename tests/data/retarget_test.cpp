// The synthetic actor driven by BVH files of other bodies.
#include "doppel/character/retarget.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>

#include "doppel/character/bvh.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/synth/actor.h"
#include "doppel/data/synth/performance.h"
#include "support/temporary_folder.h"

namespace doppel {
namespace {

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
    dofs[static_cast<std::size_t>(*skeleton.find_dof(name))] = angle;
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

/// The scaled source (docs/animate.md), found here once more from the files: the place of every mapped joint.
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
    double ours = 0.0, theirs = 0.0;
    for (const auto& [t, s] : source_of_) {
      ours = std::max(ours, rest_[root()].translation().y() - rest_[t].translation().y());
      theirs =
          std::max(theirs, source.rest[source_of_.at(root())].translation().y() - source.rest[s].translation().y());
    }
    scale_ = ours / theirs;
  }

  Vector3d place(int joint, int frame) const {
    const auto& pose = source_.frames[frame];
    if (joint == root()) return scale_ * pose[source_of_.at(joint)].translation();
    int above = target_.joints[joint].parent;
    while (source_of_.count(above) == 0) above = target_.joints[above].parent;
    const double length = (rest_[joint].translation() - rest_[above].translation()).norm();
    return place(above, frame) +
           length * (pose[source_of_.at(joint)].translation() - pose[source_of_.at(above)].translation()).normalized();
  }
  int root() const { return source_of_.begin()->first; }
  double scale() const { return scale_; }

 private:
  const Skeleton& target_;
  const JointTracks& source_;
  std::vector<Eigen::Affine3d> rest_;
  std::map<int, int> source_of_;
  double scale_ = 1.0;
};

const std::vector<std::string> kEnds{"HeadEE", "LeftForeArmEE", "RightForeArmEE", "LeftFootEE", "RightFootEE"};

/// The farthest that feet, head and hands are from the scaled source, in any frame.
double farthest_end(const Skeleton& skeleton, const Motion& motion, const ScaledSource& source, int frames_per_row) {
  double farthest = 0.0;
  for (int f = 0; f < motion.num_frames(); ++f) {
    const auto pose = skeleton.pose(motion.frames[f]);
    for (const std::string& end : kEnds) {
      const int j = *skeleton.find_joint(end);
      farthest = std::max(farthest, (pose[j].translation() - source.place(j, f * frames_per_row)).norm());
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

}  // namespace
}  // namespace doppel
