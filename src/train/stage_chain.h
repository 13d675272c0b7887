#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// A configuration and the stages it describes. `stage: egnet` and `stage: posenet` are single stages. `stage: ddc`,
/// `stage: hybrid` and `stage: deepcap` are chains, with `capture`, `seed` and `character` at the top and one section
/// per stage. A section has the keys of that stage's own configuration file; a stage without a section is left out. A
/// section with the single key `run: FOLDER` borrows the stage from another run; `ddc: FOLDER` at the top of a ddc or
/// hybrid borrows all stages of a run that stand before the first section.
class StageChain {
 public:
  /// Reads all sections, so that an error in the last one is reported before the first stage is trained.
  /// @throws FileError at the key
  static StageChain read(const ConfigDocument& document);

  const ConfigDocument& document() const { return document_; }
  /// Whether the configuration describes a single stage.
  bool single() const { return single_; }
  /// The value of `stage:`.
  const std::string& name() const { return name_; }
  bool has(const std::string& stage) const { return sections_.count(stage) > 0; }
  /// Whether the stage is borrowed from another run.
  bool borrowed(const std::string& stage) const { return has(stage) && sections_.at(stage) == Section::borrowed; }
  /// The configuration of one stage, as in a file of that stage alone.
  ConfigDocument stage(const std::string& stage) const;
  /// The absolute path of the prepared capture.
  std::filesystem::path capture() const;

 private:
  enum class Section { own, borrowed };
  bool borrows_from_ddc() const { return name_ == "ddc" || name_ == "hybrid"; }
  void read_sections(const ConfigReader& root);
  void read_section(const ConfigReader& root, const std::string& stage);

  ConfigDocument document_;
  std::string name_;
  bool single_ = false;
  std::map<std::string, Section> sections_;  ///< of the stages in the configuration
};

/// Makes the folder of a chain. It must be new, empty, or hold a chain already.
/// @param config the configuration, written as `config.yaml` @throws UsageError for a folder with other content
void open_chain_folder(const std::filesystem::path& out, const std::string& config);

struct StageSummary {
  std::string stage;
  TrainSummary summary;
};

struct ChainOptions {
  std::vector<std::string> stages;  ///< stages to train; empty: all in the configuration
  RunMode mode = RunMode::automatic;
  Ranks* ranks = nullptr;  ///< that train together; null: this process alone. Only rank 0 writes into `out`
};

/// Trains the stages of a chain one after the other into `out`. Each stage is resumed if it was begun; an interrupted
/// stage ends the chain. Every stage has its own run folder; `out/report.html` shows all stages.
/// @param chain its document must name an absolute capture
/// @throws UsageError for a stage that the configuration lacks, or whose earlier stages are not trained
std::vector<StageSummary> train_stages(const StageChain& chain, const std::filesystem::path& out,
                                       const ChainOptions& options);

/// Writes `run/report.html`: all trained stages, and the evaluation. Safe to call at any time.
void write_run_report(const std::filesystem::path& run);

}  // namespace doppel
