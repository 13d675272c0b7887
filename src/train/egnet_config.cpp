#include "doppel/train/egnet_config.h"

#include "doppel/core/error.h"

namespace doppel {

EgNetRunConfig EgNetRunConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  EgNetRunConfig c;
  c.subject = RunSubject::read(document, root, "egnet");
  const ConfigReader data = root.section("data");
  c.loader = read_loader_options(data, 40, 40, c.subject.seed);
  c.noise = PoseNoiseOptions::read(data);
  const ConfigReader model = root.section("model");
  c.standardise = model.get("standardise", c.standardise);
  c.feature_floor = model.get("feature_floor", c.feature_floor, at_least(1e-9));
  c.recalibrate_norm = model.get("recalibrate_norm", c.recalibrate_norm);
  c.model = EgNetConfig::read(model);
  const ConfigReader loss = root.section("loss");
  c.silhouette_weight = loss.get("silhouette", c.silhouette_weight, at_least(0.0));
  c.arap_weight = loss.get("arap", c.arap_weight, at_least(0.0));
  c.anchor_weight = loss.get("anchor", c.anchor_weight, at_least(0.0));
  c.silhouette = read_silhouette_options(loss);
  c.trainer = TrainerOptions::read(root.section("train"), c.subject.seed);
  root.finish();
  c.loader.past_frames = c.model.history();
  return c;
}

}  // namespace doppel
