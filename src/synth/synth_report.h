#pragma once

#include <string>

#include "doppel/synth/film.h"

namespace doppel::synth {

/// Statistics of the synthetic capture, for the summary.
struct SynthReport {
  int vertices = 0, faces = 0, nodes = 0, dofs = 0;
  int frames = 0, test_frames = 0;                         ///< those of clips included
  int takes = 0;                                           ///< of the training sequence
  double mean_displacement = 0, largest_displacement = 0;  ///< from the skinned template, metres, over clothes
  double skinning_iou = 0;  ///< of the skinned template's silhouette, mean over test frames and cameras
};

/// Measures a sequence, at most 100 frames of it in equal distances. @return without the numbers of frames and takes
SynthReport measure_capture(const CaptureSet& set, const std::string& sequence);

}  // namespace doppel::synth
