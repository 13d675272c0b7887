#include "doppel/actor/export/correctives/fit_correctives.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {
namespace {

using torch::Tensor;
using Window = std::vector<std::vector<double>>;

constexpr int kShapeColumns = 256;
constexpr int kWindowsAtOnce = 16;
constexpr int kHeldOutEvery = 10;

/// The poses of a window before its last that a function sees: 1, 2, 4, ..., F.
std::vector<int> seen_poses(int past_frames) {
  std::vector<int> poses;
  for (int i = 1; i < past_frames; i *= 2) poses.push_back(i);
  if (past_frames > 0) poses.push_back(past_frames);
  return poses;
}

Tensor tensor_of_windows(const std::vector<Window>& windows) {
  const auto rows = static_cast<std::int64_t>(windows[0].size()),
             dofs = static_cast<std::int64_t>(windows[0][0].size());
  const Tensor result = torch::empty({static_cast<std::int64_t>(windows.size()), rows, dofs});
  float* out = result.data_ptr<float>();
  for (const Window& window : windows)
    for (const std::vector<double>& row : window)
      out = std::transform(row.begin(), row.end(), out, [](double v) { return static_cast<float>(v); });
  return result;
}

/// Rows of equal length as a tensor [S,n].
Tensor tensor_of_rows(const std::vector<Eigen::VectorXf>& rows) {
  const Tensor result =
      torch::empty({static_cast<std::int64_t>(rows.size()), static_cast<std::int64_t>(rows.front().size())});
  float* out = result.data_ptr<float>();
  for (const Eigen::VectorXf& row : rows) out = std::copy_n(row.data(), row.size(), out);
  return result;
}

class CorrectiveFit {
 public:
  CorrectiveFit(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                const EngineTeacher& teacher, const CorrectiveFrames& frames, const CorrectiveFitOptions& options)
      : figure_(figure), skeleton_(skeleton), teacher_(teacher), frames_(frames), options_(options) {
    result_.function = function;
  }

  FittedCorrectives fitted() {
    const WindowMixer mixer(skeleton_, teacher_.motions, teacher_.past_frames);
    Random random(options_.weights.seed);
    std::vector<Window> windows;
    for (int i = 0; i < options_.windows; ++i) windows.push_back(mixer.draw(random));
    find_shapes(windows);
    Progress progress("asking the actor", options_.windows);
    for (std::size_t first = 0; first < windows.size(); first += kWindowsAtOnce) {
      if (stop_requested()) fail("fitting correctives: stopped at window {} of {}", first, windows.size());
      const std::size_t count = std::min<std::size_t>(kWindowsAtOnce, windows.size() - first);
      add_windows({windows.begin() + static_cast<std::ptrdiff_t>(first),
                   windows.begin() + static_cast<std::ptrdiff_t>(first + count)});
      progress.advance(static_cast<std::int64_t>(count));
    }
    progress.finish();
    add_frames();
    fit_function();
    return std::move(result_);
  }

 private:
  Eigen::VectorXf displacement(const std::vector<double>& dofs, std::span<const float> vertices) const {
    return unposed_displacements(figure_, blend_transforms(figure_, pose_nodes(figure_, skeleton_, dofs)), vertices);
  }

  /// [3N, windows]
  Eigen::MatrixXf displacements(const std::vector<Window>& windows) const {
    const Tensor vertices = teacher_.geometry(tensor_of_windows(windows)).contiguous();
    const auto size = as_size(vertices.size(1) * vertices.size(2));
    Eigen::MatrixXf columns(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(windows.size()));
    for (std::size_t i = 0; i < windows.size(); ++i)
      columns.col(static_cast<Eigen::Index>(i)) =
          displacement(windows[i].back(), {vertices.data_ptr<float>() + i * size, size});
    return columns;
  }

