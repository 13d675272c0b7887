#include "doppel/actor/export/correctives/corrective_shapes.h"

#include <fmt/format.h>

namespace doppel {

MorphTargets corrective_targets(const LinearShapes& shapes, const Eigen::VectorXf& low, const Eigen::VectorXf& high) {
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
