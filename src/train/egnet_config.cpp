#include "doppel/train/egnet_config.h"

namespace doppel {

void describe_keys(const Keys& keys, EgNetRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  describe_keys(keys.section("data"), c.noise);
  keys("model.standardise", c.standardise,
       "scale the inputs by their mean and standard deviation over the training frames");
  keys("model.recalibrate_norm", c.recalibrate_norm,
       "evaluation and export use batch-norm statistics of the whole training set instead of running ones");
  describe_keys(keys.section("model"), c.model);
  keys("loss.silhouette", c.silhouette_weight, at_least(0.0), "weight, thesis A.2");
  keys("loss.arap", c.arap_weight, at_least(0.0), "weight, thesis A.2");
  keys("loss.anchor", c.anchor_weight, at_least(0.0),
       "weight of the mean squared distance from the skinned surface, square metres: clothes do not slide along the "
       "body where the masks do not show it");
  describe_keys(keys.section("loss"), c.silhouette);
  describe_keys(keys.section("train"), c.trainer);
}

EgNetRunConfig EgNetRunConfig::read(const ConfigDocument& document) {
  EgNetRunConfig config = read_run<EgNetRunConfig>(document, "egnet");
  config.loader.past_frames = config.model.history();
  return config;
}

}  // namespace doppel
