#include "doppel/character/source_rest.h"

#include <cmath>
#include <complex>

#include "doppel/geometry/best_rotation.h"

namespace doppel {
namespace {

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kNoPose = M_PI / 3;        ///< radians; the mean angle of the limbs from which a rest is no pose
constexpr double kAgrees = M_PI / 9;        ///< radians; a mean twist below this may be the motion's own
constexpr double kSeveralDirections = 0.2;  ///< sine of the angle from which two bones settle a rotation
constexpr int kFewLimbs = 3;

/// The bones that begin at each pair, named by the pairs they lead to.
std::vector<std::vector<std::size_t>> bones_below(const std::vector<MappedJoint>& joints) {
  std::vector<std::vector<std::size_t>> bones(joints.size());
  for (std::size_t n = 0; n < joints.size(); ++n)
    if (joints[n].parent >= 0) bones[joints[n].parent].push_back(n);
  return bones;
}

/// Directions of bones of the source and of the character, side by side.
struct Bones {
  Eigen::Matrix3Xd source{3, 0};
  Eigen::Matrix3Xd target{3, 0};

  /// @param ours of the character, whose length is the weight
  void add(const Vector3d& theirs, const Vector3d& ours) {
    if (theirs.norm() < kNoBoneLength || ours.norm() < kNoBoneLength) return;
    source.conservativeResize(3, source.cols() + 1);
    target.conservativeResize(3, target.cols() + 1);
    source.rightCols(1) = theirs.normalized() * ours.norm();
    target.rightCols(1) = ours;
  }
  /// Whether they determine a rotation.
  bool settle() const {
    for (Eigen::Index i = 1; i < target.cols(); ++i) {
      const Vector3d ours = target.col(0).cross(target.col(i)), theirs = source.col(0).cross(source.col(i));
      if (std::min(ours.norm(), theirs.norm()) > kSeveralDirections * target.col(0).norm() * target.col(i).norm())
        return true;
    }
    return false;
  }
};

Vector3d way_between(const std::vector<Affine3d>& pose, int from, int to) {
  return pose[to].translation() - pose[from].translation();
}

/// Builds the rest pose from the root outwards.
class FoundRest {
 public:
  FoundRest(const std::vector<MappedJoint>& joints, const std::vector<Affine3d>& target_rest, const JointTracks& source)
      : joints_(joints), target_(target_rest), source_(source), below_(bones_below(joints)), rest_(source.rest) {
    for (std::size_t n = 0; n < joints_.size(); ++n) {
      translate(n);
      turn(n);
    }
  }

  const std::vector<Affine3d>& rest() const { return rest_; }

 private:
  /// The mean bone to a pair over the motion, in the axes of the joint it begins at.
  Vector3d bone(std::size_t n) const {
    const int from = joints_[joints_[n].parent].source, to = joints_[n].source;
    Vector3d sum = Vector3d::Zero();
    for (const std::vector<Affine3d>& frame : source_.frames)
      sum += frame[from].linear().transpose() * way_between(frame, from, to);
    return sum / static_cast<double>(source_.num_frames());
  }
  Vector3d target_bone(std::size_t n) const {
    return way_between(target_, joints_[joints_[n].parent].target, joints_[n].target);
  }
  Affine3d& rest_of(const MappedJoint& joint) { return rest_[joint.source]; }

  void translate(std::size_t n) {
    if (joints_[n].parent < 0) return;
    const Affine3d& above = rest_of(joints_[joints_[n].parent]);
    rest_of(joints_[n]).translation() = above.translation() + above.linear() * bone(n);
  }

  void turn(std::size_t n) {
    const MappedJoint& joint = joints_[n];
    Matrix3d rotation = source_.rest[joint.source].linear();
    if (joint.parent >= 0) {
      const int above = joints_[joint.parent].source;
      rotation = rest_[above].linear() * source_.rest[above].linear().transpose() * rotation;
    }
    Bones bones;
    for (const std::size_t child : below_[n]) bones.add(bone(child), target_bone(child));
    Vector3d axis = Vector3d::Zero();
    if (bones.settle()) {
      rotation = best_rotation(bones.source, bones.target);
    } else if (bones.target.cols() > 0) {
      rotation = rotation_between(rotation * bones.source.col(0), bones.target.col(0)).toRotationMatrix() * rotation;
      axis = bones.target.col(0).normalized();
    }
    rest_of(joint).linear() = rotation;
    if (joint.parent >= 0 && !bones.settle()) rest_of(joint).linear() = mean_turn(joint, axis) * rotation;
  }

