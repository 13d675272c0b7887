#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "doppel/actor/run_folder.h"
#include "doppel/core/options.h"
#include "doppel/train/adam.h"
#include "doppel/train/gradient_sum.h"
#include "doppel/train/metrics.h"
#include "doppel/train/schedule.h"
#include "doppel/train/stage.h"

namespace doppel {

class TensorBoardWriter;

/// How a stage is trained; `docs/training.md` explains every key. A session is one call of `Trainer::run`. A run that
/// was interrupted has several.
struct TrainerOptions {
  std::int64_t iterations = 1000;  ///< steps of the whole run
  Schedule schedule;               ///< the learning rate of each step
  AdamOptions adam;
  std::int64_t seed = 1;                ///< of the random numbers of training, LibTorch's global generator included
  std::int64_t log_every = 10;          ///< steps between two lines of metrics
  std::int64_t checkpoint_every = 500;  ///< steps between two checkpoints; there is always one at the end
  int keep_last = 2;                    ///< number of the newest checkpoints to keep
  std::int64_t keep_every = 0;          ///< also keep the checkpoints of steps divisible by this; 0: none
  std::int64_t images_every = 0;        ///< steps between two sets of images; 0: images at the end only
  double max_minutes = 0.0;             ///< limit of the training time, summed over all sessions; 0: no limit
  bool keep_best = false;   ///< keep the checkpoint with the smallest validation loss too, and use this one later
  bool keep_start = false;  ///< write a checkpoint before the first step too; not a configuration key
};
/// The keys of the section `train`.
void describe_keys(const Keys& keys, TrainerOptions& options);
/// The same for a stage whose number of steps and learning rates come from other keys.
/// @param schedule made from those keys; it gives the iterations too
/// @param source the message of the error at a key of the schedule; it names those keys
void describe_phased(const Keys& keys, TrainerOptions& options, const Schedule& schedule, const std::string& source);

/// Why a session ended. `finished`: all iterations are done. `time_limit`: max_minutes is reached. `interrupted`:
/// Ctrl-C or SIGTERM.
enum class StopReason { finished, time_limit, interrupted };

struct TrainSummary {
  StopReason reason = StopReason::finished;
  std::int64_t step = 0;        ///< steps done, over all sessions
  std::int64_t resumed_at = 0;  ///< steps done before this session; 0: it began the run
  double seconds = 0.0;         ///< training time, over all sessions
  double step_seconds = 0.0;    ///< mean time of the steps of this session behind its first, which prepares; 0: none
  double loss = 0.0;            ///< weighted loss in the last line of metrics; 0 when there is no line yet
};

/// @throws UsageError when a checkpoint in `run` is of another stage, or of other data or another character
void check_same_data(const Checkpoint& checkpoint, const Stage& stage, const std::filesystem::path& run);

/// Trains one stage, and writes checkpoints, metrics, images and the report to a run folder. A run that is killed and
/// started again ends with the same bits as a run that was never stopped. This holds on the same machine, with the same
/// number of threads and one training process.
class Trainer {
 public:
  /// Sets the seed of LibTorch's global random generator to `options.seed`.
  /// @param stage must outlive the trainer @param run a folder on which `RunFolder::open` was called
  /// @param ranks that train together, each with its own Trainer; null: this process alone. They see what one rank
  /// sees: the same batches, losses and weights up to rounding. Only rank 0 writes; all must read the same folder
  Trainer(Stage& stage, const TrainerOptions& options, const RunFolder& run, Ranks* ranks = nullptr);
  Trainer(const Trainer&) = delete;
  Trainer& operator=(const Trainer&) = delete;
  ~Trainer();

  /// Resumes from the newest checkpoint, if there is one. Trains until all iterations are done, the time limit is
  /// reached, or Ctrl-C or SIGTERM arrives. Then it writes a checkpoint, and images unless it was interrupted.
  /// @throws Error when a loss term or a gradient is not finite. The message names the stage, the step, the batch, and
  /// the term or parameter. The last checkpoint is kept.
  /// @throws Error when the folder holds checkpoints of another stage, of other data (UsageError), or only damaged ones
  TrainSummary run();

 private:
  void resume();
  std::optional<std::pair<std::int64_t, Checkpoint>> find_checkpoint();
  void join_ranks();
  /// @return TrainSummary::step_seconds
  double train();
  void log_and_save();
  void finish_files(StopReason reason);
  std::optional<StopReason> reason_to_stop() const;
  /// Whether this process writes the run: it is alone, or rank 0.
  bool writes() const { return !ranks_ || ranks_->is_first(); }
  /// Takes one step. @return the sum of the weighted loss terms
  double step();
  /// The values of the terms on the whole batch. @param share of each term's gradient that this rank contributes
  std::vector<MetricsRecord::Term> evaluate(const LossTerms& terms, const BatchShare& batch,
                                            std::vector<double>& share);
  void average_over_ranks(const LossTerms& terms, const BatchShare& batch, std::vector<double>& raw,
                          std::vector<double>& share);
  void backward(const LossTerms& terms, const std::vector<double>& share);
  void check_gradients(double norm, const LossTerms& terms);
  [[noreturn]] void fail_not_finite(const std::string& what) const;
  void log_metrics();
  void save_checkpoint();
  /// Whether a parameter can still be trained after this step.
  bool is_trained_later(const std::string& parameter) const { return stage_.is_trained_from(step_, parameter); }
  /// Adds the buffers of the evaluation, and measures the validation loss with them.
  void save_evaluation(Checkpoint& checkpoint);
  void log_validation(double loss);
  void save_images();
  double seconds() const;
  bool out_of_time() const;

  Stage& stage_;
  TrainerOptions options_;
  RunFolder run_;
  CheckpointFolder checkpoints_;
  Adam adam_;
  at::Generator generator_;
  Ranks* ranks_;  ///< null: one
  GradientSum gradients_;
  std::optional<StopReason> agreed_stop_;  ///< what several ranks decided in the last step
  MetricsWindow window_;
  std::unique_ptr<MetricsFile> metrics_, validation_;
  std::unique_ptr<TensorBoardWriter> tensorboard_;
  std::int64_t step_ = 0, saved_step_ = -1;
  double earlier_seconds_ = 0.0, last_loss_ = 0.0;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace doppel
