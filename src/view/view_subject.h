#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/script_file.h"
#include "doppel/character/character.h"
#include "doppel/character/motion.h"
#include "doppel/view/view_cameras.h"
#include "doppel/view/view_sequence.h"

namespace doppel {

/// One way to make a surface from poses. The weights of its networks require no gradients.
struct ViewStage {
  std::string name;        ///< skinning, egnet, deltanet, actor, textured or gaussians
  int past_frames = 0;     ///< F of its motion windows
  ActorFunction vertices;  ///< [B,F+1,D] -> [B,N,3], world metres
  /// The dynamic texture: window, projection [B,3,4] (pixels from world metres) and this stage's vertices -> [B,T,T,3]
  /// RGB 0..1, row 0 at v = 1. Empty: the template's texture.
  LookFunction texture = {};
  int texture_size = 0;  ///< T; 0 without `texture`
  /// The Gaussians that are drawn in place of the surface: window, projection and vertices -> rows [B,P,14]
  /// (splat_rows.h). Empty: the surface is drawn.
  LookFunction gaussians = {};
  int num_gaussians = 0;      ///< P; 0 without `gaussians`
  std::string geometry = {};  ///< with `texture` or `gaussians`: the earlier stage that has the same vertices
};

/// What `doppel view` shows: a character, or a sequence of a capture that has none.
struct ViewSubject {
  Character character;                   ///< empty with `sequence`
  Motion motion;                         ///< at least one frame; none with `sequence`
  std::vector<long> cuts;                ///< rows of `motion` that begin a new segment, ascending
  std::optional<ViewSequence> sequence;  ///< shown instead of a character; `cameras` filmed it, and there is no stage
  double frames_per_second = 25.0;
  std::vector<ViewStage> stages;  ///< the best last
  ScriptModules networks;         ///< of a run's stages, alive with them; none: others
  /// The cameras that filmed `motion`, frame i at row i; null: a motion from elsewhere, or no images
  std::shared_ptr<ViewCameras> cameras;
  std::filesystem::path run;  ///< whose training is shown; empty: none
};

struct ViewOptions {
  std::filesystem::path motion;     ///< empty: that of the capture, or the rest pose
  std::filesystem::path character;  ///< for an actor file
  std::filesystem::path capture;    ///< for a run whose prepared capture was moved; empty: that of the run
  bool geometry_only = false;       ///< for a run: without TexNet
};

/// Opens a run of egnet or ddc (before its first checkpoint, its character is shown), of posenet or deepcap (its
/// character and its capture are shown), an exported actor (`.pt`, with
/// options.character), a `.character` file, a capture (a `capture.yaml`, its folder, or a folder that
/// recognise_capture knows) or a prepared capture. Of a capture without a character, a sequence with videos is shown.
/// @throws UsageError for another target, for an actor file without a character, and for options that the target does
/// not have; Error for a capture that has neither a character nor videos, and for options.motion without a character;
/// Error as the readers
ViewSubject open_view_subject(const std::filesystem::path& target, const ViewOptions& options = {});

/// A motion for the subject's character at its frame rate, from every kind of file that `doppel animate --motion`
/// takes. @pre the subject has a character
/// @throws Error as the readers
Motion motion_for(const ViewSubject& subject, const std::filesystem::path& file);

}  // namespace doppel
