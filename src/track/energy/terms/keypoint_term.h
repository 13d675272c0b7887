#pragma once

#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// Pulls projected landmarks to their keypoints: the residual is pi_c(p_m) - k_cm in every camera (4.3), in reference
/// pixels (image 1024 wide), weighted by the confidence, which counts as 0 below kSeenConfidence, and by the model's
/// `landmark_weight`. A landmark behind a camera has the residual kBehindCamera.
template <typename Model>
class KeypointTerm : public Term<Model> {
 public:
  /// @param cameras, frame [C]; both must outlive the term
  /// @param weight per squared reference pixel @param kernel in reference pixels
  /// @param landmark_weights [M] lambda_i; none: 1 each
  KeypointTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame, double weight,
               const RobustKernel& kernel, std::vector<double> landmark_weights = {});

  std::string name() const override { return "keypoints"; }
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;

 private:
  const std::vector<PinholeCamera>& cameras_;
  const FrameEvidence& frame_;
  double weight_;
  RobustKernel kernel_;
  std::vector<double> landmark_weights_;
};

}  // namespace doppel
