#include "doppel/track/track_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"

namespace doppel {
namespace {

/// Numbers of a frame, appended to a file.
class FrameFile {
 public:
  FrameFile(const std::string& path, int rows, int columns) : stream_(path, {rows, columns}) {}
  void append(const std::vector<double>& numbers) {
    const std::vector<float> floats(numbers.begin(), numbers.end());
    stream_.append(floats.data());
  }
  void append(const std::vector<Eigen::Vector3d>& points) {
    std::vector<double> numbers;
    for (const Eigen::Vector3d& point : points) numbers.insert(numbers.end(), point.data(), point.data() + 3);
    append(numbers);
  }
  void close() { stream_.close(); }

 private:
  NpyStream stream_;
};

}  // namespace

TrackedSurface track_surface(const Footage& footage, int sequence, const FootageSequence& range, const Motion& motion,
                             const SurfaceOptions& options, const std::filesystem::path& stem, bool vertices,
                             Progress& progress) {
  SurfaceTracker tracker(footage.character(), footage.landmarks(), footage.cameras(), options);
  FrameFile graph(stem.string() + "_graph.npy", tracker.model().num_nodes(), kBlockSize);
  std::unique_ptr<FrameFile> surface;
  if (vertices)
    surface = std::make_unique<FrameFile>(stem.string() + "_vertices.npy", footage.character().num_vertices(), 3);
  const auto reader = footage.read(sequence);
  TrackedSurface result;
  for (long frame = range.first_frame; frame <= range.last_frame; ++frame) {
    if (stop_requested()) fail("stopped at frame {} of the surface of sequence {}", frame, range.name);
    if (std::find(range.cuts.begin(), range.cuts.end(), frame) != range.cuts.end()) tracker.cut();
    const FootageFrame seen = reader->read(frame, false);
    const auto start = std::chrono::steady_clock::now();
    SurfaceFrame found = tracker.track(seen.evidence, motion.frames[static_cast<std::size_t>(frame)]);
    result.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    graph.append(found.parameters);
    if (surface) surface->append(deformed_vertices(tracker.model(), tracker.model().pose(found.parameters, false)));
    progress.advance(1, fmt::format("{} surface, IoU {:.3f}", range.name, found.overlap));
    found.parameters.clear();
    result.frames.push_back(std::move(found));
  }
  graph.close();
  if (surface) surface->close();
  return result;
}

WornTemplate::WornTemplate(const Footage& footage, const SurfaceOptions& options)
    : footage_(footage),
      tracker_(footage.character(), footage.landmarks(), footage.cameras(), options),
      sum_(static_cast<std::size_t>(footage.character().num_vertices()), Eigen::Vector3d::Zero()) {}

void WornTemplate::add(int sequence, const std::vector<long>& frames, const Motion& motion, Progress& progress) {
  const auto reader = footage_.read(sequence);
  for (const long frame : frames) {
    if (stop_requested()) fail("stopped at frame {} of the template", frame);
    const FootageFrame seen = reader->read(frame, false);
    tracker_.cut();
    const SurfaceFrame found = tracker_.track(seen.evidence, motion.frames[static_cast<std::size_t>(frame)]);
    const DeformedGraph graph = tracker_.model().pose(found.parameters, false);
    for (std::size_t v = 0; v < sum_.size(); ++v)
      sum_[v] += tracker_.model().canonical_vertex(graph, static_cast<int>(v));
    ++count_;
    progress.advance(1, "template");
  }
}

Character WornTemplate::character() const {
  if (count_ == 0) fail("there is no frame to find the worn template from");
  Character worn = footage_.character();
  for (std::size_t v = 0; v < sum_.size(); ++v) worn.mesh.vertices[v] = sum_[v] / count_;
  return worn;
}

}  // namespace doppel
