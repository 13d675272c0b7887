#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace doppel {

/// What `doppel doctor` can find. docs/doctor.md explains each fault, with what to do.
namespace faults {
// Rig and keypoints: one camera disagrees with the others.
inline constexpr char kMirrored[] = "mirrored", kUpsideDown[] = "upside_down", kTurned[] = "turned_90",
                      kInvertedExtrinsics[] = "inverted_extrinsics", kCameraAxes[] = "camera_axes",
                      kWrongUnit[] = "wrong_unit", kSwapped[] = "swapped_cameras", kOutOfSync[] = "out_of_sync",
                      kRollingOffset[] = "rolling_offset", kFocalLength[] = "focal_length",
                      kPrincipalPoint[] = "principal_point", kDistortion[] = "distortion",
                      kMovedCamera[] = "moved_camera", kWrongResolution[] = "wrong_resolution",
                      kWrongPerson[] = "wrong_person", kLeftRight[] = "keypoints_left_right",
                      kWrongKeypoints[] = "wrong_keypoints", kDisagrees[] = "disagrees";
// The body in space.
inline constexpr char kWrongUp[] = "wrong_up", kOutOfView[] = "out_of_view";
// Files, images and masks.
inline constexpr char kUnreadable[] = "unreadable", kNoKeypoints[] = "no_keypoints", kFrameDrops[] = "frame_drops",
                      kExposure[] = "exposure", kWhiteBalance[] = "white_balance", kBlur[] = "blur",
                      kWrongMasks[] = "wrong_masks", kMaskFlicker[] = "mask_flicker", kMaskHoles[] = "mask_holes",
                      kMaskBorder[] = "mask_border", kFewCameras[] = "few_cameras";
}  // namespace faults

/// How much a finding matters.
enum class Severity {
  note,     ///< worth knowing; the capture is healthy nevertheless
  warning,  ///< a person should look at it
  fault     ///< results will be wrong until it is mended
};
std::string to_string(Severity severity);

/// One thing that was found.
struct Finding {
  std::string camera;  ///< its name; empty: all cameras together
  std::string fault;   ///< one of `faults`
  Severity severity = Severity::fault;
  std::string figure;  ///< what was measured, in words and numbers
  std::string advice;  ///< what is probably wrong and what to do, in sentences
};

/// A state in one word: `healthy` without warnings and faults, `suspicious` with warnings, `faulty` with faults.
enum class Verdict { healthy, suspicious, faulty };
std::string to_string(Verdict verdict);
Verdict verdict_of(const std::vector<Finding>& findings);

/// Faults first, then by camera in the order of `cameras`. Of equal faults of one camera (from several sequences) the
/// most severe stays.
/// @param cameras names in the order of the capture
std::vector<Finding> sorted_findings(std::vector<Finding> findings, const std::vector<std::string>& cameras);

/// {"verdict", "findings": [{"camera": name or null, "fault", "severity", "figure", "advice"}]}
nlohmann::ordered_json findings_json(const std::vector<Finding>& findings);

}  // namespace doppel
