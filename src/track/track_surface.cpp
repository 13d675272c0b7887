#include "doppel/track/track_surface.h"

#include <fmt/format.h>

#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/clock.h"
#include "doppel/core/error.h"
#include "doppel/track/frame_file.h"
#include "doppel/track/track_task.h"

namespace doppel {

TrackedSurface track_surface(const Footage& footage, const FootageSequence& sequence, const Motion& motion,
                             const SurfaceOptions& options, const std::filesystem::path& stem, bool vertices,
                             Progress& progress) {
  SurfaceTracker tracker(footage.character(), footage.landmarks(), footage.cameras(), options);
  FrameFile graph(stem.string() + "_graph.npy", tracker.model().num_nodes(), kBlockSize);
  std::optional<FrameFile> surface;
  if (vertices) surface.emplace(stem.string() + "_vertices.npy", footage.character().num_vertices(), 3);
  const auto reader = footage.read(sequence.index);
  TrackedSurface result;
  for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
    check_not_stopped(sequence, frame);
    if (sequence.begins_segment(frame)) tracker.cut();
    const FootageFrame seen = reader->read(frame, false);
    const auto start = Clock::now();
    SurfaceFrame found = tracker.track(seen.evidence, motion.frames[frame]);
    result.seconds += seconds_since(start);
    graph.append(found.parameters);
    if (surface) surface->append(deformed_vertices(tracker.model(), tracker.model().pose(found.parameters, false)));
    progress.advance(1, fmt::format("{} surface, IoU {:.3f}", sequence.name, found.overlap));
    found.parameters.clear();
    result.frames.push_back(std::move(found));
  }
  graph.close();
  if (surface) surface->close();
  return result;
}

TemplateFit::TemplateFit(const Character& character, const std::vector<Marker>& landmarks,
                         const std::vector<PinholeCamera>& cameras, const SurfaceOptions& options)
    : character_(character),
      tracker_(character, landmarks, cameras, options),
      sum_(as_size(character.num_vertices()), Eigen::Vector3d::Zero()) {}

double TemplateFit::add(const FrameEvidence& seen, const std::vector<double>& dofs) {
  tracker_.cut();
  const SurfaceFrame found = tracker_.track(seen, dofs);
  const DeformedGraph graph = tracker_.model().pose(found.parameters, false);
  for (std::size_t v = 0; v < sum_.size(); ++v)
    sum_[v] += tracker_.model().canonical_vertex(graph, static_cast<int>(v));
  ++count_;
  return found.overlap;
}

Character TemplateFit::character() const {
  if (count_ == 0) fail("there is no frame for the template fit");
  Character fitted = character_;
  for (std::size_t v = 0; v < sum_.size(); ++v) fitted.mesh.vertices[v] = sum_[v] / count_;
  return fitted;
}

}  // namespace doppel
