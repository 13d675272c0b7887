#include "animate_rates.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/log.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/io/rig_import/motions_json.h"

namespace doppel::tools {
namespace {

/// The rate that `--source-fps`, or for a `.motion` the list of imported motions, states; 0: none.
double stated_rate(const std::string& motion, double source_fps) {
  if (source_fps > 0) return source_fps;
  return is_foreign_motion(motion) ? 0.0 : imported_rate(motion).value_or(0.0);
}

}  // namespace

Rates rates_of(const std::string& motion, const StatedRates& stated) {
  Rates rates;
  rates.source = stated_rate(motion, stated.source);
  rates.training = stated.training.value_or(0.0);
  rates.result = stated.result > 0 ? stated.result : rates.training;
  if (rates.source > 0 || is_foreign_motion(motion)) return rates;
  rates.source = rates.training;
  if (stated.result > 0 && stated.training)
    log::info("{}: its rows are taken as {:g} frames a second, as in the training; --source-fps states another rate",
              motion, *stated.training);
  else if (stated.result > 0)
    log::warn(
        "{} states no rate, so its rows are taken as {:g} frames a second: --fps alters the speed of the motion; "
        "--source-fps states the rate of the rows, and the motion is resampled",
        motion, stated.result);
  return rates;
}

double reading_rate(const Rates& rates) {
  constexpr double kFiner = 4.0, kMaxRate = 1000.0;
  const double poses = rates.training > 0 ? rates.result / rates.training : 1.0;
  if (poses >= 1.0 && std::abs(poses - std::round(poses)) < 1e-6) return rates.result;
  const double wanted = std::ceil(kFiner / poses - 1e-6), possible = std::floor(kMaxRate / rates.result);
  return rates.result * std::max(1.0, std::min(wanted, possible));
}

FrameSteps frame_steps(const Rates& rates, double motion, double result) {
  return {motion / result, rates.training > 0 ? motion / rates.training : 1.0};
}

double row_step(const Rates& rates, double result) { return rates.source > 0 ? rates.source / result : 1.0; }

int blended_frames(int frames, double fps, int stride) {
  const int usual = std::max(1, std::min(static_cast<int>(std::lround(0.5 * fps)), frames / 4));
  int kept = (frames - usual) / stride * stride;
  if (2 * kept <= frames && kept + stride < frames) kept += stride;
  return frames - kept;
}

}  // namespace doppel::tools
