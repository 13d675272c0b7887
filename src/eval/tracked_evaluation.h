#pragma once

/// The measurements of `doppel evaluate --tracked`: the output of `doppel track`, of any method, with the metrics
/// of 5.8.

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/character/motion.h"
#include "doppel/eval/silhouette_overlap.h"

namespace doppel {

/// The tracked poses of one sequence, and the tracked surfaces where `doppel track --vertices` wrote them.
struct TrackedMotion {
  Motion motion;           ///< one row for each row of the capture's motion, up to the last tracked one
  long first_frame = 0;    ///< first tracked row
  torch::Tensor vertices;  ///< float32 [frames,N,3] from `first_frame` on, world metres; undefined: none
};

/// The output folder of `doppel track`.
struct TrackedRun {
  std::string method;                              ///< of track.json: multiview, livecap or deepcap
  std::map<std::string, TrackedMotion> sequences;  ///< by the name of the sequence
  std::string capture;                             ///< the name of the capture that was tracked
  std::filesystem::path root;                      ///< its folder

  /// @throws UsageError when `folder` holds no tracked sequence; Error for a file of another character, and for
  /// vertices that are not finite
  static TrackedRun load(const std::filesystem::path& folder, const Character& character);
  /// A sentence when this is the tracking of another capture; empty when name and folder are the same.
  std::string other_capture(const Capture& compared) const;
};

struct TrackedEvaluationOptions : EvaluationOptions {
  /// Standard deviation of the Gaussian over five frames (5.8) that smooths surfaces and joints, frames; 0: none.
  double smoothing = 0.0;
  /// Folder for images of where the tracked surface is nearer to the true surface than the skinned template, as in
  /// Fig. 4.17: one for each frame, in the input camera or else the first. Empty: none.
  std::filesystem::path error_maps;
};

/// Checks what `evaluate_tracked` needs, without measuring. Makes the folder `options.error_maps`.
/// @throws UsageError when a frame of the split was not tracked (the message names it), or when error maps are asked
/// for and a tracked or true surface is missing
void check_tracked(const Dataset& dataset, const TrackedRun& tracked, Split split,
                   const TrackedEvaluationOptions& options);

/// Evaluates the methods `pose`, the skinned template in the tracked pose, and `surface`, the tracked surface if there
/// is one, on the frames of a split. Where the poses of the capture are known, pose metrics (`compare_poses`) are
/// added. With `options.input_camera`, the method saw only this camera, which does not determine depth: surfaces are
/// moved until their root (root_of_joints) is at the true position, where it is known, before they are compared. Writes
/// `options.error_maps`.
/// @param character of the capture
/// @throws UsageError as check_tracked
nlohmann::ordered_json evaluate_tracked(const Dataset& dataset, const Character& character, const TrackedRun& tracked,
                                        Split split, const TrackedEvaluationOptions& options);

}  // namespace doppel
