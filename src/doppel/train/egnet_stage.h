#pragma once

#include <memory>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/data/dataset.h"
#include "doppel/data/loader.h"
#include "doppel/layers/surface.h"
#include "doppel/losses/arap.h"
#include "doppel/nets/egnet.h"
#include "doppel/train/egnet_config.h"
#include "doppel/train/stage.h"

namespace doppel {

/// Trains EGNet (6.5.1) from silhouettes: a window of poses gives the embedded deformation of its last frame, the
/// deformed and skinned surface is compared with the masks (6.8), and the graph is kept as rigid as possible (6.9).
class EgNetStage : public Stage {
 public:
  /// @param dataset, character must outlive the stage
  EgNetStage(const Dataset& dataset, const Character& character, const EgNetRunConfig& config);

  std::string name() const override { return "egnet"; }
  torch::nn::Module& model() override { return *network_; }
  LossTerms loss(StepContext& context) override;
  /// The loss on a given batch.
  LossTerms loss(const Batch& batch, StepContext& context);
  std::string batch_description() const override;
  std::string data_state() const override { return loader_.state(); }
  void restore_data(const std::string& state) override { loader_.restore(state); }
  std::string identity() const override;
  void prepare_evaluation() override;
  std::vector<Picture> pictures() override;

  EgNet& network() { return network_; }

 private:
  void standardise_inputs();
  torch::Tensor noisy(const torch::Tensor& dofs, at::Generator generator) const;
  /// Windows of the training frames, at most `limit` of them, evenly spread. [n,F+1,D]
  torch::Tensor training_windows(std::size_t limit) const;

  const Dataset& dataset_;
  const Character& character_;
  EgNetRunConfig config_;
  Loader loader_;
  EgNet network_;
  CharacterSurface surface_;
  ArapGraph arap_graph_;
  torch::Tensor faces_;           // int32 [F,3]
  torch::Tensor radians_to_dof_;  // [D]; 0 for DoFs that turn nothing
  Batch last_batch_;
};

/// Faces of a character as int32 [F,3].
torch::Tensor face_tensor(const Character& character);

}  // namespace doppel
