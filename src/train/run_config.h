#pragma once

#include "doppel/actor/run_subject.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/losses/silhouette.h"

namespace doppel {

/// Reads the section `data` of a stage. @param batch_size,cameras_per_sample defaults, those of the thesis
LoaderOptions read_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample, std::int64_t seed);

/// The same for stages that need images: it loads them and reads the key `image_size`.
LoaderOptions read_image_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample,
                                        std::int64_t seed);

/// The options with motion windows of `past_frames` past frames, the largest number that the stage's networks need.
LoaderOptions with_past_frames(LoaderOptions options, int past_frames);

/// Reads the keys of the silhouette loss in a section `loss`, except its weight.
SilhouetteOptions read_silhouette_options(const ConfigReader& loss, const SilhouetteOptions& defaults = {});

}  // namespace doppel
