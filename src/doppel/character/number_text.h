#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "doppel/core/error.h"

/// How this room's writers put numbers into text: the shortest digits that read back as the same double.
namespace doppel {

/// Skeletool files hold millimetres.
constexpr double kMetresPerMillimetre = 0.001;

/// @throws Error for NaN and infinity, which no reader would take back
inline std::string exact_text(double value) {
  if (!std::isfinite(value)) fail("cannot write the number {} to a file; only finite numbers can be read back", value);
  return fmt::format("{}", value);
}

/// The millimetres that the reader's `* 0.001` turns back into exactly these metres, wherever such a double exists
/// (it does for every length that was itself read from a file).
inline std::string millimetre_text(double metres) {
  const double nearest = metres / kMetresPerMillimetre;
  for (const double candidate : {nearest, std::nextafter(nearest, -HUGE_VAL), std::nextafter(nearest, HUGE_VAL)})
    if (candidate * kMetresPerMillimetre == metres) return exact_text(candidate);
  return exact_text(nearest);
}

}  // namespace doppel
