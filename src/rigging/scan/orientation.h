#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

struct OrientationOptions {
  /// "m", "cm", "mm", "dm", "inch", "foot", or metres per unit as a number; empty: found by the height of a person
  std::string unit;
  std::string up;  ///< "x", "+x", "-x", "y", ... ; empty: found by the shape
  /// What the scan's file says, metres and an axis. The shape of the person may speak against it: files of some formats
  /// always say something.
  std::optional<double> file_unit;
  std::string file_up;
  /// Whether the character frame is turned about the vertical so that the person faces +z (where the facing is known).
  bool face_z = true;
};

/// What the shape says about the person, in shares of the height. The joint finder refuses a bust or a sitting person
/// with more evidence than this.
struct ScanShape {
  double width = 0.0;      ///< horizontal extent from left to right; where the facing is unknown, the larger extent
  double thickness = 0.0;  ///< horizontal extent from front to back
  double volume = 0.0;     ///< over height^3; a standing person has 0.012 to 0.03
  double legs = 0.0;       ///< share of the height, from below, where the body's axis is outside: the gap of the legs
  double balance = 0.0;    ///< height of the centre of volume; 0.5 to 0.6 in a standing person
  double lean = 0.0;       ///< radians between the longest axis of the volume and the vertical
  double largest_share = 1.0;  ///< volume of the largest body over that of all bodies: about 0.5 for two persons
};

/// Where a scan's file has up, its unit, and the way to the character frame.
struct ScanOrientation {
  /// The character frame: metres, y up, feet at y = 0, the centre of volume at x = z = 0. A similarity; with a known
  /// facing (and `face_z`) the person looks along +z, else the file's axes are permuted only.
  Eigen::Matrix4d character_from_file = Eigen::Matrix4d::Identity();
  double metres_per_unit = 1.0;
  std::string unit;                       ///< "cm"; of a number: "0.0254 m"
  std::string up;                         ///< "+z"
  double height = 0.0;                    ///< metres, without floor and specks; a raised arm counts
  std::optional<Eigen::Vector3d> facing;  ///< unit vector in the file's axes, or unknown
  bool floor = false;                     ///< a floor was seen under the feet
  /// 0 (a guess) to 1 (certain). What was given has 1.
  double unit_confidence = 1.0, up_confidence = 1.0;
  double confidence() const { return std::min(unit_confidence, up_confidence); }
  ScanShape shape;
  /// Sentences that say what was found and why, for the terminal: "Unit: cm, because ...".
  std::vector<std::string> reasons;
};

/// Finds unit, up axis and facing of a scan of one standing person by size and shape. Specks, a floor under the feet, a
/// raised arm, a T-pose wider than high and holes do not matter. Unit: the height must be that of a person, 0.5 m to
/// 2.3 m (up to 2.8 m with raised arms). Up: legs below, head above. Facing: toes point forward; the mirror plane of
/// the body refines the direction.
/// @param mesh in the file's coordinates; may be unrepaired
/// @throws UsageError for an unknown unit or axis, an empty or flat mesh, or when no unit gives the height of a person
ScanOrientation find_orientation(const TriangleMesh& mesh, const OrientationOptions& options = {});

/// The mesh in another frame. UVs, colours and texture stay. A mirroring matrix also reverses the faces.
TriangleMesh transformed(const TriangleMesh& mesh, const Eigen::Matrix4d& target_from_source);

}  // namespace doppel
