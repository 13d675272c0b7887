#include "doppel/track/energy/shape_model.h"

#include <algorithm>

#include "doppel/character/landmarks.h"
#include "doppel/track/energy/landmark_weight.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr double kStep = 1e-2;  // of a forward difference, deviations of the parameter

}  // namespace

ShapedBody::ShapedBody(Character character, const std::vector<std::string>& landmarks)
    : character_(std::make_unique<const Character>(std::move(character))),
      poses_(*character_, markers_named(character_->skeleton, landmarks), {}) {}

ShapeSource::ShapeSource(const ShapeFamily& family, std::vector<std::string> landmarks)
    : family_(family), landmarks_(std::move(landmarks)), landmark_weights_(landmark_fit_weights(landmarks_)) {}

std::shared_ptr<const ShapeNeighbours> ShapeSource::at(const std::vector<double>& parameters, bool jacobian) const {
  if (last_ && last_->parameters == parameters && (!jacobian || !last_->raised.empty())) return last_;
  const auto body_of = [&](const std::vector<double>& values) {
    return std::make_unique<const ShapedBody>(family_.character(values), landmarks_);
  };
  auto made = std::make_shared<ShapeNeighbours>();
  made->parameters = parameters;
  made->body = body_of(parameters);
  for (std::size_t p = 0; jacobian && p < parameters.size(); ++p) {
    const ShapeParameter& parameter = family_.parameters()[p];
    const double step = kStep * parameter.deviation;
    made->steps.push_back(parameters[p] + step <= parameter.high ? step : -step);
    std::vector<double> values = parameters;
    values[p] += made->steps.back();
    made->raised.push_back(body_of(values));
  }
  return last_ = made;
}

PosedShape ShapeModel::pose(const std::vector<double>& parameters, bool jacobian) const {
  PosedShape posed{source_.at(parameters, jacobian), {}, {}};
  posed.body = posed.poses().pose(dofs_, false);
  if (jacobian)
    for (const auto& raised : posed.shapes->raised) posed.raised.push_back(raised->poses().pose(dofs_, false));
  return posed;
}

std::vector<double> ShapeModel::moved(const std::vector<double>& parameters, const Eigen::VectorXd& step) const {
  std::vector<double> result = parameters;
  for (std::size_t p = 0; p < result.size(); ++p) {
    const ShapeParameter& range = family().parameters()[p];
    result[p] = std::clamp(result[p] + step[static_cast<Eigen::Index>(p)], range.low, range.high);
  }
  return result;
}

Vector3d ShapeModel::landmark(const PosedShape& shape, int landmark) const {
  return shape.poses().landmark(shape.body, landmark);
}

Vector3d ShapeModel::vertex(const PosedShape& shape, int vertex) const {
  return shape.poses().vertex(shape.body, vertex);
}

ShapeModel::SkinnedVertex ShapeModel::skinned(const PosedShape& shape, int vertex) const {
  return {shape, vertex, shape.poses().skinned(shape.body, vertex)};
}

Vector3d ShapeModel::normal(const SkinnedVertex& vertex) const { return vertex.shape.poses().normal(vertex.skinned); }

void ShapeModel::add_landmark_jacobian(const PosedShape& shape, int landmark, const Vector3d& gradient, Row row) const {
  const Vector3d here = this->landmark(shape, landmark);
  for (std::size_t p = 0; p < shape.raised.size(); ++p) {
    const Vector3d there = shape.shapes->raised[p]->poses().landmark(shape.raised[p], landmark);
    row[static_cast<Eigen::Index>(p)] += gradient.dot(there - here) / shape.shapes->steps[p];
  }
}

void ShapeModel::add_vertex_jacobian(const PosedShape& shape, const SkinnedVertex& vertex, const Vector3d& gradient,
                                     Row row) const {
  const Vector3d here = vertex.position();
  for (std::size_t p = 0; p < shape.raised.size(); ++p) {
    const Vector3d there = shape.shapes->raised[p]->poses().vertex(shape.raised[p], vertex.vertex);
    row[static_cast<Eigen::Index>(p)] += gradient.dot(there - here) / shape.shapes->steps[p];
  }
}

}  // namespace doppel
