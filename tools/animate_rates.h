#pragma once

#include <optional>
#include <string>

#include "doppel/actor/export/animation.h"

namespace doppel::tools {

/// The rates of an animation, frames per second.
struct Rates {
  double source = 0.0;    ///< of the rows of a `.motion`, which the file does not state; 0: unknown
  double training = 0.0;  ///< of the actor; 0: skinning alone has none
  double result = 0.0;    ///< 0: that of the motion's file
};

/// What a call states about rates, frames per second.
struct StatedRates {
  double source = 0.0;             ///< --source-fps; 0: not stated
  double result = 0.0;             ///< --fps; 0: not stated
  std::optional<double> training;  ///< of the actor; nothing: skinning alone
};

/// The rates of an animation. The rows of a `.motion` have the stated rate, else that of their import, else that of the
/// training, which is logged; if none is known, `--fps` alters the speed of the motion, which is a warning.
Rates rates_of(const std::string& motion, const StatedRates& stated);

/// The rate at which a motion is retargeted, or looped. Windows hold poses at the rate of the training. If this does
/// not divide the rate of the result, they are interpolated between frames that are at most a quarter as far apart.
/// @return a multiple of the rate of the result, at most 1000 where the result allows; 0: that of the motion's file
double reading_rate(const Rates& rates);

/// @param motion, result frames per second of the motion that was read and of the animation
FrameSteps frame_steps(const Rates& rates, double motion, double result);

/// From one frame of the animation to the next, in rows of a `.motion`. Rows of an unknown rate are the frames.
/// @param result frames per second of the animation
double row_step(const Rates& rates, double result);

/// How many frames of a motion a loop blends (loop_motion): half a second, but at most a quarter of the motion, and so
/// many more or fewer that the frames which stay are a multiple of `stride`. Then the step from the last frame of the
/// animation to the first is as long as the others. A motion with fewer than 3 * stride frames may have no such number;
/// loop_motion refuses the result.
/// @param frames of the motion @param fps its frames per second @param stride its frames from one of the animation to
/// the next
int blended_frames(int frames, double fps, int stride);

}  // namespace doppel::tools
