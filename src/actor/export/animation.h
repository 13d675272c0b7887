#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "doppel/actor/export/actor_file.h"
#include "doppel/character/character.h"
#include "doppel/core/profile.h"
#include "doppel/geometry/file_space.h"

namespace doppel {

/// One frame of an animation.
struct PosedFrame {
  std::span<const float> vertices;  ///< [N,3], world metres
  torch::Tensor window;             ///< float32 [F+1,D], oldest first: the actor's input
};

/// The vertices of a frame as a tensor [1,N,3], which shares their memory.
torch::Tensor tensor_of(const PosedFrame& frame);

/// Writes the posed surface frame by frame to files for other programs.
class SequenceWriter {
 public:
  virtual ~SequenceWriter() = default;
  /// Frames come in order 0, 1, 2, ...
  virtual void write(const PosedFrame& frame) = 0;
  /// Completes the files. Without `close`, no partial files are left.
  virtual void close() = 0;
};

/// `folder/vertices.npy`, float32 [frames, N, 3], world metres.
std::unique_ptr<SequenceWriter> make_npy_writer(const std::filesystem::path& folder, int num_vertices);
/// `folder/frame_000000.obj`, ... with one shared material and texture `<name>.mtl`, `<name>.png`.
std::unique_ptr<SequenceWriter> make_obj_writer(const std::filesystem::path& folder, const Character& character,
                                                const FileSpace& space = {});

/// When the frames of an animation and the poses of their motion windows are, in frames of the motion.
struct FrameSteps {
  double frame = 1.0;   ///< between two frames: the rate of the motion by that of the animation
  double window = 1.0;  ///< between two poses of a window: the rate of the motion by that of the actor's training
};

/// One of the motions that are posed one after the other.
struct MotionPart {
  const Motion& motion;
  FrameSteps steps = {};
  /// The geometry is that of the motion, and then it is moved along the ground, so that the root of the skeleton stays
  /// above one point, where it is in the first frame. The windows that writers get are those of the moved motion.
  bool in_place = false;
};

/// Warns when an actor was exported with another version of the character.
/// @throws UsageError when the numbers of DoFs or vertices differ
void check_belongs_together(const Character& character, const ActorFile& actor);

/// The motion window of a frame: rows [frame - F, frame] of a motion, oldest first. The first row of the segment is
/// repeated where earlier rows are missing.
/// @param past_frames F @param cuts rows that begin a new segment, ascending @return [F+1, D] float32
torch::Tensor motion_window(const Motion& motion, int frame, int past_frames, std::span<const long> cuts = {});

/// Poses every frame of an animation by a function of motion windows of F + 1 poses, passes it to each of `writers`,
/// then closes the writers. Poses between frames of `motion` are those of dofs_at. The first frame is that of `motion`;
/// before it the motion stands still.
/// @param past_frames F @param profile the time of `geometry` is added to it
/// @throws Error when motion and character do not belong together, or a position is not finite
void animate(const Character& character, const Motion& motion, int past_frames, const ActorFunction& geometry,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile = nullptr,
             const FrameSteps& steps = {});

/// Poses every frame of an animation as above, passes it to each of `writers`, then closes the writers.
/// @param actor the trained actor, or null for skinning alone, in the mode of the character
/// @throws Error when the motion, the character and the actor do not belong together
void animate(const Character& character, const Motion& motion, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile = nullptr,
             const FrameSteps& steps = {});

/// The same for several motions one after the other, which know nothing of each other: the writers get the frames of
/// all, then they are closed.
void animate(const Character& character, std::span<const MotionPart> parts, int past_frames,
             const ActorFunction& geometry, const std::vector<std::unique_ptr<SequenceWriter>>& writers,
             Profile* profile = nullptr);
void animate(const Character& character, std::span<const MotionPart> parts, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile = nullptr);

}  // namespace doppel
