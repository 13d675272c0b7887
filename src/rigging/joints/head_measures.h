#pragma once

#include "doppel/geometry/mesh.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// The head of a mesh in the rest pose. Points of a face are given in head heights (chin to top) from the tip of the
/// nose: x to the body's left, y up, z forwards.
struct HeadMeasures {
  BodyFrame axes;
  Eigen::Vector3d nose = Eigen::Vector3d::Zero();  ///< tip, metres
  Eigen::Vector3d top = Eigen::Vector3d::Zero();   ///< of the surface, hair included
  double height = 0.0;                             ///< metres

  Eigen::Vector3d world(const Eigen::Vector3d& local) const {
    return nose + height * (local.x() * axes.left + local.y() * axes.up + local.z() * axes.forward);
  }
  Eigen::Vector3d local(const Eigen::Vector3d& world) const {
    const Eigen::Vector3d away = (world - nose) / height;
    return {away.dot(axes.left), away.dot(axes.up), away.dot(axes.forward)};
  }
};

/// Finds top and nose on the surface, the nose as the foremost point of the middle of the face. Known points (nose,
/// eyes, ears) are used.
/// @param joints completed
HeadMeasures measure_head(const TriangleMesh& mesh, const BodyJoints& joints);

/// The 68 points of a face in the order of the iBUG scheme (jaw, brows, nose, eyes, lips), in head heights from the tip
/// of the nose. Depths are rough, the surface decides.
std::vector<Eigen::Vector3d> face_points();

/// A point of a face and its position, in head heights from the tip of the nose.
struct NamedFacePoint {
  std::string name;
  Eigen::Vector3d local = Eigen::Vector3d::Zero();
};
/// The points of MediaPipe's face mesh that fits use (detect/face/face_landmarks.h).
std::vector<NamedFacePoint> face_mesh_points();

/// The farthest point of the surface on a ray, at most `farthest` away.
std::optional<Eigen::Vector3d> last_hit(const TriangleMesh& mesh, const Eigen::Vector3d& from,
                                        const Eigen::Vector3d& direction, double farthest);

}  // namespace doppel
