#pragma once

#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// One axis of motion. An anatomical joint is a run of these (`Head_ry`, `Head_rz`, `Head_rx`).
/// Forward kinematics: A_j = A_parent * Trans(offset) * X_j with X_j = Rot(axis, q_j) or Trans(axis * q_j), and
/// q_j = sum over DoFs of weight * dof.
struct Joint {
  enum class Type { revolute, prismatic };
  std::string name;
  Type type = Type::revolute;
  int parent = -1;         ///< index of another joint (always smaller than this one's), -1 for the root
  Eigen::Vector3d offset;  ///< to the parent, metres (the file's scale is multiplied in)
  Eigen::Vector3d axis;    ///< unit for revolute joints; metres per unit of q for prismatic ones
};

/// One number of a motion file. A DoF drives `joints` (possibly none), each with a weight.
struct Dof {
  struct Drive {
    int joint;
    double weight;  ///< radians (revolute) or units of the joint's axis (prismatic) per unit of the DoF
  };
  std::string name;
  std::vector<Drive> joints;
  std::optional<std::array<double, 2>> limits;  ///< on the DoF's own value, before the weight
};

/// A point fixed to a joint (landmark).
struct Marker {
  std::string name;
  int joint = 0;
  Eigen::Vector3d position;  ///< metres; in the joint's frame for every reading of the file
  double size = 0.0;
};

/// The meaning of marker coordinates in a `.skeleton` file: relative to the joint, or world positions in the zero pose.
enum class MarkerReading { joint_relative, zero_pose_world };

/// The rule that finds the joint of a bone of a `.skin` file: the last joint whose name up to the first `_` equals the
/// bone's name (`exact`), or the last joint whose name starts with it (`prefix`).
enum class BoneRule { exact, prefix };

/// J joints, parents before children, D DoFs and M markers. Metres and radians.
struct Skeleton {
  std::vector<Joint> joints;
  std::vector<Dof> dofs;
  std::vector<Marker> markers;
  MarkerReading marker_reading = MarkerReading::joint_relative;
  /// [J] the joints in the order of the file, or empty when the file already lists parents first. Bones are looked up
  /// in this order.
  std::vector<int> file_order;

  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_dofs() const { return static_cast<int>(dofs.size()); }
  std::optional<int> find_joint(const std::string& name) const;
  std::optional<int> find_dof(const std::string& name) const;
  /// The last joint, in the file's order, that carries the bone.
  /// @throws Error naming the bone when no joint carries it
  int joint_of_bone(const std::string& bone, BoneRule rule) const;

  /// Forward kinematics of one pose in double precision. layers/kinematics has the differentiable version.
  /// @param dofs [D] @return joint-to-world transforms [J], metres
  std::vector<Eigen::Affine3d> pose(const std::vector<double>& dofs) const;

  /// The DoFs of the root's three translations and three rotations. The motion window computes the heading from them.
  /// @throws Error when the root is not three translations followed by three rotations
  struct Root {
    std::array<int, 3> translation;  ///< DoFs along x, y, z
    std::array<int, 3> rotation;     ///< DoFs in the order they are applied, outermost first
    std::array<int, 3> axes;         ///< axis (0 x, 1 y, 2 z) of each rotation
    std::array<double, 3> translation_weight, rotation_weight;
  };
  Root root() const;
};

/// The bone that a joint belongs to: its name up to the first underscore.
inline std::string bone_name(const std::string& joint) { return joint.substr(0, joint.find('_')); }

/// A marker's position as a `.skeleton` file states it under `reading`, with all DoFs 0.
Eigen::Vector3d marker_to_file(const Skeleton& skeleton, const Marker& marker, MarkerReading reading);
/// Reinterprets the positions of all markers, which were read under `skeleton.marker_reading`, under `reading`.
void reread_markers(Skeleton& skeleton, MarkerReading reading);

/// Reads "Skeletool Skeleton Definition V1.0" (millimetres in the file). Joints are reordered if a parent follows its
/// child. Prismatic axes keep the file's scale: q moves the joint by axis * q millimetres, converted to metres.
/// @param reading the meaning of marker coordinates; load_character changes it if the template says so
/// @throws FileError: version, counts, unknown parents, cycles, `oriented` markers, ...
Skeleton read_skeleton(const std::filesystem::path& path, MarkerReading reading = MarkerReading::joint_relative);
void write_skeleton(const std::filesystem::path& path, const Skeleton& skeleton);

}  // namespace doppel
