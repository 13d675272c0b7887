#include "doppel/rigging/autorig/joints_from_points.h"

#include <Eigen/Geometry>
#include <string>

#include "doppel/core/error.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

/// From a landmark to the joint, in lengths of the trunk: away from the middle of the body, up (or towards the joint
/// above, along the limb), forwards. Means over six bodies with a rig; the standard deviation of a component is 0.01 to
/// 0.03.
const Vector3d kShoulder(0.0, -0.06, -0.02), kHip(0.014, -0.04, -0.02), kElbow(0.0, 0.0, -0.024),
    kWrist(0.0, 0.01, -0.017), kKnee(0.015, -0.03, 0.0), kAnkle(0.0, -0.06, 0.0);
constexpr double kBallOfFoot = 0.72;  ///< position of the ball between heel and tip of the big toe

class JointFinder {
 public:
  explicit JointFinder(const std::array<std::optional<Vector3d>, kNumBodyLandmarks>& points) : points_(points) {
    for (const char* name : {"left_shoulder", "right_shoulder", "left_hip", "right_hip"}) {
      const auto point = find(name);
      if (!point) fail("finding joints: the landmark {} was not seen in three views", name);
      landmarks_.positions[name] = *point;
    }
    pelvis_ = pelvis_frame(landmarks_);
    chest_ = chest_frame(landmarks_);
    const auto middle = [this](const std::string& part) -> Vector3d {
      return 0.5 * (landmarks_.at("left_" + part) + landmarks_.at("right_" + part));
    };
    trunk_ = (middle("shoulder") - middle("hip")).norm();
  }

  BodyJoints run() {
    for (const std::string side : {"left_", "right_"}) {
      outward_ = side == "left_" ? 1.0 : -1.0;
      add_arm(side);
      add_leg(side);
    }
    for (const char* name : {"nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_heel", "right_heel"})
      if (const auto point = find(name)) joints_.positions[name] = *point;
    return std::move(joints_);
  }

 private:
  std::optional<Vector3d> find(const std::string& name) const {
    for (int k = 0; k < kNumBodyLandmarks; ++k)
      if (name == kBodyLandmarkNames[k]) return points_[k];
    return std::nullopt;
  }

  void put(const std::string& name, const std::optional<Vector3d>& point, const Vector3d& offset, const Vector3d& up,
           const BodyFrame& frame) {
    if (!point) return;
    const Vector3d left = up.cross(frame.forward).normalized(), forward = left.cross(up);
    joints_.positions[name] = *point + trunk_ * (outward_ * offset.x() * left + offset.y() * up + offset.z() * forward);
  }
  /// A joint of a limb; `above` is the landmark before it.
  void put_on_limb(const std::string& name, const std::string& above, const Vector3d& offset, const BodyFrame& frame) {
    const auto point = find(name), start = find(above);
    if (point && start && (*start - *point).norm() > 0.02)
      put(name, point, offset, (*start - *point).normalized(), frame);
  }

  void add_arm(const std::string& side) {
    put(side + "shoulder", find(side + "shoulder"), kShoulder, chest_.up, chest_);
    put_on_limb(side + "elbow", side + "shoulder", kElbow, chest_);
    put_on_limb(side + "wrist", side + "elbow", kWrist, chest_);
    const auto index = find(side + "index"), little = find(side + "pinky");
    if (index && little) joints_.positions[side + "hand"] = 0.5 * (*index + *little);
  }

  void add_leg(const std::string& side) {
    put(side + "hip", find(side + "hip"), kHip, pelvis_.up, pelvis_);
    put_on_limb(side + "knee", side + "hip", kKnee, pelvis_);
    put_on_limb(side + "ankle", side + "knee", kAnkle, pelvis_);
    const auto heel = find(side + "heel"), tip = find(side + "foot_index");
    if (!heel || !tip) return;
    joints_.positions[side + "toe"] = *heel + kBallOfFoot * (*tip - *heel);
    joints_.positions[side + "toe_end"] = *tip;
  }

  const std::array<std::optional<Vector3d>, kNumBodyLandmarks>& points_;
  BodyJoints landmarks_, joints_;
  BodyFrame pelvis_, chest_;
  double trunk_ = 0.0, outward_ = 1.0;
};

}  // namespace

BodyJoints joints_from_points(const std::array<std::optional<Vector3d>, kNumBodyLandmarks>& points) {
  return JointFinder(points).run();
}

}  // namespace doppel
