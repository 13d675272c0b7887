#include "doppel/track/deepcap/deepcap.h"

#include <algorithm>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/progress.h"
#include "doppel/track/deepcap/smoothed_surfaces.h"
#include "doppel/track/energy/root_rotation.h"
#include "doppel/track/fit/pose_sequence.h"
#include "doppel/track/frame_file.h"
#include "doppel/track/method_trackers.h"
#include "doppel/track/sequence_runner.h"
#include "doppel/track/track_film.h"
#include "doppel/track/track_results.h"

namespace doppel {

namespace fs = std::filesystem;
using torch::Tensor;

namespace {

/// Tracks one sequence, from its images to its files.
class DeepcapRun {
 public:
  DeepcapRun(const Footage& footage, TrainedPose& trained, const DeepcapOptions& options,
             const FootageSequence& sequence)
      : footage_(footage),
        options_(options),
        sequence_(sequence),
        surfaces_(trained, footage.cameras().front(), footage.landmarks()),
        tracker_(make_deepcap_tracker(trained, footage.character(), footage.landmarks(), footage.cameras().front(),
                                      LostFrames::report)) {}

  /// Runs both passes: first the networks; then surfaces and film, from the smoothed poses and graphs.
  SequenceReport run(Progress& progress) {
    SequenceRunner runner(footage_, *tracker_, {});
    runner.on_frame([this](long, const FootageFrame&, const FrameResult& found) { graphs_.push_back(found.graph); });
    result_ = runner.run(sequence_, progress);
    make_motion(result_, RootRotation::of(footage_.character().skeleton), pose_smoothing());
    smooth_graphs();
    write_poses(footage_.character(), footage_.capture().fps, options_.out, result_);
    const fs::path stem = options_.out / sequence_.name;
    if (has_graph()) write_graphs(stem.string() + "_graph.npy");
    if (options_.film || options_.vertices) run_second_pass(result_, [&] { write_surfaces(stem, progress); });
    return report_of(footage_, std::move(result_));
  }

 private:
  /// Sigma for poses and graphs.
  double pose_smoothing() const { return options_.smoothed == DeepcapSmoothing::poses ? options_.smoothing : 0.0; }

  void smooth_graphs() {
    std::vector<bool> found;
    for (const TrackedFrame& frame : result_.frames) found.push_back(frame.found());
    const std::vector<long> cuts = sequence_.cuts_from_first();
    bridge_poses(graphs_, found, cuts, std::nullopt);
    smooth_poses(graphs_, cuts, std::nullopt, pose_smoothing());
  }

  bool has_graph() const {
    return std::any_of(graphs_.front().begin(), graphs_.front().end(), [](double value) { return value != 0.0; });
  }

  void write_graphs(const fs::path& path) const {
    FrameFile file(path, footage_.character().num_nodes(), 6);
    for (const std::vector<double>& graph : graphs_) file.append(graph);
    file.close();
  }

  void write_surfaces(const fs::path& stem, Progress& progress) {
    const TriangleMesh& mesh = footage_.character().mesh;
    std::optional<FrameFile> vertices;
    std::optional<TrackFilm> film;
    const fs::path path = stem.string() + "_vertices.npy";
    if (options_.vertices) vertices.emplace(path, mesh.num_vertices(), 3);
    if (options_.film)
      film.emplace(stem.string() + ".mp4", footage_.cameras().front(), mesh, footage_.capture().fps, options_.view);
    const auto reader = options_.film ? footage_.read(sequence_.index) : nullptr;
    const long first = sequence_.first_frame;
    SmoothedSurfaces smoothed([&](long f) { return surfaces_.surface(result_.motion.frames[first + f], graphs_[f]); },
                              static_cast<long>(graphs_.size()), sequence_.cuts_from_first(),
                              options_.smoothed == DeepcapSmoothing::vertices ? options_.smoothing : 0.0);
    for (long frame = first; frame <= sequence_.last_frame; ++frame) {
      check_not_stopped(sequence_, frame);
      const Tensor surface = smoothed.at(frame - first);
      if (vertices) vertices->append(std::span<const float>(surface.data_ptr<float>(), as_size(surface.numel())));
      if (film) film->add(reader->image(frame, 0), surface);
      progress.advance(1, sequence_.name);
    }
    if (vertices) vertices->close();
    if (vertices) result_.vertices = path;
    if (film) film->close();
  }

  const Footage& footage_;
  const DeepcapOptions& options_;
  const FootageSequence& sequence_;
  DeepcapTracker surfaces_;  ///< poses the surfaces of the second pass
  std::unique_ptr<FrameTracker> tracker_;
  TrackedSequence result_;
  std::vector<std::vector<double>> graphs_;  ///< [frames][K*6]
};

}  // namespace

TrackReport track_deepcap(const Footage& footage, const DeepcapOptions& options) {
  check_one_camera(footage);
  TrainedPose trained = TrainedPose::load(options.run);
  if (trained.character.fingerprint() != footage.character().fingerprint())
    fail("{} was trained for another character than the capture's", options.run.string());
  open_out_folder(footage, options.out, "deepcap");
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  require_masks(footage, chosen, "`doppel track deepcap`");
  Progress progress("track", count_frames(chosen) * (options.film || options.vertices ? 2 : 1));
  TrackReport report;
  report.method = "deepcap";
  report.steps = trained.steps;
  for (const FootageSequence& sequence : chosen) {
    if (is_stopped(report)) break;
    report.sequences.push_back(DeepcapRun(footage, trained, options, sequence).run(progress));
  }
  progress.finish();
  write_results(footage, options, report);
  return report;
}

}  // namespace doppel
