#pragma once

#include <algorithm>

namespace doppel {

/// A person's stature by two lengths: from hip over knee to ankle, and from the middle of the hips to that of the
/// shoulders. Detectors and rigs put the hips at different heights, which hardly changes the sum of both lengths: 0.755
/// of the stature. @param leg, trunk in any unit; 0: not known @return in the same unit; 0 when neither is known
inline double stature_by(double leg, double trunk) {
  constexpr double kLegAndTrunkShare = 0.755, kLegShare = 0.475, kTrunkShare = 0.28;
  if (leg > 0.0 && trunk > 0.0) return (leg + trunk) / kLegAndTrunkShare;
  return leg > 0.0 ? leg / kLegShare : std::max(0.0, trunk / kTrunkShare);
}

}  // namespace doppel
