#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "doppel/actor/export/animation.h"
#include "doppel/io/figure_export/figure.h"
#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/write_figure.h"

namespace doppel {

/// How an animated figure is written for other programs.
struct FigureOptions {
  bool glb = false, usda = false, fbx = false, pc2 = false, mdd = false;  ///< the files to write
  double frames_per_second = 25.0;
  BoneNames names = BoneNames::skeletool;
  std::optional<int> morphs;  ///< of files with a skin: as for fit_morphs
  FigureRights rights;        ///< of the .glb
  double tolerance = 1e-4;    ///< of files with a skin: error of interpolated keys, metres
  /// Of the .glb: several animations in one file, which share skin and morph targets. Empty: one animation. Other files
  /// hold all frames one after the other.
  std::vector<ClipPart> parts;
  bool compress = false;  ///< the .glb by EXT_meshopt_compression
  FileSpace space;        ///< of .pc2, .mdd and animation.obj; the other formats state their unit and axis
};

/// What was lost on the way into the files with a skin.
struct FigureReport {
  int nodes = 0, morphs = 0;
  int morphs_at_once = 0;                            ///< that move in a frame, at most
  bool morphs_exhausted = false;                     ///< MorphTargets::exhausted
  std::size_t keys = 0;                              ///< of all channels
  double mean_error_mm = 0.0, worst_error_mm = 0.0;  ///< of the vertices, over all frames
  double largest_dropped_weight = 0.0;               ///< of a vertex with more than four bones
  /// Of a compressed .glb: distance of the vertices from where they are without compression, in all frames.
  std::optional<FigureError> compression;
};

/// Appends the pose and the vertices of a frame to a clip.
void append_frame(FigureClip& clip, const PosedFrame& frame);

/// `folder/animation.glb`, `.fbx`, `.usda` and `animation_skel.usda` (with their texture `animation.png`), `.pc2` and
/// `.mdd` (with `animation.obj`, whose vertices they move). Holds all frames in memory until `close`, 12 bytes per
/// vertex and frame.
/// @param report filled by `close` where files with a skin are asked for; must outlive the writer
/// @param fbx_report the same of the .fbx, whose rotations have other keys; must outlive the writer
std::unique_ptr<SequenceWriter> make_figure_writer(const std::filesystem::path& folder, const Character& character,
                                                   const FigureOptions& options, FigureReport& report,
                                                   FigureReport& fbx_report);

}  // namespace doppel
