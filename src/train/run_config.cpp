#include "doppel/train/run_config.h"

#include "doppel/data/capture/capture.h"

namespace doppel {

LoaderOptions stage_loader(int batch_size, int cameras_per_sample) {
  LoaderOptions options;
  options.batch_size = batch_size;
  options.cameras_per_sample = cameras_per_sample;
  return options;
}

LoaderOptions image_loader(int batch_size, int cameras_per_sample) {
  LoaderOptions options = stage_loader(batch_size, cameras_per_sample);
  options.images = true;
  return options;
}

LoaderOptions with_past_frames(LoaderOptions options, int past_frames) {
  options.past_frames = past_frames;
  return options;
}

void describe_keys(const Keys& keys, LoaderOptions& options) {
  keys("split", options.split, split_words(), "of the frames to train on");
  keys("batch_size", options.batch_size, at_least(1), "frames of a step");
  keys("cameras", options.cameras, "names of the cameras to train on; empty: all");
  keys("frames", options.frames, "rows of the sequences' motions to train on; empty: all of the split");
  keys("cameras_per_sample", options.cameras_per_sample, at_least(0),
       "drawn anew for each sample; 0, or more than there are: all");
  keys("workers", options.workers, between(0, 256), "threads that load ahead; does not change results");
  keys("cache_mb", options.cache_mb, at_least(0), "memory for what is kept between epochs; does not change results");
  if (options.images)
    keys("image_size", options.image_size, at_least(0),
         "side of the images that are drawn and compared; 0: as prepared");
}

void describe_keys(const Keys& keys, SilhouetteOptions& options) {
  keys("model_to_data", options.model_to_data, at_least(0.0), "factor of the first sum of 6.8");
  keys("data_to_model", options.data_to_model, at_least(0.0), "factor of the second sum of 6.8");
  keys("inset", options.inset, between(-50.0, 50.0),
       "crop pixels that a boundary vertex should lie inside the outline of the mask, because the drawn outline runs "
       "outside its vertices; negative: outside");
  keys("boundary", options.boundary, {"vertices", "outline"},
       "what is compared with the mask: boundary vertices, as published, or the drawn outline, which needs crops of "
       "`--mask-size 700` and whose weights do not depend on the size of the crops");
  keys("visible_only", options.visible_only, "boundary vertices must be visible to the camera");
  keys("unit", options.unit, {"crop_pixels", "image_pixels"}, "of the residuals");
  const bool vertices = options.boundary == SilhouetteBoundary::vertices;
  keys.require("visible_only", vertices || !options.visible_only,
               "found true, but `boundary: outline` compares points of the drawn outline, not vertices; leave the key "
               "out, or set boundary: vertices");
  keys.require("unit", vertices || options.unit == SilhouetteUnit::crop_pixels,
               "found image_pixels, but `boundary: outline` counts in image pixels of its own accord; leave the key "
               "out, or set boundary: vertices");
}

void describe_keys(const Keys& keys, LaplacianOptions& options) {
  keys("laplacian_rigidity", options.rigidity, {"livecap", "graph", "laplacian"},
       "table of the rigidity of the materials in 6.17");
  keys("laplacian_weights", options.weights, {"vertex", "edges"},
       "what weighs a vertex in 6.17: its rigidity, or the mean rigidity of its edges");
}

}  // namespace doppel
