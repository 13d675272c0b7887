#pragma once

#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "doppel/track/energy/evidence.h"
#include "doppel/track/energy/pose_model.h"
#include "support/ring_of_cameras.h"
#include "support/test_character.h"

/// What the tests of energies and fits share: the test character with landmarks on all its segments, a ring of cameras,
/// and what these would see of a pose.
namespace doppel {

/// Two landmarks a segment, off its axis, so that every turn shows.
inline std::vector<Marker> tube_landmarks(int num_joints) {
  std::vector<Marker> landmarks;
  for (int i = 0; i < num_joints; ++i)
    for (int side = 0; side < 2; ++side)
      landmarks.push_back({"landmark_" + std::to_string(2 * i + side), test_character::segment_joint(i),
                           Eigen::Vector3d(side ? 0.07 : -0.05, side ? 0.1 : 0.2, side ? 0.02 : 0.06), 0.01});
  return landmarks;
}

/// A pose away from rest, in which every DoF moves. @param amount radians
inline std::vector<double> bent_pose(const Character& character, double amount, double phase = 0.3) {
  std::vector<double> dofs = character.rest_dofs;
  for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += amount * std::sin(phase + 1.9 * static_cast<double>(d));
  return dofs;
}

inline Eigen::Vector3d middle_of(const Character& character) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& vertex : character.mesh.vertices) sum += vertex;
  return sum / character.num_vertices();
}

/// Exact keypoints of a pose, all seen.
inline FrameEvidence keypoints_of(const PoseModel& model, const std::vector<PinholeCamera>& cameras,
                                  const std::vector<double>& dofs) {
  const PosedBody body = model.pose(dofs, false);
  FrameEvidence frame(cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (int m = 0; m < model.num_landmarks(); ++m) {
      const Eigen::Vector2d pixel = cameras[c].project(model.landmark(body, m));
      frame[c].keypoints.push_back({static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 0.9f});
    }
  return frame;
}

/// The mask of a posed surface, drawn face by face with 1/256 pixel.
inline cv::Mat mask_of(const PoseModel& model, const PinholeCamera& camera, const std::vector<double>& dofs) {
  const PosedBody body = model.pose(dofs, false);
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  for (const Triangle& face : model.character().mesh.faces) {
    std::vector<cv::Point> corners;
    for (const int vertex : face) {
      const Eigen::Vector2d pixel = camera.project(model.vertex(body, vertex));
      corners.emplace_back(cvRound(256.0 * (pixel.x() - 0.5)), cvRound(256.0 * (pixel.y() - 0.5)));
    }
    cv::fillConvexPoly(mask, corners, cv::Scalar(255), cv::LINE_8, 8);
  }
  return mask;
}

inline std::vector<int> all_dofs(const Character& character) {
  std::vector<int> dofs(character.num_dofs());
  std::iota(dofs.begin(), dofs.end(), 0);
  return dofs;
}

/// Two cameras that see the outline of the rest pose.
struct OutlineScene {
  OutlineScene() {
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      frame_[c].outline = OutlineField(mask_of(model_, cameras_[c], character_.rest_dofs), 200);
  }

  Character character_ = make_test_character(4, 12, 20);
  PoseModel model_{character_, tube_landmarks(4), all_dofs(character_)};
  std::vector<PinholeCamera> cameras_ = ring_of_cameras(2, 256, middle_of(character_));
  FrameEvidence frame_ = FrameEvidence(cameras_.size());
};

}  // namespace doppel
