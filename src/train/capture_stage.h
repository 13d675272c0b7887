#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/losses/silhouette.h"
#include "doppel/render/shading/shading.h"
#include "doppel/train/stage.h"

namespace doppel {

/// Base of the stages that train on a prepared capture: the loader, its state in a checkpoint, and descriptions for
/// messages.
class CaptureStage : public Stage {
 public:
  /// @param dataset, character must outlive the stage
  CaptureStage(const Dataset& dataset, const Character& character, const LoaderOptions& options);

  /// Shares the samples of a batch.
  void share_batches(Ranks& ranks) override { loader_.take_share(ranks.rank(), ranks.world()); }
  LossTerms loss(StepContext& context) override;
  /// The loss on a given batch.
  virtual LossTerms loss(const Batch& batch, StepContext& context) = 0;

  /// The loss without random changes of the inputs on at most 64 validation frames, evenly spread. Constant weights:
  /// those of the last step.
  std::optional<double> validation_loss(std::int64_t step) override;
  bool has_validation_frames() const override { return !dataset_.samples(Split::validation).empty(); }

  std::string batch_description() const override;
  std::string data_state() const override { return loader_.state(); }
  void restore_data(const std::string& state) override { loader_.restore(state); }
  std::string identity() const override;
  std::string content() const override;
  std::vector<std::string> camera_names() const override;
  double frames_per_second() const override { return dataset_.capture().fps; }

 protected:
  const Dataset& dataset() const { return dataset_; }
  const Character& character() const { return character_; }
  const LoaderOptions& loader_options() const { return options_; }
  /// Motion windows of training frames, at most `limit`, evenly spread. @return [n,F+1,D] with F past frames
  torch::Tensor training_windows(std::size_t limit, int past_frames) const;
  /// The terms of the validation loss on a batch. By default those of `loss` after the last step.
  /// @param context of the steps done so far
  virtual LossTerms validation_terms(const Batch& batch, StepContext& context);
  /// The splits to show in the report: the training frames, and those of the validation, or else of the test.
  std::vector<Split> splits_to_show() const;
  /// Frames of a split to show in the report, evenly spread.
  std::vector<SampleId> samples_to_show(Split split, int count) const;
  /// An image of outlines for each split that has frames: the mask's green, those of two surfaces blue and red.
  /// @param legend names of the blue and the red surface @param surfaces gives both surfaces of a frame, [N,3]
  std::vector<ReportImage> outline_images(
      const torch::Tensor& faces, const std::string& legend,
      const std::function<std::pair<torch::Tensor, torch::Tensor>(const SampleId&)>& surfaces) const;
  /// A sheet of images (ImageSheet) for each split that has frames.
  /// @param name of the images: NAME-SPLIT @param content of a row of the sheet @param drawings of a batch of one frame
  /// and camera
  std::vector<ReportImage> drawn_images(const std::string& name, const std::string& content,
                                        const std::function<std::vector<ShadedImage>(const Batch&)>& drawings) const;

 private:
  const Dataset& dataset_;
  const Character& character_;
  LoaderOptions options_;
  Loader loader_;
  Batch last_batch_;
  mutable std::string content_;  ///< empty until asked for
};

/// This rank's rays of a step. @param ranks null: the rays are not shared
/// @throws UsageError when there are more ranks than rays
BatchShare share_of_rays(const Ranks* ranks, std::int64_t rays);

/// The number of views that the silhouette loss of a batch is a mean over.
double silhouette_views(const Batch& batch);

/// The masks of a batch in the form that the silhouette loss needs.
SilhouetteTarget silhouette_target(const Batch& batch);

/// The two-sided silhouette loss (6.8) of vertices [B,N,3] against the batch, timed as `boundary` and `silhouette`.
SilhouetteLoss batch_silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const Batch& batch,
                                     const SilhouetteOptions& options, Profile& profile);

/// Mean and standard deviation of network inputs over motion windows, computed in double, a few windows at a time.
/// @param features computes the inputs of some windows, [b,...] @return two tensors with the shape of one item
std::pair<torch::Tensor, torch::Tensor> input_statistics(
    const torch::Tensor& windows, const std::function<torch::Tensor(const torch::Tensor&)>& features);

}  // namespace doppel
