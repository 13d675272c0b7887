#pragma once

#include <memory>
#include <span>
#include <vector>

#include "doppel/actor/export/correctives/helper_skin.h"
#include "doppel/io/figure_export/figure.h"

namespace doppel {

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

/// [B] M of bones: from where they are at rest to where they are. @param posed [B] node to world
std::vector<Eigen::Affine3d> moved_from_rest(const Figure& figure, const std::vector<Eigen::Affine3d>& posed);

/// [3, V] of [3V]
Eigen::Matrix3Xd vertex_columns(std::span<const float> vertices);

}  // namespace doppel
