#pragma once

/// Gaussians as files for other programs. Both functions write one batch item, in the order of the tensors. The world
/// axes stay as they are: metres, right-handed, y up. Left out are Gaussians with a value that is not finite, a
/// standard deviation beyond float32, or a quaternion of length 0. In other programs, `Splats::normals` hide nothing.
/// Files are written atomically; missing folders are created.

#include <cstdint>
#include <filesystem>

#include "doppel/render/splats/splats.h"

namespace doppel {

/// The `.ply` of 3D Gaussian splatting: binary, little-endian, one float32 per property, in the order x y z, nx ny nz
/// (zeros without `Splats::normals`), f_dc_0..2, f_rest_* (all coefficients of red, then of green, then of blue),
/// opacity, scale_0..2, rot_0..3. The values are the raw ones of `Splats`: logits, logarithms, quaternions w x y z;
/// only the quaternions are normalised. Programs that take y down, as recordings by COLMAP have it, show the file
/// upside down.
/// @param file its content is replaced
/// @param splats float32, CPU, S = 1, 4, 9 or 16
/// @param item batch item, 0 to B-1
/// @throws UsageError for wrong shapes or types; Error when no Gaussian is left, or the file cannot be written. The
///         messages name the file.
void write_splat_ply(const std::filesystem::path& file, const Splats& splats, std::int64_t item = 0);

/// A binary glTF 2.0 with KHR_gaussian_splatting: one node, one primitive of points with POSITION, ROTATION (unit
/// quaternions x y z w), SCALE (standard deviations, metres), OPACITY (0 to 1) and the coefficients of the spherical
/// harmonics. glTF is y up and right-handed like our world. Programs without the extension draw points with COLOR_0:
/// the colour of degree 0 as linear RGB, and the opacity.
///
/// Programs with the extension differ from `draw_splats` in detail: the extension cuts Gaussians at three standard
/// deviations, where `draw_splats` goes by the opacity.
/// @param file its content is replaced
/// @param splats float32, CPU, S = 1, 4, 9 or 16; at most 4 GB in the file (15 million Gaussians of degree 3)
/// @param item batch item, 0 to B-1
/// @throws as `write_splat_ply`, and Error for a file beyond 4 GB
void write_splat_glb(const std::filesystem::path& file, const Splats& splats, std::int64_t item = 0);

}  // namespace doppel
