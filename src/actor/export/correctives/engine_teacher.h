#pragma once

/// An actor that is asked about motions: what the fits for engines share.

#include <functional>
#include <span>
#include <vector>

#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/correctives/weight_fit.h"
#include "doppel/actor/export/correctives/window_mixer.h"
#include "doppel/io/figure_export/corrective_function.h"
#include "doppel/io/figure_export/figure_clip.h"

namespace doppel {

/// What correctives and helpers are fitted to: an actor, and motions to ask it about.
struct EngineTeacher {
  ActorFunction geometry;             ///< motion windows [B,F+1,D] -> vertices [B,N,3], world metres
  int past_frames = 2;                ///< F
  double frames_per_second = 25.0;    ///< of the poses in a window
  std::vector<WindowSource> motions;  ///< from which windows are drawn
};

enum class FrameUse { fitted, held_out, unseen };

/// Frames whose vertices are known.
struct EngineFrames {
  FigureClip clip;
  std::vector<Eigen::VectorXf> inputs;  ///< [T] of the function
  std::vector<FrameUse> use;            ///< [T]

  /// At most `count` of the frames that are fitted, spread evenly.
  std::vector<std::size_t> fitted(std::size_t count) const;
};

/// A motion window [F + 1][D], oldest first.
using WindowRows = std::vector<std::vector<double>>;

std::vector<WindowRows> draw_windows(const EngineTeacher& teacher, const Skeleton& skeleton, int count,
                                     std::uint64_t seed);

/// Asks the actor about windows, some at a time. @param use called for each window in order, with its vertices [3N]
/// @param title of the progress bar @throws Error when the user asks to stop
void ask_actor(const EngineTeacher& teacher, std::span<const WindowRows> windows, const char* title,
               const std::function<void(std::size_t window, std::span<const float> vertices)>& use);

/// A function of the bones of a figure without numbers: parents, rotations at rest, and as lags the poses 1, 2, 4, ...
/// and F of a window before its last.
CorrectiveFunction unfitted_function(const Figure& figure, int past_frames, double frames_per_second);

/// The inputs of a function for a motion window.
Eigen::VectorXf inputs_of_window(const CorrectiveFunction& function, const Figure& figure, const Skeleton& skeleton,
                                 const WindowRows& window);

/// Samples of a function of the bones: the windows, of which every tenth is held out, and the frames that are not
/// unseen.
/// @param weights_of [K] weights for a pose and the actor's vertices [3V]
SampleList ask_for_samples(
    const EngineTeacher& teacher, std::span<const WindowRows> windows, const EngineFrames& frames,
    const CorrectiveFunction& function, const Figure& figure, const Skeleton& skeleton,
    const std::function<Eigen::VectorXf(const std::vector<double>& dofs, std::span<const float> vertices)>& weights_of);

}  // namespace doppel
