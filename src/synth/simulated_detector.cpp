#include "doppel/synth/simulated_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "doppel/core/as_size.h"
#include "doppel/core/random.h"

namespace doppel::synth {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<int> body25_markers(const Skeleton& skeleton) {
  static const std::array<const char*, 25> kNames{"nose",
                                                  "neck",
                                                  "right_shoulder",
                                                  "right_elbow",
                                                  "right_wrist",
                                                  "left_shoulder",
                                                  "left_elbow",
                                                  "left_wrist",
                                                  "mid_hip",
                                                  "right_hip",
                                                  "right_knee",
                                                  "right_ankle",
                                                  "left_hip",
                                                  "left_knee",
                                                  "left_ankle",
                                                  "right_eye",
                                                  "left_eye",
                                                  "right_ear",
                                                  "left_ear",
                                                  "left_big_toe",
                                                  "",
                                                  "",
                                                  "right_big_toe",
                                                  "",
                                                  ""};
  std::vector<int> markers;
  for (const std::string name : kNames) {
    int found = -1;
    for (std::size_t m = 0; m < skeleton.markers.size(); ++m)
      if (skeleton.markers[m].name == name) found = static_cast<int>(m);
    markers.push_back(found);
  }
  return markers;
}

std::vector<double> detect_points(const Studio& studio, int camera_index, const Camera& camera, const Points& markers,
                                  const std::vector<int>& body25, std::uint64_t key) {
  std::vector<double> result;
  for (std::size_t k = 0; k < body25.size(); ++k) {
    if (body25[k] < 0) {
      result.insert(result.end(), {0.0, 0.0, 0.0});
      continue;
    }
    const Vector3d& p = markers[body25[k]];
    // Landmarks are inside the limbs: an occluder at less than this distance is the limb itself.
    const bool seen = studio.sees(camera_index, p, 0.11);
    const double sigma = (seen ? 0.0025 : 0.008) * camera.width;
    const Vector2d pixel = camera.project(p) + sigma * Vector2d(hash_normal(key + 4 * k), hash_normal(key + 4 * k + 1));
    const double confidence = (seen ? 0.88 : 0.4) + 0.04 * hash_normal(key + 4 * k + 2);
    const auto rounded = [](double x, double unit) { return std::round(x / unit) * unit; };
    result.insert(result.end(), {rounded(pixel.x(), 1e-3), rounded(pixel.y(), 1e-3),
                                 rounded(std::clamp(confidence, 0.05, 1.0), 1e-3)});
  }
  return result;
}

Points estimate_joints(const Camera& camera, const Points& markers, const std::vector<int>& body25, int frame,
                       std::uint64_t key) {
  constexpr double kNoise = 0.025, kBias = 0.01, kPeriod = 40.0;  // metres, metres, frames
  constexpr std::size_t kMidHip = 8;
  Points result(body25.size(), Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  const Vector3d& root = markers[body25[kMidHip]];
  for (std::size_t k = 0; k < body25.size(); ++k) {
    if (body25[k] < 0) continue;
    result[k] = camera.R * (markers[body25[k]] - root);
    if (k == kMidHip) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const double phase = 1.7 * static_cast<double>(3 * k + axis), depth = axis == 2 ? 2.0 : 1.0;
      result[k][axis] += depth * kBias * std::sin(2.0 * M_PI * frame / kPeriod + phase) +
                         kNoise * hash_normal(key + 4 * k + as_size(axis));
    }
  }
  return result;
}

}  // namespace doppel::synth
