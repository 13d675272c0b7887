#include "doppel/track/terms/silhouette_term.h"

#include <cmath>

namespace doppel {

template <typename Model>
SilhouetteTerm<Model>::SilhouetteTerm(const std::vector<Camera>& cameras, const FrameEvidence& frame,
                                      std::vector<OutlineVertex> vertices, double weight, double inside,
                                      const RobustKernel& kernel)
    : cameras_(cameras),
      frame_(frame),
      vertices_(std::move(vertices)),
      targets_(vertices_.size(), 0.0),
      inside_(std::sqrt(inside)),
      kernel_(kernel) {
  std::vector<double> count(cameras.size(), 0.0);
  for (const OutlineVertex& vertex : vertices_) ++count[static_cast<std::size_t>(vertex.camera)];
  for (const OutlineVertex& vertex : vertices_)
    weights_.push_back(weight / count[static_cast<std::size_t>(vertex.camera)]);
}

bool belongs_to_opposite_outline(const ProjectedPoint& projected, const Eigen::Vector3d& normal,
                                 const OutlineField::Sample& sample) {
  // Inside, the distance grows towards the nearest outline: z = -grad |d| = grad d.
  return sample.distance < 0.0 && (projected.slope * normal).dot(sample.gradient) < 0.0;
}

template <typename Model>
void SilhouetteTerm<Model>::freeze(const Model& model, const typename Model::State& body) {
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const auto [camera, vertex, distance] = vertices_[i];
    targets_[i] = distance;
    const auto c = static_cast<std::size_t>(camera);
    const auto projected = project_with_slope(cameras_[c], model.vertex(body, vertex));
    if (!projected || frame_[c].outline.empty()) continue;
    const OutlineField::Sample sample = frame_[c].outline.at(projected->pixel);
    if (sample.distance < 0.0 && belongs_to_opposite_outline(*projected, model.normal(body, vertex), sample))
      targets_[i] = 2.0 * reference_pixels(cameras_[c]) * sample.distance - distance;
  }
}

template <typename Model>
void SilhouetteTerm<Model>::evaluate(const Model& model, const typename Model::State& body, bool slopes,
                                     typename Model::Rows& rows) const {
  rows.reset(model.num_unknowns(), 1, kernel_, slopes);
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const int camera = vertices_[i].camera, vertex = vertices_[i].vertex;
    const auto c = static_cast<std::size_t>(camera);
    if (frame_[c].outline.empty()) continue;
    const Eigen::Index row = rows.add_group(weights_[i]);
    const auto projected = project_with_slope(cameras_[c], model.vertex(body, vertex));
    if (!projected) {
      rows.value(row) = kBehindCamera;
      continue;
    }
    const OutlineField::Sample sample = frame_[c].outline.at(projected->pixel);
    const double scale = reference_pixels(cameras_[c]) * (sample.distance < 0.0 ? inside_ : 1.0);
    rows.value(row) = scale * sample.distance - (sample.distance < 0.0 ? inside_ : 1.0) * targets_[i];
    if (slopes)
      model.add_vertex_slope(body, vertex, scale * projected->slope.transpose() * sample.gradient, rows.slope(row));
  }
}

template class SilhouetteTerm<PoseModel>;
template class SilhouetteTerm<GraphModel>;

}  // namespace doppel
