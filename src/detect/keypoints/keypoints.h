#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// A point that a detector found, in pixels of the image as the detector wrote it (no shift is applied).
struct Keypoint {
  float x = 0.0f, y = 0.0f;
  float confidence = 0.0f;  ///< 0..1; 0: not seen, and then x = y = 0
};
/// Points of lower confidence neither determine a crop nor count as seen in reports (thesis 5.3).
inline constexpr float kSeenConfidence = 0.4f;

/// One person's points in the detector's order, and everybody in one image.
using Person = std::vector<Keypoint>;
using People = std::vector<Person>;

/// The error of the 3D joints of a network of which no more is known, metres. The default weight of the joints in
/// LiveCap (4.4) was chosen for joints with this error.
inline constexpr double kJointNoise = 0.025;
/// The error of BlazePose's 3D joints, metres: their mean distance from the landmarks of a fit to four cameras, both
/// relative to their means (docs/results/filmed.md, 1,800 images).
inline constexpr double kBlazePoseJointNoise = 0.138;

/// A 3D joint as estimated by a network from one image.
struct JointDetection {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres, camera axes, relative to the body's root (mid-hip)
  bool seen = false;                                   ///< false: the network gives no estimate
  double noise = kJointNoise;  ///< the network's error, metres; weights are inverse to its square
};

/// The points that a detector writes, in its order.
struct PointLayout {
  std::string name;                 ///< that of a built-in map (body25, coco17, ...), or a name from a user's map
  std::vector<std::string> points;  ///< [n] unique names

  /// The index of a point: the point of exactly this name, otherwise the first with the same landmark_key.
  /// @return nothing when the layout has no such point
  std::optional<int> find(const std::string& point) const;
};

/// The person to follow. Of several people, this is the one with the largest sum of confidences over points inside the
/// mask. A point is outside when its distance from the mask exceeds 3 % of the mask's longer side. If nobody has a
/// point inside, or the mask is empty or not given, all points count. person_choice.h chooses by several cameras.
/// @param mask of the image that contains the points, or empty
/// @return nothing when there are no people
std::optional<Person> choose_person(const People& people, const cv::Mat& mask = {});
/// The index of the same person; -1 when there are no people.
int index_of_person(const People& people, const cv::Mat& mask = {});

}  // namespace doppel
