#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "doppel/actor/run_folder.h"
#include "doppel/core/config.h"
#include "doppel/train/adam.h"
#include "doppel/train/metrics.h"
#include "doppel/train/schedule.h"
#include "doppel/train/stage.h"

namespace doppel {

class TensorBoardWriter;

/// How a stage is trained; `docs/training.md` explains every key.
struct TrainerOptions {
  std::int64_t iterations = 1000;
  Schedule schedule;
  AdamOptions adam;
  std::int64_t seed = 1;
  std::int64_t log_every = 10;
  std::int64_t checkpoint_every = 500;
  int keep_last = 2;
  std::int64_t keep_every = 0;
  std::int64_t images_every = 0;  ///< 0: at the end only
  double max_minutes = 0.0;       ///< of training over all sessions; 0: no limit
  bool keep_start = false;        ///< write a checkpoint before the first step too; not a configuration key

  /// Reads the section `train`.
  static TrainerOptions read(const ConfigReader& reader, std::int64_t seed);
  /// The same for a stage whose steps and rates are configured elsewhere. @param source the other keys, for messages
  /// @throws FileError at `iterations`, `learning_rate` or `schedule`
  static TrainerOptions read_phased(const ConfigReader& reader, std::int64_t seed, const Schedule& schedule,
                                    const std::string& source);
};

/// Why a run ended.
enum class StopReason { finished, time_limit, interrupted };

struct TrainSummary {
  StopReason reason = StopReason::finished;
  std::int64_t step = 0;        ///< steps done
  std::int64_t resumed_at = 0;  ///< where this session began
  double seconds = 0.0;         ///< of training, over all sessions
  double loss = 0.0;            ///< of the last line of metrics
};

/// Trains one stage into a run folder. A run that is killed and started again ends with the same bits as an unbroken
/// run (one process, same number of threads).
class Trainer {
 public:
  /// @param run a folder opened with `RunFolder::open`
  Trainer(Stage& stage, const TrainerOptions& options, const RunFolder& run);
  ~Trainer();

  /// Resumes from the newest checkpoint, if there is one, and trains to the end, to the time limit or to Ctrl-C.
  /// @throws Error when a loss term or a gradient is not finite; the message names stage, step, batch and term. The
  /// last checkpoint is kept.
  TrainSummary run();

 private:
  void resume();
  /// One step. @return weighted loss
  double step();
  std::vector<MetricsRecord::Term> evaluate(const LossTerms& terms) const;
  void check_gradients(double norm, const LossTerms& terms);
  [[noreturn]] void fail_not_finite(const std::string& what) const;
  void log_metrics();
  void save_checkpoint();
  void save_evaluation_buffers(Checkpoint& checkpoint);
  void save_images();
  double seconds() const;
  bool out_of_time() const;

  Stage& stage_;
  TrainerOptions options_;
  RunFolder run_;
  CheckpointFolder checkpoints_;
  Adam adam_;
  at::Generator generator_;
  MetricsWindow window_;
  std::unique_ptr<MetricsFile> metrics_;
  std::unique_ptr<TensorBoardWriter> tensorboard_;
  std::int64_t step_ = 0, saved_step_ = -1;
  double earlier_seconds_ = 0.0, last_loss_ = 0.0;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace doppel
