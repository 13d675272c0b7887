#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/export/actor_file.h"

namespace doppel {

/// One frame of an animation.
struct PosedFrame {
  const float* vertices = nullptr;  ///< [N,3], world metres
  torch::Tensor window;             ///< float32 [F+1,D], oldest first: what the actor was given
};

/// Takes the posed surface frame by frame and puts it into files that other programs read.
class SequenceWriter {
 public:
  virtual ~SequenceWriter() = default;
  /// Frames come in order 0, 1, 2, ...
  virtual void write(const PosedFrame& frame) = 0;
  /// Completes the files. Nothing half-written is left where `close` was not reached.
  virtual void close() = 0;
};

/// `folder/vertices.npy`, float32 [frames, N, 3], world metres.
std::unique_ptr<SequenceWriter> make_npy_writer(const std::filesystem::path& folder, int num_vertices);
/// `folder/frame_000000.obj`, ... with one shared material and texture `<name>.mtl`, `<name>.png`; metres.
std::unique_ptr<SequenceWriter> make_obj_writer(const std::filesystem::path& folder, const Character& character);

/// The rows [frame - F, frame] of a motion as one window, oldest first; the first frame repeats where history is
/// missing.
/// @param past_frames F @return [F+1, D] float32
torch::Tensor motion_window(const Motion& motion, int frame, int past_frames);

/// Poses every frame of `motion` by a function of windows of F + 1 frames and hands it to each of `writers`, then
/// closes them.
/// @param past_frames F @throws Error when motion and character do not belong together, or a position is not finite
void animate(const Character& character, const Motion& motion, int past_frames, const ActorFunction& geometry,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers);

/// Poses every frame of `motion` and hands it to each of `writers`, then closes them.
/// @param actor the trained model, or null for pure (per-vertex dual-quaternion) skinning
/// @throws Error when the motion, the character and the actor do not belong together
void animate(const Character& character, const Motion& motion, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers);

}  // namespace doppel
