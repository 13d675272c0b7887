#include "doppel/train/stage_chain.h"

#include <algorithm>

#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/train/report.h"
#include "doppel/train/stage_table.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kSharedKeys{"capture", "seed", "character", "validation"};

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

/// @throws UsageError when the chain takes a stage from its own folder
void check_borrowed_folders(const StageChain& chain, const fs::path& out) {
  const ConfigReader root = chain.document().root();
  const auto check = [&](const ConfigReader& reader, const std::string& key, const std::string& name) {
    if (fs::weakly_canonical(reader.path(key)) == fs::weakly_canonical(fs::absolute(out)))
      fail<UsageError>("--out {}: `{}` names this folder itself; give the new stages another --out", out.string(),
                       name);
  };
  if (root.has(kDdcKey)) check(root, kDdcKey, kDdcKey);
  for (const StageEntry& entry : stage_table())
    if (chain.borrowed(entry.name) && root.has(entry.name)) check(root.section(entry.name), "run", entry.name + ".run");
}

/// The config.yaml of a chain. Unless a stage has begun under it, or all are done, the one before comes back when this
/// object goes: a command that is refused leaves the run as it was.
class ChainConfig {
 public:
  ChainConfig(const StageChain& chain, const fs::path& out) : file_(RunFolder(out).config()) {
    if (fs::exists(file_)) before_ = read_file(file_);
    open_chain_folder(out, chain.document().resolved());
  }
  ChainConfig(const ChainConfig&) = delete;
  ChainConfig& operator=(const ChainConfig&) = delete;
  ~ChainConfig() {
    if (accepted_) return;
    try {
      if (before_)
        write_atomically(file_, *before_);
      else
        fs::remove(file_);
    } catch (const std::exception& e) {
      log::warn("{}: the earlier configuration could not be written back: {}", file_.string(), e.what());
    }
  }
  void accept() { accepted_ = true; }

 private:
  fs::path file_;
  std::optional<std::string> before_;
  bool accepted_ = false;
};

/// The configuration of a stage as in its own folder.
std::string resolved_stage(const ConfigDocument& document, const std::string& stage) {
  return (document.root().has("stage") ? "" : fmt::format("stage: {}\n", stage)) + document.resolved();
}

/// @throws UsageError when a stage that this one builds on has no checkpoint
void check_earlier_stages(const StageChain& chain, const StageEntry& entry, const fs::path& out) {
  for (const std::string& earlier : entry.after) {
    const fs::path folder = stage_folder(out, earlier);
    if (!CheckpointFolder(RunFolder(folder).checkpoints()).steps().empty()) continue;
    if (chain.borrowed(earlier))
      fail<UsageError>("{} builds on {}, and {}, which the configuration names for it, holds no checkpoint of {}",
                       entry.name, earlier, folder.string(), earlier);
    fail("{} has no checkpoint of {} yet; train it first, or take another run's: --set '{}={{run: RUN}}'", out.string(),
         earlier, earlier);
  }
}

}  // namespace

StageChain StageChain::read(const ConfigDocument& document) {
  StageChain chain;
  chain.document_ = document;
  const ConfigReader root = document.root();
  chain.name_ = root.choice("stage", stage_words(), "egnet");
  chain.single_ = std::any_of(stage_table().begin(), stage_table().end(),
                              [&](const StageEntry& entry) { return entry.name == chain.name_; });
  if (chain.single_) {
    chain.sections_[chain.name_] = Section::own;
    stage_entry(chain.name_).check_options(document);
  } else {
    chain.read_sections(root);
  }
  return chain;
}

/// Only the stages of the chain may have sections; the first must have one.
void StageChain::read_sections(const ConfigReader& root) {
  std::vector<std::string> known = kSharedKeys;
  known.emplace_back("stage");
  for (const std::string& key : kSharedKeys) root.has(key);
  if (borrows_from_ddc()) known.emplace_back(kDdcKey);
  if (borrows_from_ddc() && root.has(kDdcKey)) root.path(kDdcKey);
  std::string first;
  for (const StageEntry& entry : stage_table()) {
    if (!contains(entry.chains, name_)) continue;
    if (first.empty()) first = entry.name;
    known.push_back(entry.name);
    read_section(root, entry.name);
  }
  for (const std::string& key : root.keys())
    if (!contains(known, key)) {
      const auto meant = nearest_word(key, known);
      root.fail_at_key(key, "unknown key; {}",
                       meant ? "did you mean " + *meant + "?" : fmt::format("known are {}", fmt::join(known, ", ")));
    }
  if (!has(first))
    root.fail_at_key(first,
                     "a chain begins with this stage; add its section, or take another run's: --set '{}={{run: RUN}}'",
                     first);
}

