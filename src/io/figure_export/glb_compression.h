#pragma once

#include <string>
#include <string_view>

namespace doppel {

/// How finely a compressed .glb states its numbers: each is a multiple of the step of its kind, so it is off by half a
/// step at most. Powers of two, which the extension's filter of floats holds exactly.
struct GlbSteps {
  double position = 0x1p-16;      ///< metres
  double displacement = 0x1p-14;  ///< of morph targets, metres
  double normal = 0x1p-9;         ///< components of unit normals
  double uv = 0x1p-15;
  double colour = 0x1p-10;
  double skin_weight = 0x1p-14;
  double morph_weight = 0x1p-15;
  double rotation = 0x1p-19;     ///< components of unit quaternions
  double translation = 0x1p-16;  ///< of nodes, metres
  double splat_scale = 0x1p-17;  ///< metres
  double splat = 0x1p-11;        ///< rotations, opacities and harmonics of Gaussians
};

/// The multiple of a step that is nearest to a value.
double round_to_step(double value, double step);

/// A binary glTF file with its accessors compressed (EXT_meshopt_compression, which the result requires). The normals
/// of morph targets become bytes, multiples of 1/127 from -1 to 1 (KHR_mesh_quantization). Numbers of other kinds than
/// those of `steps` keep their bits; so do numbers that are not finite, or more than 2^23 steps. The triangles of a
/// primitive keep their order, not their first corners. Images stay as they are.
/// @param glb with one buffer; each accessor has a view of its own
std::string compressed_glb(std::string_view glb, const GlbSteps& steps);

}  // namespace doppel
