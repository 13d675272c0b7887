#pragma once

#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/glb_compression.h"

namespace doppel {

/// A figure and its animation with the numbers that a compressed .glb states.
struct CompressedFigure {
  Figure figure;
  MorphTargets morphs;
  FigureTracks tracks;
  GlbSteps steps;     ///< of the file
  FigureError error;  ///< distance of the vertices from those without compression, over all frames, mm
};

/// Rounds a figure to the steps of a file. The step of the displacements is the largest power of two from 1/4096 m to
/// 1/131072 m with which no vertex is more than 0.1 mm away from where it was, or else the smallest. That of the
/// positions is a quarter of it, because all displacements add to them.
CompressedFigure compress_figure(const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks);

}  // namespace doppel
