#include "doppel/actor/run_subject.h"

#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

void describe_keys(const Keys& keys, CharacterOptions& options) {
  keys("bone_rule", options.bone_rule, {"exact", "prefix"}, "how a bone of the skinning weights finds its joint");
  keys("num_nodes", options.num_nodes, at_least(4), "of the graph that is built when none lies beside the character");
  keys("metric", options.graph.metric, {"hops", "geodesic"}, "distance along the template for the weights of nodes");
  keys("falloff", options.graph.falloff, {"truncated", "smooth"},
       "how the weights of nodes fall with this distance; truncated ends with a step, as in public checkpoints");
  keys("rigidity", options.rigidity, {"livecap", "graph", "laplacian"}, "of the materials");
}

void describe_keys(const Keys& keys, RunSubject& subject) {
  keys("seed", subject.seed, at_least<std::int64_t>(0), "of all random numbers of the training");
  describe_keys(keys.section("character"), subject.character);
  describe_keys(keys.section("validation"), subject.validation);
}

RunSubject RunSubject::read(const ConfigDocument& document, const ConfigReader& root, const std::string& stage) {
  root.choice("stage", {stage}, stage);
  const std::string capture = root.get("capture", "");
  if (capture.empty())
    fail<UsageError>("{}: no capture is named; add --set capture=DIR with the folder that `doppel prepare` wrote",
                     document.path().string());
  const std::filesystem::path folder = std::filesystem::absolute(document.path()).parent_path();
  RunSubject subject;
  subject.capture = (folder / capture).lexically_normal();
  read_keys(root, subject);
  return subject;
}

void RunSubject::use_capture(const std::filesystem::path& folder) {
  const std::filesystem::path other = std::filesystem::absolute(folder);
  std::error_code missing;
  const bool same =
      std::filesystem::equivalent(other, capture, missing) || other.lexically_normal() == capture.lexically_normal();
  if (!same && !validation.empty()) {
    log::warn(
        "the run held out validation frames of {}; {} is another capture (or that one, moved), so all its training "
        "frames are in the split 'train'",
        capture.string(), other.string());
    validation = {};
  }
  capture = other;
}

Dataset RunSubject::open_dataset() const {
  Dataset dataset = Dataset::open(capture);
  dataset.hold_out(validation);
  return dataset;
}

}  // namespace doppel
