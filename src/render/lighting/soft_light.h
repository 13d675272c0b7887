#pragma once

#include <torch/types.h>

#include "doppel/geometry/camera.h"

namespace doppel {

/// Lighting that shows the shape of a surface from any camera: a sky that is brighter above, and a key light at the
/// upper right of the camera. @param albedo factor, for surfaces without texture
/// @return [1,1,3,9] coefficients for `shade`
torch::Tensor soft_light(const Camera& camera, double albedo);

}  // namespace doppel
