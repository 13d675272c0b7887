#include "doppel/train/egnet_config.h"

#include "doppel/core/error.h"

namespace doppel {

namespace {

CharacterOptions read_character(const ConfigReader& reader) {
  CharacterOptions o;
  o.bone_rule =
      reader.choice("bone_rule", {"exact", "prefix"}, "exact") == "exact" ? BoneRule::exact : BoneRule::prefix;
  o.num_nodes = reader.get("num_nodes", o.num_nodes, at_least(4));
  o.graph.metric =
      reader.choice("metric", {"hops", "geodesic"}, "hops") == "hops" ? GraphMetric::hops : GraphMetric::geodesic;
  o.rigidity = parse_rigidity_preset(reader.choice("rigidity", {"livecap", "graph", "laplacian"}, "graph"));
  return o;
}

void read_data(const ConfigReader& reader, EgNetRunConfig& c) {
  c.loader.split = parse_split(reader.choice("split", {"train", "test"}, "train"));
  c.loader.batch_size = reader.get("batch_size", 40, at_least(1));
  c.loader.cameras = reader.list<std::string>("cameras");
  c.loader.cameras_per_sample = reader.get("cameras_per_sample", 40, at_least(0));
  c.loader.workers = reader.get("workers", c.loader.workers, between(0, 256));
  c.loader.prefetch = reader.get("prefetch", c.loader.prefetch, at_least(1));
  c.loader.cache_mb = reader.get("cache_mb", c.loader.cache_mb, at_least(0));
  c.input_noise = reader.get("input_noise", c.input_noise, between(0.0, 1.0));
  c.pose_noise = reader.get("pose_noise", c.pose_noise, between(0.0, 1.0));
}

void read_loss(const ConfigReader& reader, EgNetRunConfig& c) {
  c.silhouette_weight = reader.get("silhouette", c.silhouette_weight, at_least(0.0));
  c.arap_weight = reader.get("arap", c.arap_weight, at_least(0.0));
  SilhouetteOptions& s = c.silhouette;
  s.model_to_data = reader.get("model_to_data", s.model_to_data, at_least(0.0));
  s.data_to_model = reader.get("data_to_model", s.data_to_model, at_least(0.0));
  s.distance_scale = reader.get("distance_scale", s.distance_scale, at_least(1e-6));
  s.contour_radius = reader.get("contour_radius", s.contour_radius, at_least(1e-6));
  s.visible_only = reader.get("visible_only", s.visible_only);
  s.unit = reader.choice("unit", {"crop_pixels", "image_pixels"}, "crop_pixels") == "crop_pixels"
               ? SilhouetteUnit::crop_pixels
               : SilhouetteUnit::image_pixels;
}

}  // namespace

EgNetRunConfig EgNetRunConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  root.choice("stage", {"egnet"}, "egnet");
  EgNetRunConfig c;
  const std::string capture = root.get("capture", "");
  if (capture.empty())
    fail<UsageError>("{}: no capture is named; add --set capture=DIR with the folder that `doppel prepare` wrote",
                     document.path().string());
  const std::filesystem::path folder = std::filesystem::absolute(document.path()).parent_path();
  c.capture = (folder / capture).lexically_normal();
  c.seed = root.get<long>("seed", 1, at_least(0L));
  c.character = read_character(root.section("character"));
  read_data(root.section("data"), c);
  const ConfigReader model = root.section("model");
  c.standardise = model.get("standardise", c.standardise);
  c.feature_floor = model.get("feature_floor", c.feature_floor, at_least(1e-9));
  c.recalibrate_norm = model.get("recalibrate_norm", c.recalibrate_norm);
  c.model = EgNetConfig::read(model);
  read_loss(root.section("loss"), c);
  c.trainer = TrainerOptions::read(root.section("train"), c.seed);
  root.finish();
  c.loader.window = c.model.window;
  c.loader.seed = static_cast<std::uint64_t>(c.seed);
  return c;
}

}  // namespace doppel
