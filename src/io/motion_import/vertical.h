#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "doppel/character/joint_tracks.h"
#include "doppel/character/retarget.h"

namespace doppel {

/// Says that a body is far from upright, which is right for a person who lies or stands on the hands, and otherwise
/// shows that the vertical is wrong. Nothing where the body is within 60 degrees of the vertical, or changes its
/// direction too much to tell.
/// @param upward mean over the frames of the directions, of length 1, from the feet to the head
/// @param reason why this vertical was chosen, "as the file says"
std::optional<std::string> not_upright(const Eigen::Vector3d& upward, const Eigen::Vector3d& vertical,
                                       const std::string& reason);

/// The vertical of a format whose rule is y, but which many programs write with another one (BVH), and what there is to
/// say about it.
struct FoundVertical {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitY();
  std::optional<std::string> note, warning;
};

/// The rest pose decides together with the motion: the axis along which it stands is the vertical, unless the frames
/// are nearer to y. A rest pose along y is the format's own, so a body that lies in the frames lies. Where the rest
/// pose is no pose of a body, a body that stands along z in the frames is taken as standing.
FoundVertical vertical_of(const SourceStance& stance);

/// Turns the frames so that an axis becomes y. The rest pose may stand along any axis.
void turn_to_y_up(JointTracks& tracks, const Eigen::Vector3d& up);

}  // namespace doppel
