#pragma once

#include <torch/types.h>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Light that shows a shape from wherever it is seen: a sky that is brighter above, and a key that goes with the
/// camera, from above its right shoulder. @param albedo factor, for surfaces without texture
/// @return [1,1,3,9] coefficients as `shade` takes them
torch::Tensor soft_light(const Camera& camera, double albedo);

}  // namespace doppel
