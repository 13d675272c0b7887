#pragma once

#include <memory>

#include "doppel/actor/export/correctives/engine_teacher.h"
#include "doppel/actor/export/correctives/helper_joints.h"
#include "doppel/actor/export/correctives/weight_fit.h"

namespace doppel {

struct HelperFitOptions {
  HelperOptions joints;
  int windows = 6000;  ///< that are drawn
  WeightFitOptions weights;
};

/// A figure with helper joints as its last nodes.
class HelperFigure {
 public:
  /// @param bones the figure without helpers @param skin its helpers, and the rest vertices and weights of the result
  HelperFigure(const Figure& bones, HelperSkin skin);

  /// Rest vertices and weights are those of the skin. The nodes `Helper_1`, ... are children of bones; each rests at
  /// the centre of its vertices, with the rotation that makes its mean rotation relative to its bone the identity.
  const Figure& figure() const { return figure_; }
  /// [B + N] node to world: bones at rest, and helpers at their mean.
  const std::vector<Eigen::Affine3d>& standing() const { return standing_; }

  /// The nodes of helpers under a surface. @param bones [B] node to world @param vertices [3N] @return [B + N]
  std::vector<Eigen::Affine3d> under(const std::vector<Eigen::Affine3d>& bones, std::span<const float> vertices) const;
  /// The helpers relative to their bones: 6 numbers each, translation and rotation vector. @param nodes [B + N]
  Eigen::VectorXf parameters(const std::vector<Eigen::Affine3d>& nodes) const;
  /// The inverse of `parameters`. @param bones [B] @param helpers [N] to their bones @return [B + N] node to world
  std::vector<Eigen::Affine3d> nodes(const std::vector<Eigen::Affine3d>& bones,
                                     const std::vector<Eigen::Affine3d>& helpers) const;
  /// [6N, 6N] inner products of how parameters displace the vertices, at the mean of the helpers.
  Eigen::MatrixXd metric() const;

 private:
  std::size_t parent(std::size_t helper) const { return static_cast<std::size_t>(skin_->parents[helper]); }

  std::unique_ptr<HelperSkin> skin_;  // where the poser finds it
  HelperPoser poser_;
  Figure figure_;
  std::vector<Eigen::Affine3d> standing_;
};

/// Helpers, and the function of their transforms.
struct FittedHelpers {
  HelperFigure figure;
  HelperFunction function;
};

/// The helpers are those of at most 256 of the fitted frames and of 256 drawn windows (find_helpers). The function is
/// fitted as that of correctives is, to the transforms that bring the surface nearest to the actor; its errors count as
/// far as they move vertices. Memory while helpers are found: about 12 kB a vertex, and 32 bytes a vertex and joint.
/// @param function unfitted_function of the figure
FittedHelpers fit_helpers(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                          const EngineTeacher& teacher, const EngineFrames& frames, const HelperFitOptions& options);

}  // namespace doppel
