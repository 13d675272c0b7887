#pragma once

#include <array>
#include <optional>
#include <vector>

#include "doppel/calibration/estimation/align_cameras.h"
#include "doppel/calibration/estimation/point_tracks.h"

namespace doppel {

/// Indices of a detector's points, left and right; -1: the detector does not find the point.
struct BodyPointIndices {
  using Pair = std::array<int, 2>;
  Pair shoulders{-1, -1}, hips{-1, -1}, knees{-1, -1}, ankles{-1, -1}, heels{-1, -1}, toes{-1, -1};
};

struct WorldOptions {
  /// Stature of the person, metres. Nothing: 1.7, if the person would be no person's size otherwise; else the scale is
  /// kept.
  std::optional<double> stature;
  std::size_t most_times = 400;  ///< times that are looked at; more are thinned out
};

/// A world whose unit, floor and up axis a person shows.
struct WorldByPerson {
  Similarity world;           ///< from the old world: metres, y up, the floor at y = 0, the person above the origin
  double stature = 0.0;       ///< of the person in the new world, metres
  double turn = 0.0;          ///< radians between the old world's +y and the new one's
  double floor_spread = 0.0;  ///< root mean square height of the standing feet above the floor, metres
  bool scaled = false;        ///< whether the unit changed
};

/// Finds floor, up and unit of a rig that only knows how its cameras stand to each other, by a person who walks. Up is
/// first the median direction from the standing foot, or from the middle of both feet, to the trunk: a person who does
/// not fall has his weight above his feet. The floor is the plane below the lower foot of each time, by robust least
/// squares with a prior on its normal, the upright direction: a person on one spot does not show the slope of the
/// floor.
/// @throws Error as check_tracks for fewer than two cameras, when hips, shoulders and ankles are not found, or when the
/// person does not stand
WorldByPerson world_by_person(const std::vector<Camera>& cameras, const PointTracks& tracks,
                              const BodyPointIndices& points, const WorldOptions& options = {});

}  // namespace doppel
