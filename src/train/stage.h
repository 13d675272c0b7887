#pragma once

#include <torch/nn/module.h>
#include <torch/types.h>

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/core/profile.h"
#include "doppel/distributed/ranks.h"

namespace doppel {

/// One term of a stage's loss, before its weight.
struct LossTerm {
  std::string name;
  torch::Tensor value;  ///< scalar, differentiable
  double weight = 1.0;
  /// How many items of this rank's share `value` is a mean of (pixels, cameras, ...), asked for only when ranks share
  /// the batch: their mean is weighted by it. Empty: the samples of the share.
  std::function<double()> items{};
};
/// The items of a term that every rank computes alike.
inline double same_on_all_ranks() { return 1.0; }
using LossTerms = std::vector<LossTerm>;

/// The context of a training step.
struct StepContext {
  std::int64_t step = 0;    ///< steps done before this one
  at::Generator generator;  ///< the run's random numbers; checkpoints contain its state
  Profile* profile = nullptr;
  Ranks* ranks = nullptr;  ///< that share the batch; null: none
  BatchShare share{};      ///< this rank's rows; by default the batch is not shared
};

/// An image for the report.
struct ReportImage {
  std::string name;  ///< a file name without extension
  std::string caption;
  cv::Mat image;  ///< 8-bit BGR
};

/// One network with its losses, trained by gradient descent. A stage owns its data and its model. The Trainer owns the
/// loop, the optimiser, the run folder and everything that must survive a kill.
class Stage {
 public:
  virtual ~Stage() = default;

  virtual std::string name() const = 0;
  /// The module whose parameters are trained and whose buffers are saved.
  virtual torch::nn::Module& model() = 0;

  /// From now on, `loss` works on this rank's share of each batch, and sets `StepContext::share`. All ranks draw the
  /// same random numbers, those of the whole batch. @param ranks outlives the stage
  /// @throws UsageError when the batch cannot be shared by so many ranks
  virtual void share_batches(Ranks& ranks);

  /// Draws the next batch and computes the loss on it. Terms keep their order and names over the whole run.
  virtual LossTerms loss(StepContext& context) = 0;
  /// Describes the batch that `loss` drew last, for error messages ("frames 3, 17; cameras a, b").
  virtual std::string batch_description() const = 0;

  /// The position in the stage's data. After `restore_data(s)`, `loss` draws the batches that followed
  /// `data_state() == s`.
  virtual std::string data_state() const = 0;
  virtual void restore_data(const std::string& state) = 0;

  /// Identifies data and character. A run does not resume from a checkpoint with another identity.
  virtual std::string identity() const = 0;
  /// A checksum of the data. A run does not resume from a checkpoint with another one. Empty: there is no data.
  virtual std::string content() const { return {}; }
  /// Loads the weights that training starts from, if the configuration names any. Not called for a run that resumes.
  /// @throws Error when they cannot be read
  virtual void begin() {}
  /// The cameras of the data by their index, which checkpoints name.
  virtual std::vector<std::string> camera_names() const { return {}; }
  /// The frames per second of the data, which checkpoints state; 0: unknown.
  virtual double frames_per_second() const { return 0.0; }

  /// Whether a parameter can get a gradient in a step at or after `step`. A checkpoint holds the optimiser's moments of
  /// these parameters only. `step` counts the steps done so far; `parameter` is a name in `model`.
  virtual bool is_trained_from(std::int64_t /*step*/, const std::string& /*parameter*/) const { return true; }

  /// Recomputes buffers that depend on the weights. Called just before buffers are saved as `evaluation.*`, with the
  /// evaluation weights (the running mean, if there is one) in the model. Must not use random numbers; its changes to
  /// the model are undone afterwards.
  virtual void prepare_evaluation() {}
  /// Whether `validation_loss` has frames to measure.
  virtual bool has_validation_frames() const { return false; }
  /// The loss on frames of the validation split, with the evaluation weights in the model, which is in evaluation mode.
  /// Nothing when there are no such frames. Must not change the model or use the run's random numbers. The argument
  /// counts the steps done so far.
  virtual std::optional<double> validation_loss(std::int64_t /*step*/) { return std::nullopt; }
  /// Images of the current state for the report. Must not change the model or use random numbers.
  virtual std::vector<ReportImage> images() { return {}; }
};

}  // namespace doppel
