#include "doppel/train/stage_chain.h"

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/train/delta_net_stage.h"
#include "doppel/train/egnet_stage.h"
#include "doppel/train/lighting_stage.h"
#include "doppel/train/report.h"
#include "doppel/train/tex_net_stage.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kSharedKeys{"capture", "seed", "character"};

StageKind kind_of(int index) { return static_cast<StageKind>(index); }

/// Reads a stage's configuration for its errors alone.
void check_stage(const ConfigDocument& document, StageKind stage) {
  switch (stage) {
    case StageKind::egnet:
      EgNetRunConfig::read(document);
      break;
    case StageKind::lighting:
      LightingRunConfig::read(document);
      break;
    case StageKind::deltanet:
      DeltaNetRunConfig::read(document);
      break;
    case StageKind::texnet:
      TexNetRunConfig::read(document);
      break;
  }
}

TrainSummary train_one(StageKind kind, const ConfigDocument& document, const fs::path& out, const RunFolder& folder,
                       RunMode mode) {
  const std::string head = document.root().has("stage") ? "" : fmt::format("stage: {}\n", name_of(kind));
  const std::string resolved = head + document.resolved();
  if (kind == StageKind::egnet) {
    const EgNetRunConfig config = EgNetRunConfig::read(document);
    const Dataset dataset = Dataset::open(config.subject.capture);
    const Character character = load_character(dataset.character_path(), config.subject.character);
    folder.open(resolved, mode);
    EgNetStage stage(dataset, character, config);
    return Trainer(stage, config.trainer, folder).run();
  }
  TrainedActor actor = TrainedActor::load(out, std::nullopt, kind);
  const Dataset dataset = Dataset::open(actor.subject.capture);
  folder.open(resolved, mode);
  if (kind == StageKind::lighting) {
    const LightingRunConfig config = LightingRunConfig::read(document);
    LightingStage stage(dataset, actor, config);
    return Trainer(stage, config.trainer, folder).run();
  }
  if (kind == StageKind::deltanet) {
    const DeltaNetRunConfig config = DeltaNetRunConfig::read(document);
    DeltaNetStage stage(dataset, actor, config);
    return Trainer(stage, config.trainer, folder).run();
  }
  const TexNetRunConfig config = TexNetRunConfig::read(document);
  TexNetStage stage(dataset, actor, config);
  return Trainer(stage, config.trainer, folder).run();
}

/// The folder that holds the stages of a chain: it must be new, empty, or a chain's already.
void open_chain_folder(const fs::path& out, const std::string& resolved) {
  const fs::path config = RunFolder(out).config();
  if (fs::exists(out) && !fs::is_directory(out))
    fail<UsageError>("--out {}: this is a file; a run needs a folder", out.string());
  if (!fs::exists(config) && fs::exists(out) && !fs::is_empty(out))
    fail<UsageError>("--out {}: the folder holds something that is not a run; choose another one", out.string());
  if (fs::exists(config) && StageChain::read(ConfigDocument::load(config)).single())
    fail<UsageError>("--out {}: the folder holds a run of one stage; choose another one", out.string());
  fs::create_directories(out);
  write_atomically(config, resolved);
}

}  // namespace

const std::vector<std::string>& stage_names() {
  static const std::vector<std::string> names{"egnet", "lighting", "deltanet", "texnet"};
  return names;
}

const std::string& name_of(StageKind stage) { return stage_names()[static_cast<std::size_t>(stage)]; }

StageKind stage_from(const std::string& name) {
  const auto found = std::find(stage_names().begin(), stage_names().end(), name);
  if (found == stage_names().end()) {
    const auto meant = nearest_word(name, stage_names());
    fail<UsageError>("there is no stage \"{}\"; there are {}{}", name, fmt::join(stage_names(), ", "),
                     meant ? "; did you mean " + *meant + "?" : "");
  }
  return kind_of(static_cast<int>(found - stage_names().begin()));
}

