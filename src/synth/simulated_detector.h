#pragma once

#include <cstdint>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/synth/clothing.h"
#include "doppel/synth/studio.h"

namespace doppel::synth {

/// The skeleton's landmark for each BODY_25 point, -1 where there is none.
std::vector<int> body25_markers(const Skeleton& skeleton);

/// What a detector would find in the last image of the studio: x, y (pixels) and confidence of the 25 points, noisier
/// where a point is hidden.
/// @param camera_index in the studio @param markers positions of the landmarks, world metres
/// @param body25 see body25_markers @param key seed of the noise
std::vector<double> detect_points(const Studio& studio, int camera_index, const Camera& camera, const Points& markers,
                                  const std::vector<int>& body25, std::uint64_t key);

/// What a network would estimate in space: positions relative to the root, with an error that changes slowly (larger
/// in depth) and noise in every frame.
/// @return [25] camera axes, metres; not finite: no estimate
Points estimate_joints(const Camera& camera, const Points& markers, const std::vector<int>& body25, int frame,
                       std::uint64_t key);

}  // namespace doppel::synth
