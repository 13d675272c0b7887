#include "doppel/actor/export/correctives/corrective_shapes.h"

#include <fmt/format.h>

#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {
namespace {

Eigen::MatrixX3f target_rows(const Eigen::VectorXf& values) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(values.data(), values.size() / 3, 3);
}

}  // namespace

CorrectiveShapes corrective_shapes(Eigen::MatrixXf displacements, int count) {
  CorrectiveShapes shapes;
  shapes.mean = displacements.rowwise().mean();
  displacements.colwise() -= shapes.mean;
  shapes.components = principal_components(displacements, count);
  return shapes;
}

MorphTargets corrective_targets(const CorrectiveShapes& shapes, const Eigen::VectorXf& low,
                                const Eigen::VectorXf& high) {
  MorphTargets morphs;
  morphs.targets.push_back(target_rows(shapes.mean + shapes.components * low));
  morphs.names.emplace_back("Corrective_Base");
  for (Eigen::Index k = 0; k < shapes.components.cols(); ++k) {
    morphs.targets.push_back(target_rows((high(k) - low(k)) * shapes.components.col(k)));
    morphs.names.push_back(fmt::format("Corrective_{}", k + 1));
  }
  morphs.at_once = morphs.count();
  return morphs;
}

}  // namespace doppel
