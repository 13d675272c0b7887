#include "doppel/train/stage_chain.h"

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/train/def_net_stage.h"
#include "doppel/train/delta_net_stage.h"
#include "doppel/train/egnet_stage.h"
#include "doppel/train/hybrid_stage.h"
#include "doppel/train/lighting_stage.h"
#include "doppel/train/nerf_stage.h"
#include "doppel/train/pose_net_stage.h"
#include "doppel/train/report.h"
#include "doppel/train/tex_net_stage.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kSharedKeys{"capture", "seed", "character"};
/// A run whose stages a hybrid takes.
constexpr char kDdc[] = "ddc";

/// The words of `stage:` that stand for several, with their first stage and the one behind their last.
struct ChainName {
  const char* word;
  StageKind first;
  int end;
};
constexpr ChainName kChains[] = {{"ddc", StageKind::egnet, static_cast<int>(StageKind::radiance)},
                                 {"hybrid", StageKind::egnet, static_cast<int>(StageKind::posenet)},
                                 {"deepcap", StageKind::posenet, kNumStages}};

const ChainName* find_chain(const std::string& word) {
  for (const ChainName& chain : kChains)
    if (word == chain.word) return &chain;
  return nullptr;
}

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
    case StageKind::radiance:
      HybridRunConfig::read(document);
      break;
    case StageKind::nerf:
      NerfRunConfig::read(document);
      break;
    case StageKind::posenet:
      PoseNetRunConfig::read(document);
      break;
    case StageKind::defnet:
      DefNetRunConfig::read(document);
      break;
  }
}

/// A stage that stands at the beginning of a chain: it needs the character alone.
template <typename StageType, typename Config>
TrainSummary train_first(const ConfigDocument& document, const std::string& resolved, const RunFolder& folder,
                         RunMode mode) {
  const Config config = Config::read(document);
  const Dataset dataset = Dataset::open(config.subject.capture);
  const Character character = load_character(dataset.character_path(), config.subject.character);
  folder.open(resolved, mode);
  StageType stage(dataset, character, config);
  return Trainer(stage, config.trainer, folder).run();
}

/// One that builds on what was trained before it.
template <typename StageType, typename Config, typename Trained>
TrainSummary train_next(Trained& trained, const ConfigDocument& document, const std::string& resolved,
                        const RunFolder& folder, RunMode mode) {
  const Dataset dataset = Dataset::open(trained.subject.capture);
  folder.open(resolved, mode);
  const Config config = Config::read(document);
  StageType stage(dataset, trained, config);
  return Trainer(stage, config.trainer, folder).run();
}

TrainSummary train_one(StageKind kind, const ConfigDocument& document, const fs::path& out, const RunFolder& folder,
                       RunMode mode) {
  const std::string head = document.root().has("stage") ? "" : fmt::format("stage: {}\n", name_of(kind));
  const std::string resolved = head + document.resolved();
  if (kind == StageKind::egnet) return train_first<EgNetStage, EgNetRunConfig>(document, resolved, folder, mode);
  if (kind == StageKind::posenet) return train_first<PoseNetStage, PoseNetRunConfig>(document, resolved, folder, mode);
  if (kind == StageKind::defnet) {
    TrainedPose pose = TrainedPose::load(out, std::nullopt, /*with_defnet=*/false);
    return train_next<DefNetStage, DefNetRunConfig>(pose, document, resolved, folder, mode);
  }
  TrainedActor actor = TrainedActor::load(out, std::nullopt, kind);
  if (kind == StageKind::lighting)
    return train_next<LightingStage, LightingRunConfig>(actor, document, resolved, folder, mode);
  if (kind == StageKind::deltanet)
    return train_next<DeltaNetStage, DeltaNetRunConfig>(actor, document, resolved, folder, mode);
  if (kind == StageKind::texnet)
    return train_next<TexNetStage, TexNetRunConfig>(actor, document, resolved, folder, mode);
  if (kind == StageKind::nerf) return train_next<NerfStage, NerfRunConfig>(actor, document, resolved, folder, mode);
  return train_next<HybridStage, HybridRunConfig>(actor, document, resolved, folder, mode);
}

}  // namespace

