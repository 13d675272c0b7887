#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/rigging/autorig/body_points.h"
#include "doppel/rigging/joints/body_joints.h"
#include "doppel/rigging/scan/orientation.h"
#include "doppel/rigging/scan/scan_parts.h"
#include "doppel/rigging/weights/bend_report.h"
#include "doppel/rigging/weights/solid_grid.h"

namespace doppel {

struct CreateCharacterOptions {
  OrientationOptions orientation;
  std::optional<std::filesystem::path> joints;  ///< a file of joints (read_joints) instead of a search
  int vertices = 6000;                          ///< of the template; a scan with fewer keeps its own
  int nodes = 500;                              ///< of the embedded graph
  double cell = 0.008;                          ///< of the grid in which weights are computed, metres
  BodyPointsOptions points;
};

struct CreatedCharacter {
  Character character;
  JointsFile joints;                ///< where the joints lie in the scan's file
  cv::Mat joint_sheet;              ///< the scan from eight sides with its joints, 8-bit BGR
  BendReport bending;               ///< figures of five extreme poses
  cv::Mat pose_sheet;               ///< the character in these poses from four sides (draw_pose_sheet), 8-bit BGR
  std::vector<std::string> notes;   ///< what was found and mended, in sentences
  std::vector<std::string> doubts;  ///< what speaks against the joints, in sentences
};

/// Makes the character of a scanned person who stands upright: unit and up axis, repair, joints, template, skinning
/// weights, labels, graph. Examines and draws how the result bends. The world of the character: metres, y up, feet at y
/// = 0.
/// @param scan in the file's coordinates
/// @throws Error for several bodies that do not touch (where the joints are not given)
/// @throws UsageError / Error as merge_parts, find_orientation, repair, find_joints, read_joints and make_character
CreatedCharacter create_character(const std::string& name, const ScanParts& scan,
                                  const CreateCharacterOptions& options = {});

/// A sentence for each arm whose forearm hangs beside the trunk without a gap between them.
/// @param joints metres, in the frame of `solid`, complete
std::vector<std::string> touching_arms(const BodyJoints& joints, const SolidGrid& solid);

}  // namespace doppel