void StageChain::read_section(const ConfigReader& root, const std::string& stage) {
  if (!root.has(stage)) {
    if (borrows_from_ddc() && root.has(kDdcKey) && comes_from_ddc(root, stage)) sections_[stage] = Section::borrowed;
    return;
  }
  const ConfigReader section = root.section(stage);
  if (section.has("run")) {
    sections_[stage] = Section::borrowed;
    section.path("run");
    section.finish();
  } else {
    sections_[stage] = Section::own;
    section.keys();
    stage_entry(stage).check_options(this->stage(stage));
  }
}

ConfigDocument StageChain::stage(const std::string& stage) const {
  return single_ ? document_ : document_.part(stage, kSharedKeys);
}

fs::path StageChain::capture() const {
  const ConfigReader root = document_.root();
  return RunSubject::read(document_, root, name_).capture;
}

void open_chain_folder(const fs::path& out, const std::string& text) {
  const fs::path config = RunFolder(out).config();
  if (fs::exists(out) && !fs::is_directory(out))
    fail<UsageError>("--out {}: is a file; a run needs a folder", out.string());
  if (!fs::exists(config) && !is_unused_folder(out))
    fail<UsageError>("--out {}: the folder holds something that is not a run; choose another one", out.string());
  if (fs::exists(config) && StageChain::read(ConfigDocument::load(config)).single())
    fail<UsageError>("--out {}: the folder holds a run of one stage; choose another one", out.string());
  fs::create_directories(out);
  write_atomically(config, text);
}

std::vector<StageSummary> train_stages(const StageChain& chain, const fs::path& out, const ChainOptions& options) {
  for (const std::string& stage : options.stages)
    if (!chain.has(stage)) fail<UsageError>("{} has no section `{}`", chain.document().path().string(), stage);
  const bool writes = !options.ranks || options.ranks->is_first();
  std::optional<FolderLock> lock;
  if (writes) lock.emplace(out);
  check_borrowed_folders(chain, out);
  const auto folder_of = [&](const StageEntry& entry) { return RunFolder(chain.single() ? out : out / entry.name); };
  const auto is_wanted = [&](const StageEntry& entry) {
    return (options.stages.empty() ? chain.has(entry.name) : contains(options.stages, entry.name)) &&
           !chain.borrowed(entry.name);
  };
  // A chain resumes if any of its stages does; the stages behind that one begin.
  const bool any_begun = std::any_of(stage_table().begin(), stage_table().end(), [&](const StageEntry& entry) {
    return is_wanted(entry) && !CheckpointFolder(folder_of(entry).checkpoints()).steps().empty();
  });
  const RunMode mode = options.mode == RunMode::resume && any_begun ? RunMode::automatic : options.mode;
  if (writes)
    for (const StageEntry& entry : stage_table())
      if (is_wanted(entry)) folder_of(entry).check(resolved_stage(chain.stage(entry.name), entry.name), mode);
  std::optional<ChainConfig> config;
  if (writes && !chain.single()) config.emplace(chain, out);
  const auto accept = [&] {
    if (config) config->accept();
  };
  const auto wait_for_files = [&] {  // of rank 0
    if (options.ranks) options.ranks->broadcast(std::string("written"));
  };
  wait_for_files();
  std::vector<StageSummary> summaries;
  for (const StageEntry& entry : stage_table()) {
    if (!is_wanted(entry)) continue;
    check_earlier_stages(chain, entry, out);
    const RunFolder folder = folder_of(entry);
    if (!chain.single()) log::info("stage {}", entry.name);
    const ConfigDocument document = chain.stage(entry.name);
    const std::string resolved = resolved_stage(document, entry.name);
    summaries.push_back({entry.name, entry.train({document, resolved, out, folder, mode, options.ranks, accept})});
    if (summaries.back().summary.step > summaries.back().summary.resumed_at) accept();
    if (writes) write_run_report(out);
    wait_for_files();
    if (summaries.back().summary.reason == StopReason::interrupted) break;
  }
  accept();
  return summaries;
}

void write_run_report(const fs::path& run) {
  const StageChain chain = StageChain::read(ConfigDocument::load(RunFolder(run).config()));
  if (chain.single()) return write_report(RunFolder(run));
  std::vector<ReportSection> sections;
  for (const StageEntry& entry : stage_table()) {
    const RunFolder folder(stage_folder(run, entry.name));
    if (chain.has(entry.name) && fs::exists(folder.config())) sections.push_back({entry.name, folder});
  }
  write_report(RunFolder(run), sections);
}

}  // namespace doppel
