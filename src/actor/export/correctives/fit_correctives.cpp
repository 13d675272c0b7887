#include "doppel/actor/export/correctives/fit_correctives.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {
namespace {

constexpr std::size_t kShapeColumns = 256;

class CorrectiveFit {
 public:
  CorrectiveFit(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                const EngineTeacher& teacher, const EngineFrames& frames, const CorrectiveFitOptions& options)
      : figure_(figure), skeleton_(skeleton), teacher_(teacher), frames_(frames), options_(options) {
    result_.function = function;
  }

  FittedCorrectives fitted() {
    const std::vector<WindowRows> windows = draw_windows(teacher_, skeleton_, options_.windows, options_.weights.seed);
    find_shapes({windows.data(), std::min(kShapeColumns, windows.size())});
    const SampleList samples = ask_for_samples(teacher_, windows, frames_, result_.function, figure_, skeleton_,
                                               [&](const std::vector<double>& dofs, std::span<const float> vertices) {
                                                 return result_.shapes.weights_of(displacement(dofs, vertices));
                                               });
    fit_weights(samples.tensors(), options_.weights, result_.function);
    result_.low = samples.low();
    result_.high = samples.high();
    scale_weights(result_.function, result_.low, result_.high);
    return std::move(result_);
  }

 private:
  Eigen::VectorXf displacement(const std::vector<double>& dofs, std::span<const float> vertices) const {
    return unposed_displacements(figure_, blend_transforms(figure_, pose_nodes(figure_, skeleton_, dofs)), vertices);
  }

  void find_shapes(std::span<const WindowRows> drawn) {
    const std::vector<std::size_t> used = frames_.fitted(kShapeColumns);
    Eigen::MatrixXf columns(3 * static_cast<Eigen::Index>(figure_.node.size()),
                            static_cast<Eigen::Index>(used.size() + drawn.size()));
    for (std::size_t i = 0; i < used.size(); ++i)
      columns.col(static_cast<Eigen::Index>(i)) =
          displacement(frames_.clip.dofs[used[i]], frames_.clip.vertices[used[i]]);
    ask_actor(teacher_, drawn, "finding shapes", [&](std::size_t i, std::span<const float> vertices) {
      columns.col(static_cast<Eigen::Index>(used.size() + i)) = displacement(drawn[i].back(), vertices);
    });
    result_.shapes = linear_shapes(std::move(columns), options_.shapes);
    if (result_.shapes.components.cols() == 0)
      fail(
          "fitting correctives: the surface of the actor is its skin in every pose, so there is nothing to correct; "
          "--format glb holds it");
  }

  const Figure& figure_;
  const Skeleton& skeleton_;
  const EngineTeacher& teacher_;
  const EngineFrames& frames_;
  CorrectiveFitOptions options_;
  FittedCorrectives result_;
};

}  // namespace

FittedCorrectives fit_correctives(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                                  const EngineTeacher& teacher, const EngineFrames& frames,
                                  const CorrectiveFitOptions& options) {
  return CorrectiveFit(figure, skeleton, function, teacher, frames, options).fitted();
}

}  // namespace doppel
