#include "doppel/track/energy/terms/keypoint_term.h"

namespace doppel {

template <typename Model>
KeypointTerm<Model>::KeypointTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame, double weight,
                                  const RobustKernel& kernel, std::vector<double> landmark_weights,
                                  const KeypointConfidence& confidence)
    : cameras_(cameras),
      frame_(frame),
      weight_(weight),
      kernel_(kernel),
      landmark_weights_(std::move(landmark_weights)),
      confidence_(confidence) {}

template <typename Model>
void KeypointTerm<Model>::evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                                   typename Model::Rows& rows) const {
  rows.reset(model.num_unknowns(), 2, kernel_, jacobian);
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    const double scale = reference_pixels(cameras_[c]);
    for (int m = 0; m < model.num_landmarks(); ++m) {
      const Keypoint& keypoint = frame_[c].keypoints[m];
      if (!confidence_.counts(keypoint.confidence)) continue;
      const double share = model.landmark_weight(m) * (landmark_weights_.empty() ? 1.0 : landmark_weights_[m]);
      const Eigen::Index first = rows.add_group(weight_ * share * confidence_.weight(keypoint.confidence));
      const auto projected = project_with_jacobian(cameras_[c], model.landmark(body, m));
      if (!projected) {
        rows.value(first) = kBehindCamera;
        continue;
      }
      const Eigen::Vector2d error = scale * (projected->pixel - Eigen::Vector2d(keypoint.x, keypoint.y));
      for (int i = 0; i < 2; ++i) {
        rows.value(first + i) = error[i];
        if (jacobian)
          model.add_landmark_jacobian(body, m, scale * projected->jacobian.row(i).transpose(),
                                      rows.jacobian(first + i));
      }
    }
  }
}

template class KeypointTerm<PoseModel>;
template class KeypointTerm<GraphModel>;
template class KeypointTerm<ShapeModel>;

}  // namespace doppel
