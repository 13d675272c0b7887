#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/core/config.h"
#include "doppel/data/loader.h"
#include "doppel/losses/silhouette.h"

namespace doppel {

/// What all stages of a run share: the top of a configuration.
struct RunSubject {
  std::filesystem::path capture;  ///< prepared folder, absolute
  std::int64_t seed = 1;
  CharacterOptions character;

  /// Reads `stage` (which must be `stage`), `capture`, `seed` and the section `character`.
  /// @throws UsageError when no capture is named
  static RunSubject read(const ConfigDocument& document, const ConfigReader& root, const std::string& stage);
};

/// The section `data` of a stage. @param batch_size,cameras_per_sample the thesis's, taken where the section is silent
LoaderOptions read_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample, std::int64_t seed);

/// The same for stages that look at pictures: with them, and the key `image_size`.
LoaderOptions read_picture_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample,
                                          std::int64_t seed);

/// The options with windows of `window` earlier frames: what the longest window of a stage's networks asks for.
LoaderOptions with_window(LoaderOptions options, int window);

/// The keys of the silhouette loss in a section `loss`, without the weight of the whole.
SilhouetteOptions read_silhouette_options(const ConfigReader& loss, const SilhouetteOptions& defaults = {});

}  // namespace doppel
