#pragma once

#include "doppel/actor/run_subject.h"
#include "doppel/data/loader.h"
#include "doppel/losses/silhouette.h"

namespace doppel {

/// The section `data` of a stage. @param batch_size,cameras_per_sample the thesis's, taken where the section is silent
LoaderOptions read_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample, std::int64_t seed);

/// The same for stages that look at images: with them, and the key `image_size`.
LoaderOptions read_image_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample,
                                          std::int64_t seed);

/// The options with windows of `past_frames` earlier frames: what the longest window of a stage's networks asks for.
LoaderOptions with_past_frames(LoaderOptions options, int past_frames);

/// The keys of the silhouette loss in a section `loss`, without the weight of the whole.
SilhouetteOptions read_silhouette_options(const ConfigReader& loss, const SilhouetteOptions& defaults = {});

}  // namespace doppel
