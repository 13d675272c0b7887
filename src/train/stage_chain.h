#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/train/trainer.h"

namespace doppel {

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
  /// Whether the configuration is of one stage alone.
  bool single() const { return single_; }
  /// What `stage:` says.
  const std::string& name() const { return name_; }
  bool has(const std::string& stage) const { return sections_.count(stage) > 0; }
  /// Whether another run has it.
  bool borrowed(const std::string& stage) const { return has(stage) && sections_.at(stage) == Section::borrowed; }
  /// The configuration of one stage, as if it were alone in its file.
  ConfigDocument stage(const std::string& stage) const;
  /// The prepared folder, absolute.
  std::filesystem::path capture() const;

 private:
  enum class Section { own, borrowed };
  void read_sections(const ConfigReader& root);
  void read_section(const ConfigReader& root, const std::string& stage);

  ConfigDocument document_;
  std::string name_;
  bool single_ = false;
  std::map<std::string, Section> sections_;  ///< of the stages that are there
};

/// Makes the folder that holds the stages of a chain: it must be new, empty, or a chain's already.
/// @param config its configuration, written as `config.yaml` @throws UsageError for a folder that holds something else
void open_chain_folder(const std::filesystem::path& out, const std::string& config);

struct StageSummary {
  std::string stage;
  TrainSummary summary;
};

struct ChainOptions {
  std::vector<std::string> stages;  ///< to train; empty: all the configuration has
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
