#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/joint_tracks.h"

namespace doppel {

/// One column of a BVH motion: a coordinate of the joint's position relative to its parent, or a rotation about one of
/// its axes.
enum class BvhChannel { x_position, y_position, z_position, x_rotation, y_rotation, z_rotation };
inline bool is_position(BvhChannel channel) { return channel <= BvhChannel::z_position; }

struct BvhJoint {
  std::string name;  ///< an End Site, which has no name in the file, is called `<parent>_end`
  int parent = -1;   ///< index of an earlier joint, -1 for the root
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< from the parent in the rest pose, metres
  std::vector<BvhChannel> channels;  ///< in file order, rotations outermost first; empty for an End Site
};

/// A BVH file in memory: a skeleton with its rest pose, and its motion.
struct BvhClip {
  std::vector<BvhJoint> joints;             ///< parents first
  std::vector<std::vector<double>> frames;  ///< [F][channels of all joints in order], metres and radians
  double seconds_per_frame = 0.04;
  double metres_per_unit = 1.0;  ///< of the file that was read

  int num_channels() const;
  /// World-from-joint transforms [joints] of one row. If the channels of a joint include all three positions, they
  /// replace the offset, which then describes the rest pose only (as Blender reads it).
  std::vector<Eigen::Affine3d> pose(const std::vector<double>& row) const;
};

/// Reads a BVH file, with any order of channels, End Sites, CRLF, tabs, names with blanks, and the words of the format
/// in upper or lower case (`ZPosition`, `End site`). Channels of scale are read where all their values are 1.
/// @param metres_per_unit the file's unit of length; if missing, the unit (metres, centimetres or millimetres) is
///   guessed from the size of the skeleton (0.5 to 3 m across) and logged
/// @throws FileError with the line: truncated, NaN, impossible counts, repeated names or channels, a row of another
///   length, a size that no unit explains, ...
BvhClip read_bvh(const std::filesystem::path& path, std::optional<double> metres_per_unit = std::nullopt);

/// Centimetres, which other programs expect.
inline constexpr double kBvhMetresPerUnit = 0.01;
/// Writes a BVH file.
/// @throws Error for numbers that are not finite, or a skeleton that BVH cannot hold (a parent after its child, two
///   roots)
void write_bvh(const std::filesystem::path& path, const BvhClip& clip, double metres_per_unit = kBvhMetresPerUnit);

/// A Skeletool motion as BVH, for other programs. A run of single axes with one bone name (`Head_ry`, `Head_rz`,
/// `Head_rx`) becomes one joint of that name with the channels Z, X, Y. The root and prismatic joints also have
/// position channels.
/// @param rest_dofs the pose that becomes the file's rest pose, [D]; empty: all DoFs 0
BvhClip bvh_from_motion(const Skeleton& skeleton, const Motion& motion, double frames_per_second,
                        const std::vector<double>& rest_dofs = {});

/// The same clip with z up: x stays, and y is what was -z. Rotations about y become rotations about z, and those about
/// z rotations about y by the negative angle. @param clip with y up
BvhClip with_z_up(BvhClip clip);

/// The joints of a clip in its rest pose (all rotations 0) and in every frame.
JointTracks joint_tracks(const BvhClip& clip);

}  // namespace doppel