const std::vector<std::string>& stage_names() {
  static const std::vector<std::string> names{"egnet",    "lighting", "deltanet", "texnet",
                                              "radiance", "nerf",     "posenet",  "defnet"};
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
  chain.name_ = root.choice("stage", {"egnet", "posenet", "ddc", "hybrid", "deepcap"}, "egnet");
  const ChainName* several = find_chain(chain.name_);
  chain.single_ = several == nullptr;
  if (chain.single_) {
    const StageKind stage = stage_from(chain.name_);
    chain.sections_[static_cast<std::size_t>(stage)] = Section::own;
    check_stage(document, stage);
    return chain;
  }
  chain.read_sections(root, several->first, several->end);
  return chain;
}

/// The stages `first` .. `end` - 1 and nothing else may have sections.
void StageChain::read_sections(const ConfigReader& root, StageKind first, int end) {
  std::vector<std::string> known = kSharedKeys;
  known.push_back("stage");
  for (const std::string& key : kSharedKeys) root.has(key);
  const bool on_ddc = name_ == "hybrid" && root.has(kDdc);
  if (name_ == "hybrid") known.push_back(kDdc);
  if (on_ddc) root.path(kDdc);
  for (int i = static_cast<int>(first); i < end; ++i) {
    const std::string& name = name_of(kind_of(i));
    known.push_back(name);
    if (!root.has(name)) {
      if (on_ddc && kind_of(i) < StageKind::radiance) sections_[i] = Section::borrowed;
      continue;
    }
    const ConfigReader section = root.section(name);
    const bool is_borrowed = section.has("run");
    sections_[i] = is_borrowed ? Section::borrowed : Section::own;
    if (is_borrowed) {
      section.path("run");
      section.finish();
    } else {
      section.keys();
      check_stage(stage(kind_of(i)), kind_of(i));
    }
  }
  for (const std::string& key : root.keys())
    if (std::find(known.begin(), known.end(), key) == known.end()) {
      const auto meant = nearest_word(key, known);
      root.fail_at_key(key, "unknown key; {}",
                       meant ? "did you mean " + *meant + "?" : fmt::format("known are {}", fmt::join(known, ", ")));
    }
  if (!has(first))
    root.fail_at_key(name_of(first),
                     "a chain begins with this stage; it must be there (another run's: --set {}.run=RUN)",
                     name_of(first));
}

ConfigDocument StageChain::stage(StageKind stage) const {
  return single_ ? document_ : document_.part(name_of(stage), kSharedKeys);
}

fs::path StageChain::capture() const {
  const ConfigReader root = document_.root();
  return RunSubject::read(document_, root, name_).capture;
}

fs::path stage_folder(const fs::path& run, StageKind stage) {
  const ConfigDocument document = ConfigDocument::load(RunFolder(run).config());
  const ConfigReader root = document.root();
  const std::string name = root.get("stage", "egnet");
  if (!find_chain(name)) return name == name_of(stage) ? run : run / name_of(stage);
  if (!root.has(name_of(stage)) && stage < StageKind::radiance && root.has(kDdc))
    return stage_folder(root.path(kDdc), stage);
  const ConfigReader section = root.section(name_of(stage));
  return section.has("run") ? stage_folder(section.path("run"), stage) : run / name_of(stage);
}

void open_chain_folder(const fs::path& out, const std::string& text) {
  const fs::path config = RunFolder(out).config();
  if (fs::exists(out) && !fs::is_directory(out))
    fail<UsageError>("--out {}: this is a file; a run needs a folder", out.string());
  if (!fs::exists(config) && fs::exists(out) && !fs::is_empty(out))
    fail<UsageError>("--out {}: the folder holds something that is not a run; choose another one", out.string());
  if (fs::exists(config) && StageChain::read(ConfigDocument::load(config)).single())
    fail<UsageError>("--out {}: the folder holds a run of one stage; choose another one", out.string());
  fs::create_directories(out);
  write_atomically(config, text);
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
