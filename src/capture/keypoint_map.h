#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/capture/joint_detections.h"
#include "doppel/capture/keypoints.h"

namespace doppel {

/// From a detector's points to landmarks.
struct KeypointMap {
  /// A landmark, and the points whose middle it is: one, several, or none where the detector does not find it.
  struct Entry {
    std::string landmark;
    std::vector<int> points;  ///< places in `layout.points`
  };
  PointLayout layout;
  std::vector<Entry> entries;

  const Entry* find(const std::string& landmark) const;
};

/// Reads a map: `body25`, `coco18` or `coco17`, which are built in (configs/keypoints/*.yaml), or a YAML file:
///
///     layout: coco17            # or `points: [nose, ...]`, the detector's own points in its order
///     landmarks:                # landmark: point, or the points whose middle it is
///       nose: nose
///       neck: [left_shoulder, right_shoulder]
///     absent: [mid_hip]         # landmarks that this detector does not find
///
/// @throws FileError (file:line) for unknown layouts and points, listing the known ones; UsageError when `name_or_path`
///         is neither a built-in map nor a file
KeypointMap read_keypoint_map(const std::string& name_or_path);

/// The map in which every landmark is a point of its own name: that of tables which name landmarks.
KeypointMap map_of_names(const std::vector<Marker>& landmarks);

/// The names of the maps that are built in.
std::vector<std::string> builtin_keypoint_maps();

/// The markers whose names a map knows: the landmarks of a capture without a placement file.
std::vector<Marker> known_markers(const Skeleton& skeleton, const KeypointMap& map);

/// Picks landmarks out of what a detector found.
class LandmarkPicker {
 public:
  /// @throws Error for a landmark that the map does not know, listing those it does
  LandmarkPicker(const KeypointMap& map, const std::vector<Marker>& landmarks);

  /// [M] The middle of several points is as sure as the least sure of them, and not seen unless all are. Without a
  /// person nothing is seen.
  std::vector<Keypoint> pick(const std::optional<Person>& person) const;
  /// [M] The same in space: the middle of several points is seen when all are. @param joints [n] in the layout's order
  std::vector<JointDetection> pick(const std::vector<JointDetection>& joints) const;

 private:
  std::vector<std::vector<int>> points_;  ///< [M]
};

}  // namespace doppel
