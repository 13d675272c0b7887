#pragma once

/// DeepCap on footage (5.8): what trained networks make of the pictures of one camera.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "doppel/data/person_crop.h"
#include "doppel/track/footage.h"
#include "doppel/track/pose_model.h"
#include "doppel/track/track_task.h"
#include "doppel/track/track_view.h"
#include "doppel/track/tracked_frame.h"
#include "doppel/train/trained_pose.h"

namespace doppel {

/// One frame as the networks see it.
struct DeepcapFrame {
  TrackedFrame pose;          ///< lost where the keypoints do not determine the place: then it is only a guess
  std::vector<double> graph;  ///< [K*6] A and T of each node in turn; zeros without DefNet
};

/// Captures frames one by one.
class DeepcapTracker {
 public:
  /// @param trained must outlive the tracker @param camera without distortion
  /// @param landmarks what keypoints stand for, in their order @throws Error when they lack one the run was trained
  /// with
  DeepcapTracker(TrainedPose& trained, const Camera& camera, const std::vector<Marker>& landmarks);

  /// @param picture BGR and @param mask of the camera, without distortion
  DeepcapFrame capture(const cv::Mat& picture, const cv::Mat& mask, const std::vector<Keypoint>& keypoints);
  /// The surface. @param graph [K*6] @return float32 [N,3] world metres
  torch::Tensor surface(const std::vector<double>& dofs, const std::vector<double>& graph) const;

 private:
  PersonView view_of(const PersonInput& input, const std::vector<Keypoint>& keypoints) const;

  TrainedPose& trained_;
  Camera camera_;
  PoseModel model_;
  std::vector<int> source_;  ///< [M of the run] index into the footage's landmarks
};

struct DeepcapOptions : TrackTask {
  std::filesystem::path run;  ///< of posenet, or of the chain deepcap
  double smoothing = 1.0;     ///< sigma of the Gaussian over five frames; 0: none (5.8)
  bool film = true;           ///< `<sequence>.mp4`
  TrackViewOptions view;      ///< how it is drawn
};

/// Captures sequences from one camera and writes into `options.out`:
/// - `<sequence>.motion`, `<sequence>.bvh`
/// - `<sequence>_graph.npy` float32 [frames, K, 6] (A, T of 5.9) with DefNet; `<sequence>_vertices.npy` float32
///   [frames, N, 3], world metres, where asked for
/// - `<sequence>.mp4`: the surface over the pictures, and from the side
/// - `capture.yaml`, `track.json`: as `track_capture`
/// Poses and deformations are smoothed over five frames; frames whose place could not be determined are listed, and
/// bridged from their neighbours.
/// @param footage of one camera
/// @throws UsageError for several cameras; Error when no frame of a sequence shows the person, or the run is of another
/// character
nlohmann::ordered_json track_deepcap(const Footage& footage, const DeepcapOptions& options);

}  // namespace doppel
