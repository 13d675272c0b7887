#pragma once

#include <string_view>

#include "doppel/detect/keypoints/space_points.h"

namespace doppel {

/// Whether bytes begin as a C3D file does: the number of a block, then 0x50.
bool is_c3d(std::string_view bytes);

/// Reads the points of a C3D file (c3d.org, "The C3D File Format"): numbers of Intel, DEC and MIPS machines, points as
/// floats or as integers times POINT:SCALE. The groups POINT and TRIAL say what is in the file; the header fills in
/// what they leave out. A point with a negative residual, with a coordinate that is not a number, or exactly at the
/// origin is missing. POINT:Y_SCREEN is the vertical. Analog channels are passed over.
/// @param metres_per_unit in place of POINT:UNITS
/// @throws FileError: truncated, no points, no frames, counts that the file is too short for, an unknown unit, a point
///   farther away than 100 km
SpacePoints parse_c3d(std::string_view bytes, const FileLocation& where, std::optional<double> metres_per_unit);

}  // namespace doppel
