#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/export/actor_file.h"

namespace doppel {

/// Takes the posed surface frame by frame and puts it into files that other programs read.
class SequenceWriter {
 public:
  virtual ~SequenceWriter() = default;
  /// @param vertices [N,3] float32, world metres; frames come in order 0, 1, 2, ...
  virtual void write(const float* vertices) = 0;
  /// Completes the files. Nothing half-written is left where `close` was not reached.
  virtual void close() = 0;
};

/// `folder/vertices.npy`, float32 [frames, N, 3], world metres.
std::unique_ptr<SequenceWriter> make_npy_writer(const std::filesystem::path& folder, int num_vertices);
/// `folder/frame_000000.obj`, ... with one shared material and texture `<name>.mtl`, `<name>.png`; metres.
std::unique_ptr<SequenceWriter> make_obj_writer(const std::filesystem::path& folder, const Character& character);

struct TurntableOptions {
  int size = 512;  ///< pixels, square
  double frames_per_second = 25.0;
  double turns_per_second = 0.1;  ///< of the camera around the actor; 0: a still camera in front
};
/// `folder/turntable.mp4`: the textured surface under a soft light, from a camera that circles it and follows its root.
std::unique_ptr<SequenceWriter> make_video_writer(const std::filesystem::path& folder, const Character& character,
                                                  const TurntableOptions& options);

/// The rows [frame - F, frame] of a motion as one window, oldest first; the first frame repeats where history is
/// missing.
/// @return [F+1, D] float32
torch::Tensor motion_window(const Motion& motion, int frame, int window);

/// Poses every frame of `motion` and hands it to each of `writers`, then closes them.
/// @param actor the trained model, or null for pure (per-vertex dual-quaternion) skinning
/// @throws Error when the motion, the character and the actor do not belong together
void animate(const Character& character, const Motion& motion, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers);

}  // namespace doppel
