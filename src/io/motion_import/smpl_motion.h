#pragma once

#include <filesystem>

#include "doppel/io/motion_import/source_motion.h"

namespace doppel {

/// Reads a motion of SMPL, SMPL-H or SMPL-X from a `.npz` file, as AMASS stores it:
/// - `poses` [T, 3 J] or [T, J, 3]: axis and angle of each joint relative to its parent, radians; 66 numbers (the
/// body),
///   72 (SMPL), 156 (SMPL-H) or 165 (SMPL-X). The first 22 joints are the body in all of them; hands and face are left
///   out. Without `poses`, `root_orient` and `pose_body`, or `global_orient` and `body_pose`;
/// - `trans` or `transl` [T, 3]: metres; without it the body stays in place;
/// - `mocap_framerate`, `mocap_frame_rate`, `frame_rate` or `fps`.
/// The rest positions of the joints are those of rest_figure. The vertical is `options.up`, else z where the arrays are
/// named as in AMASS (`trans`, `mocap_framerate`), with a warning where the trunk does not stand along it; else the
/// axis along which the trunk stands on average, else z. The body is moved vertically until its lowest joint rests on
/// the floor: how far the model's pelvis is from its origin is in no motion file.
/// @throws FileError: as NpzFile; no poses (names what the file has), another shape or number of numbers (6D,
/// quaternions,
///   matrices), angles that are no radians, a number that is not finite, more
///   than 200000 frames, no frame rate in the file and in the options
SourceMotion read_smpl_motion(const std::filesystem::path& path, const MotionSourceOptions& options);

}  // namespace doppel
