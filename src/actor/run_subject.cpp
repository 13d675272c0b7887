#include "doppel/actor/run_subject.h"

#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {

namespace {

CharacterOptions read_character_options(const ConfigReader& reader) {
  CharacterOptions o;
  o.bone_rule =
      reader.choice("bone_rule", {"exact", "prefix"}, "exact") == "exact" ? BoneRule::exact : BoneRule::prefix;
  o.num_nodes = reader.get("num_nodes", o.num_nodes, at_least(4));
  o.graph.metric =
      reader.choice("metric", {"hops", "geodesic"}, "hops") == "hops" ? GraphMetric::hops : GraphMetric::geodesic;
  o.rigidity = parse_rigidity_preset(reader.choice("rigidity", {"livecap", "graph", "laplacian"}, "graph"));
  return o;
}

}  // namespace

RunSubject RunSubject::read(const ConfigDocument& document, const ConfigReader& root, const std::string& stage) {
  root.choice("stage", {stage}, stage);
  const std::string capture = root.get("capture", "");
  if (capture.empty())
    fail<UsageError>("{}: no capture is named; add --set capture=DIR with the folder that `doppel prepare` wrote",
                     document.path().string());
  const std::filesystem::path folder = std::filesystem::absolute(document.path()).parent_path();
  return {(folder / capture).lexically_normal(), root.get<long>("seed", 1, at_least(0L)),
          read_character_options(root.section("character")), ValidationFrames::read(root.section("validation"))};
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
