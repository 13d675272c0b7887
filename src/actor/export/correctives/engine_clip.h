#pragma once

/// An actor without networks, in one .glb for engines: its skin, corrective shapes or helper joints, and a function of
/// the bones that moves them.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/correctives/engine_teacher.h"
#include "doppel/actor/export/figure_writer.h"

namespace doppel {

struct EngineClipOptions {
  double frames_per_second = 25.0;
  BoneNames names = BoneNames::skeletool;
  double tolerance = 1e-4;      ///< error of interpolated keys, metres
  std::vector<ClipPart> parts;  ///< one for each clip
  std::vector<bool> unseen;     ///< [clips] it is written and measured, but not fitted
  int shapes = 32;              ///< K, of which the first always has weight 1
  int helpers = 0;              ///< N helper joints in the place of the shapes; 0: shapes
  int windows = 6000;           ///< motion windows that are drawn from the teacher's motions: memory for each, while
                                ///< the function is fitted, is about 20 bytes per input
  bool compress = false;        ///< by EXT_meshopt_compression
};

/// Mean distances of the vertices from those of the actor over frames of a clip, millimetres.
struct EngineClipError {
  std::string name;
  bool unseen = false;
  int frames = 0;         ///< that were measured; 0 for a fitted clip of fewer than two frames, whose errors are 0
  double skinning = 0.0;  ///< of the template, skinned with the weights of a file without correctives
  double function = 0.0;  ///< with the shapes or helpers as the function moves them
  double best = 0.0;      ///< with nearly the best weights for the same shapes; with the keys of helpers

  /// What a distance is of that of skinning.
  double share(double distance) const { return skinning > 0.0 ? distance / skinning : 0.0; }
};

struct EngineClipReport {
  FigureReport figure;  ///< its errors are distances from the actor, over the frames of all clips
  int inputs = 0, hidden = 0;
  double history = 0.0;  ///< seconds that the function looks back
  int helpers = 0;       ///< 0: the file has corrective shapes
  /// Of a clip that is fitted: its last fifth. It chooses the ridge and the end of the fit, so its errors are somewhat
  /// too small; those of unseen clips are not.
  std::vector<EngineClipError> clips;
};

/// The part of a clip that is fitted, from its first frame: the rest is held out.
int fitted_frames(int frames);

/// `folder/engine.glb`: as `write_glb`, with K morph targets or N helper joints.
///
/// The morph targets are `Corrective_Base` with weight 1, and `Corrective_1`, ... whose weights are the function in
/// `extras` (CorrectiveFunction). The animations of the clips hold these weights too, for programs that do not know the
/// function. The shapes are the mean and the principal components of what the actor's surface has beyond the skin, in
/// the rest pose.
///
/// With helper joints `Helper_1`, ... (fit_helpers.h) there are no morph targets, and weights and rest vertices are
/// those of the helpers. The animations hold the helpers where they bring the surface nearest to the actor. For other
/// motions, `extras` has the function that gives their transforms (HelperFunction); without it they stand at their
/// mean.
///
/// The functions are fitted to the clips and to windows drawn from `teacher.motions`. Holds all frames in memory until
/// `close`, 12 bytes per vertex and frame.
/// @param teacher its motions should be those of fitted clips up to `fitted_frames`, and others
/// @param report filled by `close`; must outlive the writer, as must the character
/// @throws UsageError when K is not 2 to 256 or N not 1 to 256, names do not fit the bones, or the motions have fewer
/// than three poses for each shape or helper
std::unique_ptr<SequenceWriter> make_engine_clip_writer(const std::filesystem::path& folder, const Character& character,
                                                        EngineTeacher teacher, const EngineClipOptions& options,
                                                        EngineClipReport& report);

}  // namespace doppel