  void find_shapes(const std::vector<Window>& windows) {
    std::vector<int> fitted;
    for (std::size_t t = 0; t < frames_.use.size(); ++t)
      if (frames_.use[t] == FrameUse::fitted) fitted.push_back(static_cast<int>(t));
    const std::size_t used = std::min<std::size_t>(kShapeColumns, fitted.size()),
                      drawn = std::min<std::size_t>(kShapeColumns, windows.size());
    Eigen::MatrixXf columns(3 * static_cast<Eigen::Index>(figure_.node.size()),
                            static_cast<Eigen::Index>(used + drawn));
    for (std::size_t i = 0; i < used; ++i) {
      const auto t = as_size(fitted[i * fitted.size() / used]);
      columns.col(static_cast<Eigen::Index>(i)) = displacement(frames_.clip.dofs[t], frames_.clip.vertices[t]);
    }
    for (std::size_t i = 0; i < drawn; i += kWindowsAtOnce) {
      const std::size_t count = std::min<std::size_t>(kWindowsAtOnce, drawn - i);
      columns.middleCols(static_cast<Eigen::Index>(used + i), static_cast<Eigen::Index>(count)) = displacements(
          {windows.begin() + static_cast<std::ptrdiff_t>(i), windows.begin() + static_cast<std::ptrdiff_t>(i + count)});
    }
    result_.shapes = linear_shapes(std::move(columns), options_.shapes);
    if (result_.shapes.components.cols() == 0)
      fail(
          "fitting correctives: the surface of the actor is its skin in every pose, so there is nothing to correct; "
          "--format glb holds it");
  }

  void add(Eigen::VectorXf inputs, const Eigen::VectorXf& displaced, bool held_out) {
    inputs_.push_back(std::move(inputs));
    weights_.push_back(result_.shapes.weights_of(displaced));
    held_out_.push_back(held_out ? 1 : 0);
  }

  void add_windows(const std::vector<Window>& windows) {
    const Eigen::MatrixXf columns = displacements(windows);
    for (std::size_t i = 0; i < windows.size(); ++i)
      add(inputs_of_window(result_.function, figure_, skeleton_, windows[i]), columns.col(static_cast<Eigen::Index>(i)),
          inputs_.size() % kHeldOutEvery == 0);
  }

  void add_frames() {
    for (std::size_t t = 0; t < frames_.use.size(); ++t)
      if (frames_.use[t] != FrameUse::unseen)
        add(frames_.inputs[t], displacement(frames_.clip.dofs[t], frames_.clip.vertices[t]),
            frames_.use[t] == FrameUse::held_out);
  }

  void fit_function() {
    fit_weights({tensor_of_rows(inputs_), tensor_of_rows(weights_), torch::tensor(held_out_).to(torch::kBool)},
                options_.weights, result_.function);
    result_.low = result_.high = weights_[0];
    for (const Eigen::VectorXf& weights : weights_) {
      result_.low = result_.low.cwiseMin(weights);
      result_.high = result_.high.cwiseMax(weights);
    }
    scale_weights(result_.function, result_.low, result_.high);
  }

  const Figure& figure_;
  const Skeleton& skeleton_;
  const EngineTeacher& teacher_;
  const CorrectiveFrames& frames_;
  CorrectiveFitOptions options_;
  FittedCorrectives result_;
  std::vector<Eigen::VectorXf> inputs_, weights_;  // of all samples
  std::vector<std::int64_t> held_out_;
};

}  // namespace

CorrectiveFunction unfitted_function(const Figure& figure, int past_frames, double frames_per_second) {
  CorrectiveFunction function;
  for (std::size_t b = 0; b < figure.nodes.size(); ++b) {
    const int parent = figure.nodes[b].parent;
    const Eigen::Affine3d local = parent < 0 ? figure.rest[b] : figure.rest[as_size(parent)].inverse() * figure.rest[b];
    function.parents.push_back(parent);
    function.rest.push_back(Eigen::Quaterniond(local.linear()).normalized());
  }
  for (const int pose : seen_poses(past_frames)) function.lags.push_back(pose / frames_per_second);
  return function;
}

Eigen::VectorXf inputs_of_window(const CorrectiveFunction& function, const Figure& figure, const Skeleton& skeleton,
                                 const std::vector<std::vector<double>>& window) {
  const int past_frames = static_cast<int>(window.size()) - 1;
  std::vector<std::vector<Eigen::Affine3d>> poses{pose_nodes(figure, skeleton, window.back())};
  for (const int pose : seen_poses(past_frames))
    poses.push_back(pose_nodes(figure, skeleton, window[as_size(past_frames - pose)]));
  return function.inputs(poses);
}

FittedCorrectives fit_correctives(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                                  const EngineTeacher& teacher, const CorrectiveFrames& frames,
                                  const CorrectiveFitOptions& options) {
  return CorrectiveFit(figure, skeleton, function, teacher, frames, options).fitted();
}

}  // namespace doppel
