#pragma once

#include <cmath>

#include "doppel/character/blend_skin.h"
#include "doppel/io/figure_export/figure_clip.h"

namespace doppel::support {

/// Dual quaternions, and a wave that runs over the surface: neither is a linear blend.
inline FigureClip waving_clip(const Character& character, int frames, double wave) {
  FigureClip clip;
  for (int t = 0; t < frames; ++t) {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += 0.4 * std::sin(0.13 * t + static_cast<double>(d));
    clip.dofs.push_back(dofs);
    std::vector<float> values;
    for (const Eigen::Vector3d& v : posed_vertices(character, dofs))
      for (int i = 0; i < 3; ++i)
        values.push_back(static_cast<float>(v[i] + wave * std::sin(0.2 * t + 8.0 * v.y() + i)));
    clip.vertices.push_back(values);
  }
  return clip;
}

}  // namespace doppel::support
