#pragma once

#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/terms/term.h"

namespace doppel {

/// How keypoints count by their confidence. The thesis has no such weight (4.3): `weigh` false and `minimum` 0.
struct KeypointConfidence {
  bool weigh = true;                 ///< false: all keypoints that count have the same weight
  double minimum = kSeenConfidence;  ///< a keypoint with a lower confidence does not count

  /// A keypoint of confidence 0 was not detected and never counts.
  bool counts(double confidence) const { return confidence > 0.0 && confidence >= minimum; }
  double weight(double confidence) const { return weigh ? confidence : 1.0; }
};

/// Pulls projected landmarks to their keypoints: the residual is pi_c(p_m) - k_cm in every camera (4.3), in reference
/// pixels (image 1024 wide), weighted by `KeypointConfidence` and by the model's `landmark_weight`. A landmark behind a
/// camera has the residual kBehindCamera.
template <typename Model>
class KeypointTerm : public Term<Model> {
 public:
  /// @param cameras, frame [C]; both must outlive the term
  /// @param weight per squared reference pixel @param kernel in reference pixels
  /// @param landmark_weights [M] lambda_i; none: 1 each
  KeypointTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame, double weight,
               const RobustKernel& kernel, std::vector<double> landmark_weights = {},
               const KeypointConfidence& confidence = {});

  std::string name() const override { return "keypoints"; }
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;

 private:
  const std::vector<PinholeCamera>& cameras_;
  const FrameEvidence& frame_;
  double weight_;
  RobustKernel kernel_;
  std::vector<double> landmark_weights_;
  KeypointConfidence confidence_;
};

}  // namespace doppel
