#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// A map from the points of a detector to landmarks.
struct KeypointMap {
  /// A landmark and the points whose mean it is: one, several, or none when the detector does not find this landmark.
  struct Entry {
    std::string landmark;
    std::vector<int> points;  ///< indices into `layout.points`
  };
  PointLayout layout;
  std::vector<Entry> entries;

  /// The entry of exactly this landmark, otherwise the first with the same landmark_key. @return null: none
  const Entry* find(const std::string& landmark) const;
};

/// Reads a map: one that is built in (configs/keypoints/*.yaml), or a YAML file:
///
///     layout: coco17            # of a built-in map; or `points: [nose, ...]`, the detector's own points in its order;
///                               # "face_{0..2}" stands for face_0, face_1, face_2
///     every_point: true         # each point is also a landmark of its own name; default false
///     landmarks:                # landmark: point, or the points whose mean it is
///       nose: nose
///       neck: [left_shoulder, right_shoulder]
///     absent: [mid_hip]         # landmarks that this detector does not find
///
/// Names may be spelled in any way that landmark_key knows.
/// @throws FileError (file:line) for unknown layouts and points, listing the known ones; UsageError when `name_or_path`
///         is neither a built-in map nor a file
KeypointMap read_keypoint_map(const std::string& name_or_path);

/// The map in which every landmark is a point of the same name, for tables with landmark names.
KeypointMap map_of_names(const std::vector<Marker>& landmarks);

/// The names of the maps that are built in.
std::vector<std::string> builtin_keypoint_maps();
/// Their layouts, in the same order.
const std::vector<PointLayout>& builtin_layouts();

/// The markers whose names a map contains: the landmarks of a capture without a placement file.
std::vector<Marker> known_markers(const Skeleton& skeleton, const KeypointMap& map);

/// Picks landmarks from the points of a detector.
class LandmarkPicker {
 public:
  /// @throws Error for a landmark that the map does not contain, listing those it contains
  LandmarkPicker(const KeypointMap& map, const std::vector<Marker>& landmarks);

  /// [M] The mean of several points has the lowest of their confidences, and is seen only if all of them are seen.
  /// Without a person no landmark is seen.
  std::vector<Keypoint> pick(const std::optional<Person>& person) const;
  /// [M] The same for 3D joints: the mean of several points is seen if all of them are.
  /// @param joints [n] in the order of the layout
  std::vector<JointDetection> pick(const std::vector<JointDetection>& joints) const;

 private:
  std::vector<std::vector<int>> points_;  ///< [M]
};

}  // namespace doppel
