#include "doppel/actor/export/correctives/helper_figure.h"

#include <fmt/format.h>

#include <set>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr double kMetricDamping = 1e-4;  ///< of the mean of the diagonal

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

}  // namespace

HelperFigure::HelperFigure(const Figure& bones, HelperSkin skin)
    : skin_(std::make_unique<HelperSkin>(std::move(skin))), poser_(*skin_), figure_(bones), standing_(bones.rest) {
  std::set<std::string> taken;
  for (const FigureNode& node : bones.nodes) taken.insert(node.name);
  for (std::size_t h = 0, number = 0; h < skin_->parents.size(); ++h) {
    std::string name;
    do name = fmt::format("Helper_{}", ++number);
    while (!taken.insert(name).second);
    const Eigen::Affine3d& bone = bones.rest[parent(h)];
    const Eigen::Affine3d mean = bone.inverse() * skin_->mean[h] * bone;
    const Eigen::Affine3d local =
        Eigen::Translation3d(bone.inverse() * poser_.centre(h)) * Eigen::Quaterniond(mean.linear()).conjugate();
    figure_.nodes.push_back({name, skin_->parents[h], bones.nodes[parent(h)].joint});
    figure_.rest.push_back(bone * local);
    standing_.push_back(bone * mean * local);
  }
  figure_.rest_vertices = skin_->skin.rest;
  figure_.node = skin_->skin.joint;
  figure_.weight = skin_->skin.weight;
  figure_.largest_dropped_weight = 0.0;
}

std::vector<Eigen::Affine3d> HelperFigure::under(const std::vector<Eigen::Affine3d>& bones,
                                                 std::span<const float> vertices) const {
  const std::vector<Eigen::Affine3d> moved = poser_.pose(moved_from_rest(figure_, bones), vertex_columns(vertices));
  std::vector<Eigen::Affine3d> all = bones;
  for (std::size_t h = 0; h < moved.size(); ++h) all.push_back(moved[h] * figure_.rest[bones.size() + h]);
  return all;
}

Eigen::VectorXf HelperFigure::parameters(const std::vector<Eigen::Affine3d>& nodes) const {
  Eigen::VectorXf result(6 * static_cast<Eigen::Index>(skin_->parents.size()));
  for (std::size_t h = 0; h < skin_->parents.size(); ++h) {
    const Eigen::Affine3d local = nodes[parent(h)].inverse() * nodes[as_size(skin_->bones) + h];
    const Eigen::AngleAxisd turn{Eigen::Quaterniond(local.linear())};
    const auto at = static_cast<Eigen::Index>(6 * h);
    result.segment<3>(at) = local.translation().cast<float>();
    result.segment<3>(at + 3) = (turn.angle() * turn.axis()).cast<float>();
  }
  return result;
}

std::vector<Eigen::Affine3d> HelperFigure::nodes(const std::vector<Eigen::Affine3d>& bones,
                                                 const std::vector<Eigen::Affine3d>& helpers) const {
  std::vector<Eigen::Affine3d> all = bones;
  for (std::size_t h = 0; h < helpers.size(); ++h) all.push_back(bones[parent(h)] * helpers[h]);
  return all;
}

Eigen::MatrixXd HelperFigure::metric() const {
  const auto size = static_cast<Eigen::Index>(6 * skin_->parents.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(size, size);
  const LinearSkin& skin = skin_->skin;
  for (std::size_t v = 0; v < skin.rest.size(); ++v) {
    std::vector<std::pair<Eigen::Index, Eigen::Matrix<double, 3, 6>>> moves;
    for (std::size_t i = 0; i < 4; ++i) {
      const int helper = skin.joint[v][i] - skin_->bones;
      if (helper < 0 || !(skin.weight[v][i] > 0.0F)) continue;
      const Eigen::Vector3d point = figure_.rest[as_size(skin.joint[v][i])].inverse() * skin.rest[v];
      Eigen::Matrix<double, 3, 6> move;
      move << Eigen::Matrix3d::Identity(), -cross_matrix(point);
      moves.emplace_back(
          6 * helper, static_cast<double>(skin.weight[v][i]) * figure_.rest[parent(as_size(helper))].linear() * move);
    }
    for (const auto& [a, left] : moves)
      for (const auto& [b, right] : moves) sum.block<6, 6>(a, b) += left.transpose() * right;
  }
  sum.diagonal().array() += kMetricDamping * sum.diagonal().mean() + 1e-12;
  return sum;
}

std::vector<Eigen::Affine3d> moved_from_rest(const Figure& figure, const std::vector<Eigen::Affine3d>& posed) {
  std::vector<Eigen::Affine3d> moved;
  for (std::size_t b = 0; b < posed.size(); ++b) moved.push_back(posed[b] * figure.rest[b].inverse());
  return moved;
}

Eigen::Matrix3Xd vertex_columns(std::span<const float> vertices) {
  return Eigen::Map<const Eigen::Matrix3Xf>(vertices.data(), 3, static_cast<Eigen::Index>(vertices.size() / 3))
      .cast<double>();
}

}  // namespace doppel
