#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace doppel {

/// The name of a texture that is spread over several images, each for one square of the texture coordinates: `u` and
/// `v` are the whole parts of the coordinates, from 0.
struct TileName {
  enum class Numbering {
    udim,       ///< 1001 + u + 10 v
    from_one,   ///< u1_v1 is the first tile
    from_zero,  ///< u0_v0 is the first tile
  };
  std::string before, after;  ///< what stands before and after the number
  Numbering numbering = Numbering::udim;
  bool is_pattern = false;  ///< whether the name has `<UDIM>` or `<UVTILE>` in place of a number

  std::string of(int u, int v) const;
};

constexpr int kTilesAlongU = 10, kTilesAlongV = 100;

/// The tiles of a name: `skin.<UDIM>.png`, `skin.1001.png`, `skin_<UVTILE>.png`, `skin_u1_v1.png`. A number may also
/// mean something else; the files beside it decide. Nothing for other names.
std::optional<TileName> tile_name_of(std::string_view name);

}  // namespace doppel
