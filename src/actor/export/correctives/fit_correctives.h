#pragma once

#include <vector>

#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/correctives/corrective_shapes.h"
#include "doppel/actor/export/correctives/weight_fit.h"
#include "doppel/actor/export/correctives/window_mixer.h"
#include "doppel/io/figure_export/corrective_function.h"

namespace doppel {

/// What correctives are fitted to: an actor, and motions to ask it about.
struct EngineTeacher {
  ActorFunction geometry;             ///< motion windows [B,F+1,D] -> vertices [B,N,3], world metres
  int past_frames = 2;                ///< F
  double frames_per_second = 25.0;    ///< of the poses in a window
  std::vector<WindowSource> motions;  ///< from which windows are drawn
};

enum class FrameUse { fitted, held_out, unseen };

/// Frames whose vertices are known.
struct CorrectiveFrames {
  FigureClip clip;
  std::vector<Eigen::VectorXf> inputs;  ///< [T] of the function
  std::vector<FrameUse> use;            ///< [T]
};

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

/// A function of the bones of a figure without numbers: parents, rotations at rest, and as lags the poses 1, 2, 4, ...
/// and F of a window before its last.
CorrectiveFunction unfitted_function(const Figure& figure, int past_frames, double frames_per_second);

/// The inputs of a function for a motion window. @param window [F + 1][D], oldest first
Eigen::VectorXf inputs_of_window(const CorrectiveFunction& function, const Figure& figure, const Skeleton& skeleton,
                                 const std::vector<std::vector<double>>& window);

/// The shapes are those of at most 256 of the fitted frames and of 256 drawn windows. The function is fitted to the
/// fitted frames and all drawn windows; frames that are held out, and every tenth window, choose ridge and end of the
/// fit.
/// @param function unfitted_function of the figure
FittedCorrectives fit_correctives(const Figure& figure, const Skeleton& skeleton, const CorrectiveFunction& function,
                                  const EngineTeacher& teacher, const CorrectiveFrames& frames,
                                  const CorrectiveFitOptions& options);

}  // namespace doppel
