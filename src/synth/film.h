#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/synth/actor.h"
#include "doppel/synth/clothing.h"
#include "doppel/synth/synth_options.h"

namespace doppel::synth {

/// The parts of a capture that is being made.
struct CaptureSet {
  const Actor& actor;
  const std::vector<Camera>& cameras;
  const SynthOptions& options;
  std::filesystem::path root;  ///< of the capture
};

/// `ground_truth/<sequence>/vertices.npy` in the capture.
std::filesystem::path surfaces_file(const std::filesystem::path& root, const std::string& sequence);

/// The points of three numbers each.
Points as_points(const std::vector<float>& values);

/// Films a sequence with one camera: images, masks, keypoints and joints in space (CameraFiles). Reads the surfaces and
/// the poses of the sequence, which are complete. Each camera draws the shadows again, so that it needs no other
/// camera.
/// @param number of the sequence, part of the seed of the noise
/// @param next called before each frame; false ends the film, whose files are then incomplete
/// @return whether the film is complete
bool film_camera(const CaptureSet& set, const std::string& sequence, int number, int camera,
                 const std::function<bool()>& next);

}  // namespace doppel::synth
