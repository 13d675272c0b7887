#include "doppel/track/energy/terms/silhouette_term.h"

#include <cmath>

#include "doppel/core/as_size.h"

namespace doppel {

template <typename Model>
SilhouetteTerm<Model>::SilhouetteTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                      std::vector<OutlineVertex> vertices, double weight, double inside,
                                      const RobustKernel& kernel)
    : cameras_(cameras),
      frame_(frame),
      vertices_(std::move(vertices)),
      targets_(vertices_.size(), 0.0),
      inside_(std::sqrt(inside)),
      kernel_(kernel) {
  std::vector<double> count(cameras.size(), 0.0);
  for (const OutlineVertex& vertex : vertices_) ++count[vertex.camera];
  for (const OutlineVertex& vertex : vertices_) weights_.push_back(weight / count[vertex.camera]);
}

bool belongs_to_opposite_outline(const ProjectedPoint& projected, const Eigen::Vector3d& normal,
                                 const OutlineField::Sample& sample) {
  // Inside, the distance grows towards the nearest outline: z = -grad |d| = grad d.
  return sample.distance < 0.0 && (projected.jacobian * normal).dot(sample.gradient) < 0.0;
}

template <typename Model>
bool SilhouetteTerm<Model>::has_field(std::size_t i) const {
  return !frame_[vertices_[i].camera].outline.empty();
}

template <typename Model>
typename SilhouetteTerm<Model>::Seen SilhouetteTerm<Model>::see(const Model& model, const typename Model::State& body,
                                                                std::size_t i) const {
  const auto c = as_size(vertices_[i].camera);
  Seen seen{model.skinned(body, vertices_[i].vertex), std::nullopt, {}};
  seen.projected = project_with_jacobian(cameras_[c], seen.vertex.position());
  if (seen.projected) seen.sample = frame_[c].outline.at(seen.projected->pixel);
  return seen;
}

template <typename Model>
void SilhouetteTerm<Model>::choose_side(const Model& model, const Seen& seen, std::size_t i) {
  targets_[i] = vertices_[i].distance;
  if (!seen.projected || !(seen.sample.distance < 0.0)) return;
  if (belongs_to_opposite_outline(*seen.projected, model.normal(seen.vertex), seen.sample))
    targets_[i] = 2.0 * reference_pixels(cameras_[vertices_[i].camera]) * seen.sample.distance - vertices_[i].distance;
}

template <typename Model>
void SilhouetteTerm<Model>::add_row(const Model& model, const typename Model::State& body, const Seen& seen,
                                    std::size_t i, bool jacobian, typename Model::Rows& rows) const {
  const Eigen::Index row = rows.add_group(weights_[i]);
  if (!seen.projected) {
    rows.value(row) = kBehindCamera;
    return;
  }
  const double share = seen.sample.distance < 0.0 ? inside_ : 1.0;
  const double scale = share * reference_pixels(cameras_[vertices_[i].camera]);
  rows.value(row) = scale * seen.sample.distance - share * targets_[i];
  if (jacobian)
    model.add_vertex_jacobian(body, seen.vertex, scale * seen.projected->jacobian.transpose() * seen.sample.gradient,
                              rows.jacobian(row));
}

template <typename Model>
void SilhouetteTerm<Model>::freeze(const Model& model, const typename Model::State& body) {
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    if (has_field(i)) choose_side(model, see(model, body, i), i);
}

template <typename Model>
void SilhouetteTerm<Model>::evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                                     typename Model::Rows& rows) const {
  rows.reset(model.num_unknowns(), 1, kernel_, jacobian);
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    if (has_field(i)) add_row(model, body, see(model, body, i), i, jacobian, rows);
}

template <typename Model>
void SilhouetteTerm<Model>::linearise(const Model& model, const typename Model::State& body,
                                      typename Model::Rows& rows) {
  rows.reset(model.num_unknowns(), 1, kernel_, true);
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    if (!has_field(i)) continue;
    const Seen seen = see(model, body, i);
    choose_side(model, seen, i);
    add_row(model, body, seen, i, true, rows);
  }
}

template class SilhouetteTerm<PoseModel>;
template class SilhouetteTerm<GraphModel>;
template class SilhouetteTerm<ShapeModel>;

}  // namespace doppel
