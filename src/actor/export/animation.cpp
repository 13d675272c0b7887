#include "doppel/actor/export/animation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "doppel/character/resample_motion.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/layers/surface.h"

namespace doppel {
namespace {

constexpr int kFramesAtOnce = 16;

void check_belongs_together(const Character& character, const Motion& motion) {
  if (motion.num_frames() == 0) fail("animating {}: the motion holds no frames", character.name);
  const auto dofs = static_cast<int>(motion.frames.front().size());
  if (dofs != character.num_dofs())
    fail("animating {}: its skeleton has {} DoFs, the motion {}", character.name, character.num_dofs(), dofs);
}

/// @param vertices float32 [frames, N, 3], contiguous
std::span<const float> frame_of(const torch::Tensor& vertices, int frame) {
  const auto size = vertices.size(1) * vertices.size(2);
  return {vertices.data_ptr<float>() + frame * size, as_size(size)};
}

float* append_row(const std::vector<double>& row, float* out) {
  return std::transform(row.begin(), row.end(), out, [](double v) { return static_cast<float>(v); });
}

/// The motion windows of an animation.
class Windows {
 public:
  Windows(const Character& character, const Motion& motion, int past_frames, const FrameSteps& steps)
      : motion_(motion), turns_(full_turns(character.skeleton)), past_frames_(past_frames), steps_(steps) {
    if (!(steps.frame > 0.0) || !(steps.window > 0.0))
      fail("animating {}: frames {} and poses of a window {} frames of the motion apart; both must be positive",
           character.name, steps.frame, steps.window);
  }

  int count() const {
    // The margin keeps the last frame where a rate is no exact number.
    return static_cast<int>(std::floor((motion_.num_frames() - 1) / steps_.frame + 1e-6)) + 1;
  }

  /// @return [F+1,D] float32
  torch::Tensor at(int frame) const {
    torch::Tensor rows = torch::empty({past_frames_ + 1, static_cast<std::int64_t>(turns_.size())});
    float* out = rows.data_ptr<float>();
    for (int i = past_frames_; i >= 0; --i)
      out = append_row(dofs_at(motion_, turns_, frame * steps_.frame - i * steps_.window), out);
    return rows;
  }

 private:
  const Motion& motion_;
  std::vector<double> turns_;
  int past_frames_;
  FrameSteps steps_;
};

/// Keeps the root of frames above one point of the ground.
class HeldRoot {
 public:
  /// @param first the window of the first frame
  HeldRoot(const Skeleton& skeleton, const torch::Tensor& first) : root_(skeleton.root()), first_(last_row(first)) {}

  /// @param vertices [N,3] @param window [F+1,D]; both are changed
  void hold(const torch::Tensor& vertices, const torch::Tensor& window) const {
    const torch::Tensor now = last_row(window);
    for (const int axis : {0, 2}) {
      const int dof = root_.translation[axis];
      const double way = now[dof].item<double>() - first_[dof].item<double>();
      window.select(1, dof) -= way;
      vertices.select(1, axis) -= root_.translation_weight[axis] * way;
    }
  }

 private:
  static torch::Tensor last_row(const torch::Tensor& window) { return window[window.size(0) - 1].clone(); }

