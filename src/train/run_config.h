#pragma once

#include "doppel/actor/run_subject.h"
#include "doppel/core/config.h"
#include "doppel/core/options.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/losses/laplacian.h"
#include "doppel/losses/silhouette.h"

namespace doppel {

/// The loader of a stage before its configuration is read. @param batch_size,cameras_per_sample those of the thesis
LoaderOptions stage_loader(int batch_size, int cameras_per_sample);
/// The same for a stage that needs images.
LoaderOptions image_loader(int batch_size, int cameras_per_sample);

/// The options with motion windows of `past_frames` past frames, the largest number that the stage's networks need.
LoaderOptions with_past_frames(LoaderOptions options, int past_frames);

/// The keys of the section `data`; `image_size` only for a loader with images.
void describe_keys(const Keys& keys, LoaderOptions& options);
/// The keys of the silhouette loss in a section `loss`, except its weight.
void describe_keys(const Keys& keys, SilhouetteOptions& options);
/// The keys of the Laplacian loss in a section `loss`, except its weight.
void describe_keys(const Keys& keys, LaplacianOptions& options);

/// Reads the configuration of a stage. @throws FileError at the key; UsageError when no capture is named
template <typename Config>
Config read_run(const ConfigDocument& document, const std::string& stage) {
  const ConfigReader root = document.root();
  Config config;
  config.subject = RunSubject::read(document, root, stage);
  read_keys(root, config);
  root.finish();
  config.loader.seed = static_cast<std::uint64_t>(config.subject.seed);
  config.trainer.seed = config.subject.seed;
  return config;
}

}  // namespace doppel