StageChain StageChain::read(const ConfigDocument& document) {
  StageChain chain;
  chain.document_ = document;
  const ConfigReader root = document.root();
  chain.single_ = root.choice("stage", {"egnet", "ddc"}, "egnet") == "egnet";
  if (chain.single_) {
    chain.sections_[0] = Section::own;
    check_stage(document, StageKind::egnet);
    return chain;
  }
  for (const std::string& key : kSharedKeys) root.has(key);
  for (int i = 0; i < kNumStages; ++i) {
    const std::string& name = name_of(kind_of(i));
    if (!root.has(name)) continue;
    const ConfigReader section = root.section(name);
    const bool borrowed = section.has("run");
    chain.sections_[i] = borrowed ? Section::borrowed : Section::own;
    if (borrowed) {
      section.path("run");
      section.finish();
    } else {
      section.keys();
      check_stage(chain.stage(kind_of(i)), kind_of(i));
    }
  }
  for (const std::string& key : root.keys())
    if (key != "stage" && std::find(kSharedKeys.begin(), kSharedKeys.end(), key) == kSharedKeys.end() &&
        std::find(stage_names().begin(), stage_names().end(), key) == stage_names().end()) {
      std::vector<std::string> known = kSharedKeys;
      known.insert(known.end(), stage_names().begin(), stage_names().end());
      const auto meant = nearest_word(key, known);
      root.fail_at_key(key, "unknown key; {}",
                       meant ? "did you mean " + *meant + "?" : fmt::format("known are {}", fmt::join(known, ", ")));
    }
  if (!chain.has(StageKind::egnet)) root.fail_at_key("egnet", "a chain begins with this stage; it must be there");
  return chain;
}

ConfigDocument StageChain::stage(StageKind stage) const {
  return single_ ? document_ : document_.part(name_of(stage), kSharedKeys);
}

fs::path StageChain::capture() const {
  const ConfigReader root = document_.root();
  return RunSubject::read(document_, root, single_ ? "egnet" : "ddc").capture;
}

fs::path stage_folder(const fs::path& run, StageKind stage) {
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  if (root.get("stage", "egnet") != "ddc") return stage == StageKind::egnet ? run : run / name_of(stage);
  const ConfigReader section = root.section(name_of(stage));
  return section.has("run") ? stage_folder(section.path("run"), stage) : run / name_of(stage);
}

std::vector<StageSummary> train_stages(const StageChain& chain, const fs::path& out, const ChainOptions& options) {
  const auto wanted = [&](StageKind stage) {
    return options.stages.empty()
               ? chain.has(stage)
               : std::find(options.stages.begin(), options.stages.end(), stage) != options.stages.end();
  };
  for (StageKind stage : options.stages)
    if (!chain.has(stage)) fail<UsageError>("{} has no section `{}`", chain.document().path().string(), name_of(stage));
  if (!chain.single()) open_chain_folder(out, chain.document().resolved());
  std::vector<StageSummary> summaries;
  for (int i = 0; i < kNumStages; ++i) {
    const StageKind stage = kind_of(i);
    if (!wanted(stage) || chain.borrowed(stage)) continue;
    const RunFolder folder(chain.single() ? out : out / name_of(stage));
    if (!chain.single()) log::info("stage {}", name_of(stage));
    summaries.push_back({stage, train_one(stage, chain.stage(stage), out, folder, options.mode)});
    write_run_report(out);
    if (summaries.back().summary.reason == StopReason::interrupted) break;
  }
  return summaries;
}

void write_run_report(const fs::path& run) {
  const StageChain chain = StageChain::read(ConfigDocument::load(RunFolder(run).config()));
  if (chain.single()) return write_report(RunFolder(run));
  std::vector<ReportSection> sections;
  for (int i = 0; i < kNumStages; ++i) {
    const RunFolder folder(stage_folder(run, kind_of(i)));
    if (chain.has(kind_of(i)) && fs::exists(folder.config())) sections.push_back({name_of(kind_of(i)), folder});
  }
  write_report(RunFolder(run), sections);
}

}  // namespace doppel
