#include "doppel/actor/export/correctives/engine_teacher.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr std::size_t kWindowsAtOnce = 16;

/// The poses of a window before its last that a function sees: 1, 2, 4, ..., F.
std::vector<int> seen_poses(int past_frames) {
  std::vector<int> poses;
  for (int i = 1; i < past_frames; i *= 2) poses.push_back(i);
  if (past_frames > 0) poses.push_back(past_frames);
  return poses;
}

Tensor tensor_of_windows(std::span<const WindowRows> windows) {
  const auto rows = static_cast<std::int64_t>(windows[0].size()),
             dofs = static_cast<std::int64_t>(windows[0][0].size());
  const Tensor result = torch::empty({static_cast<std::int64_t>(windows.size()), rows, dofs});
  float* out = result.data_ptr<float>();
  for (const WindowRows& window : windows)
    for (const std::vector<double>& row : window)
      out = std::transform(row.begin(), row.end(), out, [](double v) { return static_cast<float>(v); });
  return result;
}

}  // namespace

std::vector<std::size_t> EngineFrames::fitted(std::size_t count) const {
  std::vector<std::size_t> all, chosen;
  for (std::size_t t = 0; t < use.size(); ++t)
    if (use[t] == FrameUse::fitted) all.push_back(t);
  const std::size_t used = std::min(count, all.size());
  for (std::size_t i = 0; i < used; ++i) chosen.push_back(all[i * all.size() / used]);
  return chosen;
}

std::vector<WindowRows> draw_windows(const EngineTeacher& teacher, const Skeleton& skeleton, int count,
                                     std::uint64_t seed) {
  const WindowMixer mixer(skeleton, teacher.motions, teacher.past_frames);
  Random random(seed);
  std::vector<WindowRows> windows;
  for (int i = 0; i < count; ++i) windows.push_back(mixer.draw(random));
  return windows;
}

void ask_actor(const EngineTeacher& teacher, std::span<const WindowRows> windows, const char* title,
               const std::function<void(std::size_t window, std::span<const float> vertices)>& use) {
  Progress progress(title, static_cast<std::int64_t>(windows.size()));
  for (std::size_t first = 0; first < windows.size(); first += kWindowsAtOnce) {
    if (stop_requested()) fail("{}: stopped at window {} of {}", title, first, windows.size());
    const std::size_t count = std::min(kWindowsAtOnce, windows.size() - first);
    const Tensor vertices = teacher.geometry(tensor_of_windows(windows.subspan(first, count))).contiguous();
    const auto size = as_size(vertices.size(1) * vertices.size(2));
    for (std::size_t i = 0; i < count; ++i) use(first + i, {vertices.data_ptr<float>() + i * size, size});
    progress.advance(static_cast<std::int64_t>(count));
  }
}

CorrectiveFunction unfitted_function(const Figure& figure, int past_frames, double frames_per_second) {
  CorrectiveFunction function;
  for (std::size_t b = 0; b < figure.nodes.size(); ++b) {
    const int parent = figure.nodes[b].parent;
    const Eigen::Affine3d local = parent < 0 ? figure.rest[b] : figure.rest[as_size(parent)].inverse() * figure.rest[b];
    function.parents.push_back(parent);
    function.rest.push_back(Eigen::Quaterniond(local.linear()).normalized());
  }
  for (const int pose : seen_poses(past_frames)) function.lags.push_back(pose / frames_per_second);
  return function;
}

Eigen::VectorXf inputs_of_window(const CorrectiveFunction& function, const Figure& figure, const Skeleton& skeleton,
                                 const WindowRows& window) {
  const int past_frames = static_cast<int>(window.size()) - 1;
  std::vector<std::vector<Eigen::Affine3d>> poses{pose_nodes(figure, skeleton, window.back())};
  for (const int pose : seen_poses(past_frames))
    poses.push_back(pose_nodes(figure, skeleton, window[as_size(past_frames - pose)]));
  return function.inputs(poses);
}

SampleList ask_for_samples(const EngineTeacher& teacher, std::span<const WindowRows> windows,
                           const EngineFrames& frames, const CorrectiveFunction& function, const Figure& figure,
                           const Skeleton& skeleton,
                           const std::function<Eigen::VectorXf(const std::vector<double>& dofs,
                                                               std::span<const float> vertices)>& weights_of) {
  SampleList samples;
  ask_actor(teacher, windows, "asking the actor", [&](std::size_t i, std::span<const float> vertices) {
    samples.add(inputs_of_window(function, figure, skeleton, windows[i]), weights_of(windows[i].back(), vertices));
  });
  for (std::size_t t = 0; t < frames.use.size(); ++t)
    if (frames.use[t] != FrameUse::unseen)
      samples.add(frames.inputs[t], weights_of(frames.clip.dofs[t], frames.clip.vertices[t]),
                  frames.use[t] == FrameUse::held_out);
  return samples;
}

}  // namespace doppel
