#pragma once

#include "doppel/actor/export/correctives/engine_teacher.h"
#include "doppel/actor/export/correctives/helper_figure.h"
#include "doppel/actor/export/correctives/helper_joints.h"
#include "doppel/actor/export/correctives/weight_fit.h"

namespace doppel {

struct HelperFitOptions {
  HelperOptions joints;
  int windows = 6000;  ///< that are drawn
  WeightFitOptions weights;
};

/// Helpers, and the function of their transforms.
struct FittedHelpers {
  HelperFigure figure;
  HelperFunction function;
};

/// The helpers are those of at most 256 of the fitted frames and of 256 drawn windows (find_helpers). The function is
/// fitted as that of correctives is, to the transforms that bring the surface nearest to the actor: to at most 48
/// principal components of them, whose errors count as far as they move vertices. Memory while helpers are found: about
/// 12 kB a vertex, and 32 bytes a vertex and joint.
/// @param function unfitted_function of the figure
FittedHelpers fit_helpers(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                          const EngineTeacher& teacher, const EngineFrames& frames, const HelperFitOptions& options);

}  // namespace doppel
