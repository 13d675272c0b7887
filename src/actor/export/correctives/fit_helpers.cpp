#include "doppel/actor/export/correctives/fit_helpers.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <set>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr std::size_t kHelperFrames = 256;  ///< of the clips, and as many windows
constexpr double kMetricDamping = 1e-4;     ///< of the mean of the diagonal

/// M of bones: from where they are at rest to where they are.
std::vector<Eigen::Affine3d> moved_from_rest(const Figure& figure, const std::vector<Eigen::Affine3d>& posed) {
  std::vector<Eigen::Affine3d> moved;
  for (std::size_t b = 0; b < posed.size(); ++b) moved.push_back(posed[b] * figure.rest[b].inverse());
  return moved;
}

Eigen::Matrix3Xd columns_of(std::span<const float> vertices) {
  return Eigen::Map<const Eigen::Matrix3Xf>(vertices.data(), 3, static_cast<Eigen::Index>(vertices.size() / 3))
      .cast<double>();
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

class HelperFit {
 public:
  HelperFit(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
            const EngineTeacher& teacher, const EngineFrames& frames, const HelperFitOptions& options)
      : figure_(figure),
        skeleton_(skeleton),
        function_(function),
        teacher_(teacher),
        frames_(frames),
        options_(options),
        windows_(draw_windows(teacher, skeleton, options.windows, options.weights.seed)) {}

  FittedHelpers fitted() {
    HelperFigure helpers(
        figure_, find_helpers(surface(), {figure_.rest_vertices, figure_.node, figure_.weight}, options_.joints));
    HelperFunction function = fitted_function(helpers);
    return {std::move(helpers), std::move(function)};
  }

 private:
  SkinnedFrames surface() const {
    const std::vector<std::size_t> used = frames_.fitted(kHelperFrames);
    const std::span<const WindowRows> drawn{windows_.data(), std::min(kHelperFrames, windows_.size())};
    SkinnedFrames surface;
    surface.vertices.resize(3 * static_cast<Eigen::Index>(used.size() + drawn.size()),
                            static_cast<Eigen::Index>(figure_.node.size()));
    const auto add = [&](const std::vector<double>& dofs, std::span<const float> vertices) {
      surface.vertices.middleRows<3>(3 * static_cast<Eigen::Index>(surface.bones.size())) = columns_of(vertices);
      surface.bones.push_back(moved_from_rest(figure_, pose_nodes(figure_, skeleton_, dofs)));
    };
    for (const std::size_t t : used) add(frames_.clip.dofs[t], frames_.clip.vertices[t]);
    ask_actor(teacher_, drawn, "finding the surface",
              [&](std::size_t i, std::span<const float> vertices) { add(drawn[i].back(), vertices); });
    return surface;
  }

  /// In units of the displacements that they cause, errors of all parameters count the same.
  HelperFunction fitted_function(const HelperFigure& helpers) const {
    const Eigen::LLT<Eigen::MatrixXd> metric(helpers.metric());
    const Eigen::MatrixXf root = Eigen::MatrixXd(metric.matrixU()).cast<float>();
    SampleList parameters, samples;
    const auto add = [&](Eigen::VectorXf inputs, const std::vector<double>& dofs, std::span<const float> vertices,
                         auto... held_out) {
      const Eigen::VectorXf found = helpers.parameters(helpers.under(pose_nodes(figure_, skeleton_, dofs), vertices));
      samples.add(inputs, root * found, held_out...);
      parameters.add(std::move(inputs), found, held_out...);
    };
    ask_actor(teacher_, windows_, "asking the actor", [&](std::size_t i, std::span<const float> vertices) {
      add(inputs_of_window(function_, figure_, skeleton_, windows_[i]), windows_[i].back(), vertices);
    });
    for (std::size_t t = 0; t < frames_.use.size(); ++t)
      if (frames_.use[t] != FrameUse::unseen)
        add(frames_.inputs[t], frames_.clip.dofs[t], frames_.clip.vertices[t], frames_.use[t] == FrameUse::held_out);
    HelperFunction result{function_, parameters.low(), parameters.high()};
    fit_weights(samples.tensors(), options_.weights, result.shares);
    mix_weights(result.shares, Eigen::MatrixXd(metric.matrixU()).inverse().cast<float>());
    scale_weights(result.shares, result.low, result.high);
    return result;
  }

  const Figure& figure_;
  const Skeleton& skeleton_;
  const CorrectiveFunction& function_;
  const EngineTeacher& teacher_;
  const EngineFrames& frames_;
  HelperFitOptions options_;
  std::vector<WindowRows> windows_;
};

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
}

std::vector<Eigen::Affine3d> HelperFigure::under(const std::vector<Eigen::Affine3d>& bones,
                                                 std::span<const float> vertices) const {
  const std::vector<Eigen::Affine3d> moved = poser_.pose(moved_from_rest(figure_, bones), columns_of(vertices));
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

FittedHelpers fit_helpers(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                          const EngineTeacher& teacher, const EngineFrames& frames, const HelperFitOptions& options) {
  return HelperFit(figure, skeleton, function, teacher, frames, options).fitted();
}

}  // namespace doppel