  /// The mean rotation of a joint in the joint above since the rest pose so far, where it is more than the motion's
  /// own.
  /// @param axis of the only bone, whose twist alone is open; 0 for an end
  Matrix3d mean_turn(const MappedJoint& joint, const Vector3d& axis) const {
    const int here = joint.source, above = joints_[joint.parent].source;
    Matrix3d sum = Matrix3d::Zero();
    std::complex<double> twist = 0.0;  // squares of the half angles' unit numbers: a full angle, weighted
    for (const std::vector<Affine3d>& frame : source_.frames) {
      const Matrix3d turn_above = frame[above].linear() * rest_[above].linear().transpose();
      const Matrix3d turn = turn_above.transpose() * frame[here].linear() * rest_[here].linear().transpose();
      sum += turn;
      const Eigen::Quaterniond half(turn);
      twist += std::pow(std::complex<double>(half.w(), half.vec().dot(axis)), 2);
    }
    if (!axis.isZero()) {
      const double angle = std::arg(twist);
      return std::abs(angle) < kAgrees ? Matrix3d::Identity() : Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    }
    const Eigen::AngleAxisd mean(nearest_rotation(sum));
    return std::abs(mean.angle()) < kAgrees ? Matrix3d::Identity() : mean.toRotationMatrix();
  }

  const std::vector<MappedJoint>& joints_;
  const std::vector<Affine3d>& target_;
  const JointTracks& source_;
  std::vector<std::vector<std::size_t>> below_;
  std::vector<Affine3d> rest_;
};

/// The rotation that takes the character's bones at the uppermost branching of the body to the source's.
Matrix3d alignment_at_root(const std::vector<MappedJoint>& joints, const std::vector<std::vector<std::size_t>>& below,
                           const std::vector<Affine3d>& target_rest, const std::vector<Affine3d>& source_rest) {
  for (std::size_t n = 0; n < joints.size(); ++n) {
    Bones bones;
    for (const std::size_t child : below[n])
      bones.add(way_between(source_rest, joints[n].source, joints[child].source),
                way_between(target_rest, joints[n].target, joints[child].target));
    if (bones.settle()) return best_rotation(bones.target, bones.source);
  }
  return Matrix3d::Identity();
}

}  // namespace

bool is_pose_of_body(const std::vector<MappedJoint>& joints, const std::vector<Affine3d>& target_rest,
                     const std::vector<Affine3d>& source_rest) {
  for (const MappedJoint& joint : joints)
    if (!joint.rest_turn.isIdentity(1e-12)) return true;
  const auto below = bones_below(joints);
  const Matrix3d aligned = alignment_at_root(joints, below, target_rest, source_rest);
  double sum = 0.0;
  int limbs = 0;
  for (const MappedJoint& end : joints) {
    if (!end.end) continue;
    const MappedJoint* start = &end;  // the joint at which the limb leaves the trunk
    while (start->parent >= 0 && below[start->parent].size() == 1) start = &joints[start->parent];
    const Vector3d ours = aligned * way_between(target_rest, start->target, end.target),
                   theirs = way_between(source_rest, start->source, end.source);
    if (ours.norm() < kNoBoneLength || theirs.norm() < kNoBoneLength) continue;
    sum += std::atan2(ours.cross(theirs).norm(), ours.dot(theirs));
    ++limbs;
  }
  return limbs < kFewLimbs || sum < kNoPose * limbs;
}

std::vector<Affine3d> rest_from_motion(const std::vector<MappedJoint>& joints, const std::vector<Affine3d>& target_rest,
                                       const JointTracks& source) {
  return FoundRest(joints, target_rest, source).rest();
}

}  // namespace doppel
