#include "doppel/track/method_trackers.h"

#include "doppel/core/as_size.h"
#include "doppel/core/clock.h"
#include "doppel/core/error.h"
#include "doppel/track/livecap/livecap_input.h"

namespace doppel {

namespace {

class MultiviewFrames : public FrameTracker {
 public:
  MultiviewFrames(const Footage& footage, const Character& character, const TrackConfig& config)
      : tracker_(character, footage.landmarks(),
                 chosen_dofs(config.dofs, footage.character().skeleton, footage.landmarks()), footage.cameras(),
                 config.fit) {}

  FrameResult track(const FootageFrame& seen) override {
    const auto start = Clock::now();
    FrameResult result;
    result.pose = tracker_.track(seen.evidence);
    result.pose_seconds = seconds_since(start);
    return result;
  }
  void cut() override { tracker_.cut(); }
  void pause() override { tracker_.pause(); }
  ImageUse image_use() const override { return ImageUse::none; }
  const PoseModel& model() const override { return tracker_.model(); }

 private:
  MultiviewTracker tracker_;
};

class LivecapFrames : public FrameTracker {
 public:
  LivecapFrames(const Character& character, const std::vector<Marker>& landmarks, const PinholeCamera& camera,
                const LivecapConfig& config)
      : tracker_(character, landmarks, chosen_dofs(config.dofs, character.skeleton, landmarks), camera, config.fit) {}

  FrameResult track(const FootageFrame& seen) override { return tracker_.track(livecap_input(seen)); }
  void cut() override { tracker_.cut(); }
  void pause() override { tracker_.pause(); }
  ImageUse image_use() const override { return ImageUse::optional; }
  const PoseModel& model() const override { return tracker_.model(); }

 private:
  LivecapTracker tracker_;
};

class DeepcapFrames : public FrameTracker {
 public:
  DeepcapFrames(TrainedPose& trained, const Character& character, const std::vector<Marker>& landmarks,
                const PinholeCamera& camera, LostFrames lost)
      : tracker_(trained, camera, landmarks),
        lost_frames_(lost),
        history_(character.rest_dofs),
        graph_(6 * as_size(character.num_nodes()), 0.0) {}

  FrameResult track(const FootageFrame& seen) override {
    const auto start = Clock::now();
    FrameResult result = tracker_.capture(seen.images.front(), seen.masks.front(), seen.evidence.front().keypoints);
    result.pose_seconds = seconds_since(start);
    if (lost_frames_ == LostFrames::report) return result;
    hold(result);
    const torch::Tensor surface = tracker_.surface(result.pose.dofs, result.graph);
    result.vertices = Eigen::Map<const Eigen::Matrix3Xf>(surface.data_ptr<float>(), 3, surface.size(0)).cast<double>();
    result.surface_seconds = seconds_since(start) - result.pose_seconds;
    return result;
  }
  void cut() override { history_.cut(); }
  void pause() override { history_.clear(); }
  ImageUse image_use() const override { return ImageUse::required; }
  const PoseModel& model() const override { return tracker_.model(); }

 private:
  /// The networks do not use the last frame. A frame that is found after a lost one therefore counts as recovered.
  void hold(FrameResult& result) {
    TrackedFrame& pose = result.pose;
    if (pose.found()) {
      if (history_.empty()) pose.state = history_.state_of_restart();
      graph_ = result.graph;
    }
    history_.remember(pose);
    pose.dofs = history_.last();
    result.graph = graph_;
  }

  DeepcapTracker tracker_;
  LostFrames lost_frames_;
  PoseHistory history_;
  std::vector<double> graph_;  ///< of the last found frame
};

}  // namespace

std::unique_ptr<FrameTracker> make_multiview_tracker(const Footage& footage, const Character& character,
                                                     const TrackConfig& config) {
  return std::make_unique<MultiviewFrames>(footage, character, config);
}

std::unique_ptr<FrameTracker> make_livecap_tracker(const Character& character, const std::vector<Marker>& landmarks,
                                                   const PinholeCamera& camera, const LivecapConfig& config) {
  return std::make_unique<LivecapFrames>(character, landmarks, camera, config);
}

std::unique_ptr<FrameTracker> make_deepcap_tracker(TrainedPose& trained, const Character& character,
                                                   const std::vector<Marker>& landmarks, const PinholeCamera& camera,
                                                   LostFrames lost) {
  if (trained.character.fingerprint() != character.fingerprint())
    fail("the run was trained for another character than the capture's");
  return std::make_unique<DeepcapFrames>(trained, character, landmarks, camera, lost);
}

}  // namespace doppel