  Skeleton::Root root_;
  torch::Tensor first_;
};

/// Poses the frames of one motion and passes them to the writers. @param held nothing: the root travels
void pose_frames(const Character& character, const Windows& window, const std::optional<HeldRoot>& held,
                 const ActorFunction& geometry, const std::vector<std::unique_ptr<SequenceWriter>>& writers,
                 Profile& profile, Progress& progress) {
  const int frames = window.count();
  for (int first = 0; first < frames; first += kFramesAtOnce) {
    if (stop_requested()) fail("animating {}: stopped at frame {} of {}", character.name, first, frames);
    const int last = std::min(first + kFramesAtOnce, frames);
    std::vector<torch::Tensor> windows;
    for (int f = first; f < last; ++f) windows.push_back(window.at(f));
    torch::Tensor vertices;
    {
      const ProfileScope scope(profile, "geometry");
      vertices = geometry(torch::stack(windows)).contiguous();
    }
    if (!torch::isfinite(vertices).all().item<bool>())
      fail("animating {}: frame {} or one of the next {} has positions that are not finite", character.name, first,
           last - first - 1);
    for (int f = first; held && f < last; ++f) held->hold(vertices[f - first], windows[f - first]);
    for (int f = first; f < last; ++f)
      for (const auto& writer : writers) writer->write({frame_of(vertices, f - first), windows[f - first]});
    progress.advance(last - first);
  }
}

}  // namespace

torch::Tensor tensor_of(const PosedFrame& frame) {
  return torch::from_blob(const_cast<float*>(frame.vertices.data()),
                          {1, static_cast<std::int64_t>(frame.vertices.size() / 3), 3});
}

void check_belongs_together(const Character& character, const ActorFile& actor) {
  const int dofs = character.num_dofs();
  const ActorDescription& d = actor.description();
  if (static_cast<int>(d.dof_names.size()) != dofs || d.num_vertices != character.num_vertices())
    fail<UsageError>("animating {} ({} DoFs, {} vertices): the actor file is of '{}' with {} DoFs and {} vertices",
                     character.name, dofs, character.num_vertices(), d.name, d.dof_names.size(), d.num_vertices);
  if (d.fingerprint != character.fingerprint())
    log::warn("the actor file was made from another version of the character (fingerprint {} there, {} here)",
              d.fingerprint, character.fingerprint());
}

torch::Tensor motion_window(const Motion& motion, int frame, int past_frames, std::span<const long> cuts) {
  const auto after = std::upper_bound(cuts.begin(), cuts.end(), static_cast<long>(frame));
  const int first = after == cuts.begin() ? 0 : static_cast<int>(*std::prev(after));
  const auto dofs = static_cast<std::int64_t>(motion.frames.at(as_size(frame)).size());
  torch::Tensor rows = torch::empty({past_frames + 1, dofs});
  float* out = rows.data_ptr<float>();
  for (int i = past_frames; i >= 0; --i) out = append_row(motion.frames[std::max(first, frame - i)], out);
  return rows;
}

void animate(const Character& character, std::span<const MotionPart> parts, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile) {
  if (actor) {
    for (const MotionPart& part : parts) check_belongs_together(character, part.motion);
    check_belongs_together(character, *actor);
    const auto geometry = [actor](const torch::Tensor& dofs) { return actor->forward(dofs); };
    return animate(character, parts, actor->description().past_frames, geometry, writers, profile);
  }
  CharacterSurface surface(character);
  animate(
      character, parts, 0, [&](const torch::Tensor& dofs) { return surface->skinned(dofs.select(1, 0)); }, writers,
      profile);
}

void animate(const Character& character, const Motion& motion, const ActorFile* actor,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile, const FrameSteps& steps) {
  animate(character, std::array{MotionPart{motion, steps}}, actor, writers, profile);
}

void animate(const Character& character, std::span<const MotionPart> parts, int past_frames,
             const ActorFunction& geometry, const std::vector<std::unique_ptr<SequenceWriter>>& writers,
             Profile* profile) {
  Profile unused;
  torch::NoGradGuard no_grad;
  std::vector<Windows> windows;
  int frames = 0;
  for (const MotionPart& part : parts) {
    check_belongs_together(character, part.motion);
    frames += windows.emplace_back(character, part.motion, past_frames, part.steps).count();
  }
  Progress progress("animate", frames);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    std::optional<HeldRoot> held;
    if (parts[i].in_place) held.emplace(character.skeleton, windows[i].at(0));
    pose_frames(character, windows[i], held, geometry, writers, profile ? *profile : unused, progress);
  }
  for (const auto& writer : writers) writer->close();
}

void animate(const Character& character, const Motion& motion, int past_frames, const ActorFunction& geometry,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile* profile, const FrameSteps& steps) {
  animate(character, std::array{MotionPart{motion, steps}}, past_frames, geometry, writers, profile);
}

}  // namespace doppel
