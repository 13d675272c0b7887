#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/train/run_folder.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// Stages in the order they are trained in; each builds on those of its chain before it. The first four are the chain
/// `ddc` (chapter 6), with `radiance` and `nerf` they are `hybrid` (6.12), the others `deepcap` (chapter 5).
enum class StageKind { egnet, lighting, deltanet, texnet, radiance, nerf, posenet, defnet };
inline constexpr int kNumStages = 8;
/// egnet, lighting, deltanet, texnet, radiance, nerf, posenet, defnet
const std::vector<std::string>& stage_names();
const std::string& name_of(StageKind stage);
/// @throws UsageError for another word, with the nearest one
StageKind stage_from(const std::string& name);

/// A configuration and the stages it describes. `stage: egnet` or `stage: posenet` is one stage alone. `stage: ddc`,
/// `stage: hybrid` and `stage: deepcap` are chains: `capture`, `seed` and `character` on top, and a section per stage,
/// each with what a file of that stage alone would hold; a stage without a section is left out. A section with the one
/// key `run: FOLDER` takes a stage that another run has trained; `ddc: FOLDER` on top of a hybrid takes all of a run's.
class StageChain {
 public:
  /// Reads all sections, so that a mistake in the last one shows before the first is trained.
  /// @throws FileError at the key
  static StageChain read(const ConfigDocument& document);

  const ConfigDocument& document() const { return document_; }
  bool single() const { return single_; }
  /// What `stage:` says.
  const std::string& name() const { return name_; }
  bool has(StageKind stage) const { return sections_[static_cast<std::size_t>(stage)] != Section::absent; }
  /// Whether another run has it.
  bool borrowed(StageKind stage) const { return sections_[static_cast<std::size_t>(stage)] == Section::borrowed; }
  /// The configuration of one stage, as if it were alone in its file.
  ConfigDocument stage(StageKind stage) const;
  /// The prepared folder, absolute.
  std::filesystem::path capture() const;

 private:
  enum class Section { absent, own, borrowed };
  void read_sections(const ConfigReader& root, StageKind first, int end);

  ConfigDocument document_;
  std::string name_;
  bool single_ = false;
  Section sections_[kNumStages] = {};
};

/// Where a run keeps a stage: the folder itself for a run of one stage, else a folder of the stage's name in it, or the
/// one that the run's configuration borrows it from.
/// @throws Error when `run` holds no config.yaml
std::filesystem::path stage_folder(const std::filesystem::path& run, StageKind stage);

/// Makes the folder that holds the stages of a chain: it must be new, empty, or a chain's already.
/// @param config its configuration, written as `config.yaml` @throws UsageError for a folder that holds something else
void open_chain_folder(const std::filesystem::path& out, const std::string& config);

struct StageSummary {
  StageKind stage;
  TrainSummary summary;
};

struct ChainOptions {
  std::vector<StageKind> stages;  ///< to train; empty: all the configuration has
  RunMode mode = RunMode::automatic;
};

/// Trains the stages of a chain one after the other into `out`, each resumed where it stands; ends early when one is
/// interrupted. Every stage has a run folder of its own; `out/report.html` shows them all.
/// @param chain its document must name an absolute capture
/// @throws UsageError for a stage that the configuration lacks, or that needs one which was not trained
std::vector<StageSummary> train_stages(const StageChain& chain, const std::filesystem::path& out,
                                       const ChainOptions& options);

/// Writes `run/report.html`: the stages that are there, and the evaluation. Safe to call at any time.
void write_run_report(const std::filesystem::path& run);

}  // namespace doppel
