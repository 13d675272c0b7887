#pragma once

#include "doppel/actor/export/correctives/corrective_shapes.h"
#include "doppel/actor/export/correctives/engine_teacher.h"
#include "doppel/actor/export/correctives/weight_fit.h"

namespace doppel {

struct CorrectiveFitOptions {
  int shapes = 31;     ///< largest number of components
  int windows = 6000;  ///< that are drawn
  WeightFitOptions weights;
};

/// Shapes, and the function of their weights.
struct FittedCorrectives {
  LinearShapes shapes;
  CorrectiveFunction function;  ///< its weights are 0 to 1
  Eigen::VectorXf low, high;    ///< [K] metres: the weights of the components that 0 and 1 stand for
};

/// The shapes are those of at most 256 of the fitted frames and of 256 drawn windows. The function is fitted to the
/// fitted frames and all drawn windows; frames that are held out, and every tenth window, choose ridge and end of the
/// fit.
/// @param function unfitted_function of the figure
FittedCorrectives fit_correctives(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                                  const EngineTeacher& teacher, const EngineFrames& frames,
                                  const CorrectiveFitOptions& options);

}  // namespace doppel
