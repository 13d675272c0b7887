#include "doppel/track/energy/terms/contour_term.h"

namespace doppel {

template <typename Model>
ContourTerm<Model>::ContourTerm(const std::vector<PinholeCamera>& cameras, const FrameEvidence& frame,
                                const std::vector<OutlineVertex>& vertices, int most, double farthest, double weight,
                                const RobustKernel& kernel)
    : cameras_(cameras), views_(cameras.size()), farthest_(farthest), weight_(weight), kernel_(kernel) {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (!frame[c].outline.empty()) views_[c].points = frame[c].outline.contour(most);
    views_[c].partner.resize(views_[c].points.size());
  }
  for (const OutlineVertex& vertex : vertices) views_[vertex.camera].vertices.push_back(vertex);
}

template <typename Model>
void ContourTerm<Model>::choose_partners(const Model& model, const typename Model::State& body,
                                         const PinholeCamera& camera, View& view) const {
  struct Seen {
    Eigen::Vector2d pixel, facing;
    const OutlineVertex* vertex;
  };
  std::vector<Seen> seen;
  for (const OutlineVertex& vertex : view.vertices)
    if (const auto projected = project_with_jacobian(camera, model.vertex(body, vertex.vertex)))
      seen.push_back({projected->pixel, projected->jacobian * model.normal(body, vertex.vertex), &vertex});
  const double limit = farthest_ / reference_pixels(camera);
  for (std::size_t i = 0; i < view.points.size(); ++i) {
    double nearest = limit * limit;
    view.partner[i].reset();
    for (const Seen& candidate : seen) {
      const double distance = (candidate.pixel - view.points[i].pixel).squaredNorm();
      if (distance >= nearest || candidate.facing.dot(view.points[i].normal) <= 0.0) continue;
      nearest = distance;
      view.partner[i] = *candidate.vertex;
    }
  }
}

template <typename Model>
void ContourTerm<Model>::freeze(const Model& model, const typename Model::State& body) {
  for (std::size_t c = 0; c < views_.size(); ++c) choose_partners(model, body, cameras_[c], views_[c]);
}

template <typename Model>
void ContourTerm<Model>::evaluate(const Model& model, const typename Model::State& body, bool jacobian,
                                  typename Model::Rows& rows) const {
  rows.reset(model.num_unknowns(), 1, kernel_, jacobian);
  for (std::size_t c = 0; c < views_.size(); ++c) {
    const View& view = views_[c];
    const double scale = reference_pixels(cameras_[c]);
    for (std::size_t i = 0; i < view.points.size(); ++i) {
      if (!view.partner[i]) continue;
      const auto& [number, vertex, distance] = *view.partner[i];
      const Eigen::Index row = rows.add_group(weight_ / static_cast<double>(view.points.size()));
      const auto projected = project_with_jacobian(cameras_[c], model.vertex(body, vertex));
      if (!projected) {
        rows.value(row) = kBehindCamera;
        continue;
      }
      const OutlineField::Point& point = view.points[i];
      rows.value(row) = scale * point.normal.dot(projected->pixel - point.pixel) - distance;
      if (jacobian)
        model.add_vertex_jacobian(body, vertex, scale * projected->jacobian.transpose() * point.normal,
                                  rows.jacobian(row));
    }
  }
}

template class ContourTerm<PoseModel>;
template class ContourTerm<GraphModel>;
template class ContourTerm<ShapeModel>;

}  // namespace doppel
