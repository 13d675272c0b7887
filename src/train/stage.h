#pragma once

#include <torch/torch.h>

#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "doppel/train/profile.h"

namespace doppel {

/// One term of a stage's loss, before its weight.
struct LossTerm {
  std::string name;
  torch::Tensor value;  ///< scalar, with its graph
  double weight = 1.0;
};
using LossTerms = std::vector<LossTerm>;

/// What a stage may use while it computes a step.
struct StepContext {
  std::int64_t step = 0;    ///< steps done before this one
  at::Generator generator;  ///< the run's own randomness; its state is part of every checkpoint
  Profile* profile = nullptr;
};

/// An image for the report.
struct ReportImage {
  std::string name;  ///< a file name without extension
  std::string caption;
  cv::Mat image;  ///< 8-bit BGR
};

/// A part of Doppel that is trained by gradient descent: EGNet now; DeltaNet, TexNet, PoseNet, ... later. A stage owns
/// its data and its model; the Trainer owns the loop, the optimiser, the run folder and everything that must survive a
/// kill.
class Stage {
 public:
  virtual ~Stage() = default;

  virtual std::string name() const = 0;
  /// The module whose parameters are trained and whose buffers are saved.
  virtual torch::nn::Module& model() = 0;

  /// Draws the next batch and computes the loss on it. Terms keep their order and names over the whole run.
  virtual LossTerms loss(StepContext& context) = 0;
  /// The batch that `loss` drew last, in words for error messages ("frames 3, 17; cameras a, b").
  virtual std::string batch_description() const = 0;

  /// Where the stage stands in its data, such that after `restore_data` the next batches are the same.
  virtual std::string data_state() const = 0;
  virtual void restore_data(const std::string& state) = 0;

  /// What ties a checkpoint to this data and character; a run does not resume when it differs.
  virtual std::string identity() const = 0;

  /// Called with the evaluation weights in the model (their running mean, if there is one) just before its buffers are
  /// saved as `evaluation.*`: the place to recompute buffers that depend on the weights. Must not use randomness;
  /// whatever it changes in the model is undone afterwards.
  virtual void prepare_evaluation() {}
  /// Images of the present state for the report. Must not change the model nor use randomness.
  virtual std::vector<ReportImage> images() { return {}; }
};

}  // namespace doppel
