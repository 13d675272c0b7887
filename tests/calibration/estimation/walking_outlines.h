#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calibration/estimation/walking_rig.h"
#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/calibration/estimation/outline_tracks.h"
#include "doppel/core/as_size.h"

namespace doppel::support {

/// The outlines of a person made of a ball of 8 cm around each of its points.
/// @param noise pixels by which each corner of a hull is off, along x and y
inline std::vector<OutlineTrack> outlines_of(const std::vector<Camera>& cameras, const Person& person, long frames,
                                             double fps, double noise, unsigned seed,
                                             const std::vector<double>& offset = {}) {
  constexpr double kRadius = 0.08;
  std::vector<Vector3d> ball;
  for (int i = 0; i < 800; ++i) {  // a spiral covers a sphere evenly
    const double z = 1.0 - 2.0 * (i + 0.5) / 800.0, turn = 2.399963 * i;
    ball.emplace_back(std::sqrt(1.0 - z * z) * Vector3d(std::cos(turn), std::sin(turn), 0.0) + z * Vector3d::UnitZ());
  }
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<OutlineTrack> outlines;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    OutlineTrack track(as_size(frames));
    for (long f = 0; f < frames; ++f) {
      std::vector<cv::Point2f> pixels, hull;
      for (const Vector3d& point : person((static_cast<double>(f) - (offset.empty() ? 0.0 : offset[c])) / fps))
        for (const Vector3d& corner : ball) {
          const auto pixel = straight_pixel(cameras[c], cameras[c].project(point + kRadius * corner));
          if (pixel) pixels.emplace_back(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
        }
      cv::convexHull(pixels, hull);
      for (const cv::Point2f& corner : hull) {
        const Eigen::Vector2d filmed = filmed_pixel(cameras[c], {corner.x, corner.y});
        track[f].hull.push_back({filmed + Eigen::Vector2d(normal(random), normal(random)), false});
      }
    }
    outlines.push_back(std::move(track));
  }
  return outlines;
}

}  // namespace doppel::support
