#include "doppel/track/live/live_solver.h"

#include "doppel/character/landmarks.h"
#include "doppel/core/error.h"
#include "doppel/track/livecap/livecap_input.h"

namespace doppel {

namespace {

class LivecapSolver : public LiveSolver {
 public:
  LivecapSolver(const LiveView& view, const LivecapConfig& config)
      : tracker_(view.character(), view.landmarks(),
                 chosen_dofs(config.dofs, view.character().skeleton, view.landmarks()), view.camera(), config.fit) {}

  LivecapFrame solve(const FootageFrame& seen) override { return tracker_.track(livecap_input(seen)); }
  void pause() override { tracker_.pause(); }

 private:
  LivecapTracker tracker_;
};

DeepcapTracker tracker_for(const LiveView& view, TrainedPose& trained) {
  if (trained.character.fingerprint() != view.character().fingerprint())
    fail("the run was trained for another character than the capture's");
  return DeepcapTracker(trained, view.camera(), view.landmarks());
}

DeepcapFrame look(DeepcapTracker& tracker, const FootageFrame& seen) {
  return tracker.capture(seen.pictures.front(), seen.masks.front(), seen.evidence.front().keypoints);
}

/// Networks look at every picture by itself; where they lose the person, the last pose stays.
class DeepcapSolver : public LiveSolver {
 public:
  DeepcapSolver(const LiveView& view, TrainedPose& trained)
      : tracker_(tracker_for(view, trained)),
        dofs_(view.character().rest_dofs),
        graph_(6 * static_cast<std::size_t>(view.character().num_nodes()), 0.0) {}

  LivecapFrame solve(const FootageFrame& seen) override {
    const auto start = Clock::now();
    LivecapFrame result;
    DeepcapFrame found = look(tracker_, seen);
    result.pose_seconds = seconds_since(start);
    result.pose = std::move(found.pose);
    follow(result.pose, found.graph);
    const torch::Tensor surface = tracker_.surface(dofs_, graph_);
    result.vertices = Eigen::Map<const Eigen::Matrix3Xf>(surface.data_ptr<float>(), 3, surface.size(0)).cast<double>();
    result.surface_seconds = seconds_since(start) - result.pose_seconds;
    return result;
  }
  void pause() override { lost_ = true; }

 private:
  void follow(TrackedFrame& pose, std::vector<double>& graph) {
    if (pose.trusted()) {
      if (lost_) pose.state = found_once_ ? FrameState::recovered : FrameState::initialised;
      found_once_ = true;
      dofs_ = pose.dofs;
      graph_ = std::move(graph);
    }
    lost_ = !pose.trusted();
    pose.dofs = dofs_;
  }

  DeepcapTracker tracker_;
  std::vector<double> dofs_, graph_;  ///< that were trusted last
  bool found_once_ = false, lost_ = true;
};

}  // namespace

std::unique_ptr<LiveSolver> make_livecap_solver(const LiveView& view, const LivecapConfig& config) {
  return std::make_unique<LivecapSolver>(view, config);
}

std::unique_ptr<LiveSolver> make_deepcap_solver(const LiveView& view, TrainedPose& trained) {
  return std::make_unique<DeepcapSolver>(view, trained);
}

JointFinder joints_of_posenet(const LiveView& view, TrainedPose& trained) {
  const auto tracker = std::make_shared<DeepcapTracker>(tracker_for(view, trained));
  return [tracker, &view](const FootageFrame& seen) {
    std::vector<JointDetection> joints;
    const DeepcapFrame found = look(*tracker, seen);
    if (!found.pose.trusted()) return joints;
    const Camera& camera = view.camera();
    for (const Eigen::Vector3d& point :
         landmark_positions(view.character().skeleton, view.landmarks(), found.pose.dofs))
      joints.push_back({camera.R * point + camera.t, true});
    return joints;
  };
}

}  // namespace doppel
