#include "doppel/train/run_config.h"

#include "doppel/core/as_size.h"

namespace doppel {

LoaderOptions read_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample, std::int64_t seed) {
  LoaderOptions o;
  o.split = parse_split(data.choice("split", split_words(), "train"));
  o.batch_size = data.get("batch_size", batch_size, at_least(1));
  o.cameras = data.list<std::string>("cameras");
  o.frames = data.list<long>("frames");
  o.cameras_per_sample = data.get("cameras_per_sample", cameras_per_sample, at_least(0));
  o.workers = data.get("workers", o.workers, between(0, 256));
  o.prefetch = data.get("prefetch", o.prefetch, at_least(1));
  o.cache_mb = data.get("cache_mb", o.cache_mb, at_least(0));
  o.seed = static_cast<std::uint64_t>(seed);
  return o;
}

LoaderOptions read_image_loader_options(const ConfigReader& data, int batch_size, int cameras_per_sample,
                                        std::int64_t seed) {
  LoaderOptions o = read_loader_options(data, batch_size, cameras_per_sample, seed);
  o.images = true;
  o.image_size = data.get("image_size", 0, at_least(0));
  return o;
}

LoaderOptions with_past_frames(LoaderOptions options, int past_frames) {
  options.past_frames = past_frames;
  return options;
}

SilhouetteOptions read_silhouette_options(const ConfigReader& loss, const SilhouetteOptions& defaults) {
  SilhouetteOptions s = defaults;
  s.model_to_data = loss.get("model_to_data", s.model_to_data, at_least(0.0));
  s.data_to_model = loss.get("data_to_model", s.data_to_model, at_least(0.0));
  s.distance_scale = loss.get("distance_scale", s.distance_scale, at_least(1e-6));
  s.contour_radius = loss.get("contour_radius", s.contour_radius, at_least(1e-6));
  s.inset = loss.get("inset", s.inset, between(-50.0, 50.0));
  const std::vector<std::string> boundaries{"vertices", "outline"};
  s.boundary = loss.choice("boundary", boundaries, boundaries[as_size(s.boundary)]) == "outline"
                   ? SilhouetteBoundary::outline
                   : SilhouetteBoundary::vertices;
  s.visible_only = loss.get("visible_only", s.visible_only);
  s.unit = loss.choice("unit", {"crop_pixels", "image_pixels"}, "crop_pixels") == "crop_pixels"
               ? SilhouetteUnit::crop_pixels
               : SilhouetteUnit::image_pixels;
  return s;
}

}  // namespace doppel
