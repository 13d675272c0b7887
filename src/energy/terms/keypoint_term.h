#pragma once

#include <vector>

#include "doppel/energy/evidence.h"
#include "doppel/energy/terms/term.h"

namespace doppel {

/// Landmarks belong where detectors saw them: pi_c(p_m) - k_cm in every camera (4.3), in pixels of an image 1024 wide,
/// weighted with the confidence, which counts as 0 below kSeenConfidence. A landmark behind a camera counts as
/// kBehindCamera pixels away.
template <typename Model>
class KeypointTerm : public Term<Model> {
 public:
  /// @param cameras without distortion, @param frame what they saw; both must outlive the term
  /// @param kernel in reference pixels
  /// @param landmark_weights [M] lambda_i; none: 1 each
  KeypointTerm(const std::vector<Camera>& cameras, const FrameEvidence& frame, double weight,
               const RobustKernel& kernel, std::vector<double> landmark_weights = {});

  std::string name() const override { return "keypoints"; }
  void evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                typename Model::Rows& rows) const override;

 private:
  const std::vector<Camera>& cameras_;
  const FrameEvidence& frame_;
  double weight_;
  RobustKernel kernel_;
  std::vector<double> landmark_weights_;
};

}  // namespace doppel
