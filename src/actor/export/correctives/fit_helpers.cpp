#include "doppel/actor/export/correctives/fit_helpers.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

namespace doppel {
namespace {

constexpr std::size_t kHelperFrames = 256;   ///< of the clips, and as many windows
constexpr Eigen::Index kMaxComponents = 48;  ///< of the parameters of all helpers; more are noise of the fit

/// Components of parameters p: c = of_parameters (p - mean), and p = mean + parameters c.
struct ComponentBasis {
  Eigen::VectorXf mean;           ///< [P]
  Eigen::MatrixXf of_parameters;  ///< [C, P]
  Eigen::MatrixXf parameters;     ///< [P, C]

  WeightSamples of(WeightSamples samples) const {
    const torch::Tensor rows = samples.weights, found = torch::empty({rows.size(0), of_parameters.rows()});
    rows_of(found) = (rows_of(rows).rowwise() - mean.transpose()) * of_parameters.transpose();
    samples.weights = found;
    return samples;
  }

  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static Eigen::Map<Rows> rows_of(const torch::Tensor& rows) {
    return {rows.data_ptr<float>(), rows.size(0), rows.size(1)};
  }
};

/// The principal components for a metric, in which they are orthonormal.
/// @param samples [S, P] @param metric [P, P] positive definite
ComponentBasis components_of(const torch::Tensor& samples, const Eigen::MatrixXd& metric) {
  const Eigen::MatrixXd rows = ComponentBasis::rows_of(samples).cast<double>();
  const Eigen::VectorXd mean = rows.colwise().mean();
  const Eigen::MatrixXd root = Eigen::LLT<Eigen::MatrixXd>(metric).matrixU();
  const Eigen::MatrixXd scaled = (rows.rowwise() - mean.transpose()) * root.transpose(),
                        products = scaled.transpose() * scaled;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(products);
  const Eigen::MatrixXd ways = solver.eigenvectors().rightCols(std::min(kMaxComponents, root.rows()));
  return {mean.cast<float>(), (ways.transpose() * root).cast<float>(), (root.inverse() * ways).cast<float>()};
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
      surface.vertices.middleRows<3>(3 * static_cast<Eigen::Index>(surface.bones.size())) = vertex_columns(vertices);
      surface.bones.push_back(moved_from_rest(figure_, pose_nodes(figure_, skeleton_, dofs)));
    };
    for (const std::size_t t : used) add(frames_.clip.dofs[t], frames_.clip.vertices[t]);
    ask_actor(teacher_, drawn, "finding the surface",
              [&](std::size_t i, std::span<const float> vertices) { add(drawn[i].back(), vertices); });
    return surface;
  }

  /// Errors count as far as they move vertices: what is fitted are the principal components of the parameters in units
  /// of the displacements that they cause.
  HelperFunction fitted_function(const HelperFigure& helpers) const {
    const SampleList samples =
        ask_for_samples(teacher_, windows_, frames_, function_, figure_, skeleton_,
                        [&](const std::vector<double>& dofs, std::span<const float> vertices) {
                          return helpers.parameters(helpers.under(pose_nodes(figure_, skeleton_, dofs), vertices));
                        });
    HelperFunction result{function_, samples.low(), samples.high()};
    const WeightSamples tensors = samples.tensors();
    const ComponentBasis basis = components_of(tensors.weights, helpers.metric());
    fit_weights(basis.of(tensors), options_.weights, result.shares);
    mix_weights(result.shares, basis.parameters, basis.mean);
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

FittedHelpers fit_helpers(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                          const EngineTeacher& teacher, const EngineFrames& frames, const HelperFitOptions& options) {
  return HelperFit(figure, skeleton, function, teacher, frames, options).fitted();
}

}  // namespace doppel
