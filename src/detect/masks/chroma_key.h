#pragma once

#include <vector>

namespace doppel {

/// Chroma keying for a uniformly coloured studio without masks. A pixel is background when its chroma is near that of
/// the key. The key is either one colour or the image of the empty studio.
struct ChromaKey {
  enum class Space { hsv, ycrcb };
  Space space = Space::ycrcb;
  bool against_background = false;      ///< compare with the image `Capture::background` pixel by pixel
  std::vector<int> colour{0, 177, 64};  ///< R G B of the studio, used unless against_background
  /// hsv: degrees of hue (0..180); ycrcb: distance in the (Cr, Cb) plane at the key's brightness (0..181).
  double tolerance = 20.0;
  double min_saturation = 0.25;  ///< hsv only: a background pixel is at least this saturated, 0..1
  int smooth = 3;                ///< diameter of the median filter on the result, odd; 1 = none
};

}  // namespace doppel
