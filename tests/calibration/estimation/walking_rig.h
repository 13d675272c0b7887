#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "doppel/calibration/estimation/point_tracks.h"
#include "support/ring_of_cameras.h"

namespace doppel::support {

using Eigen::Vector3d;

constexpr int kWalkerPoints = 15;

/// Where a person's points are at a time in seconds, [15], world metres, y up.
using Person = std::function<std::vector<Vector3d>(double)>;

/// The points of a body that stands at `root` and looks along `heading` (about y), with limbs that swing.
inline std::vector<Vector3d> body_at(const Vector3d& root, double heading, double phase, double swing) {
  const Eigen::AngleAxisd turn(heading, Vector3d::UnitY());
  std::vector<Vector3d> local;
  const auto limb = [&](const Vector3d& top, double upper, double lower, double angle, double bend) {
    const auto down = [](double a) { return Vector3d(0.0, -std::cos(a), std::sin(a)); };
    local.push_back(top);
    local.push_back(top + upper * down(angle));
    local.push_back(local.back() + lower * down(angle + bend));
  };
  local.emplace_back(0.0, 1.62, 0.1);
  local.emplace_back(0.0, 1.45, 0.0);
  local.emplace_back(0.0, 0.95, 0.0);
  const double s = swing * std::sin(phase), bob = 0.03 * swing * std::cos(2.0 * phase);
  limb({0.18, 1.42, 0.0}, 0.3, 0.27, 0.6 * s, 0.3 + 0.2 * s);
  limb({-0.18, 1.42, 0.0}, 0.3, 0.27, -0.6 * s, 0.3 - 0.2 * s);
  limb({0.1, 0.93, 0.0}, 0.43, 0.42, -0.5 * s, -0.25 * swing * (1.0 + std::cos(phase)));
  limb({-0.1, 0.93, 0.0}, 0.43, 0.42, 0.5 * s, -0.25 * swing * (1.0 - std::cos(phase)));
  std::vector<Vector3d> points;
  for (const Vector3d& point : local) points.push_back(root + turn * point + Vector3d(0.0, bob, 0.0));
  return points;
}

/// A person who walks around a figure that never repeats, a step and a half per second.
inline std::vector<Vector3d> walker(double t) {
  const Vector3d root(0.6 * std::sin(0.9 * t), 0.0, 0.5 * std::cos(1.3 * t));
  const double phase = 2.0 * M_PI * (0.75 * t + 0.05 * std::sin(0.7 * t));
  return body_at(root, 0.8 * t + 0.3 * std::sin(1.1 * t), phase, 0.8 + 0.2 * std::sin(0.5 * t));
}

struct FilmOptions {
  std::vector<double> fps;     ///< [C] frames per second, as the camera really films
  std::vector<double> offset;  ///< [C] the true frame at time 0
  long frames = 200;           ///< of each camera
  double noise = 1.5;          ///< pixels, per coordinate
  double outliers = 0.03;      ///< share of points that are 25 to 90 pixels off
  double missing = 0.03;       ///< share of points that are not seen
  unsigned seed = 1;
};

/// What cameras see of a person. The tracks have the true frame rates and the offsets 0.
inline PointTracks film(const std::vector<Camera>& cameras, const Person& person, const FilmOptions& options) {
  std::mt19937 random(options.seed);
  std::normal_distribution<double> noise(0.0, options.noise);
  std::uniform_real_distribution<double> share(0.0, 1.0), far(25.0, 90.0);
  PointTracks tracks;
  for (int k = 0; k < kWalkerPoints; ++k) tracks.points.push_back("p" + std::to_string(k));
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const double fps = options.fps.empty() ? 25.0 : options.fps[c];
    const double offset = options.offset.empty() ? 0.0 : options.offset[c];
    CameraTrack track(cameras[c].name, fps, options.frames, kWalkerPoints);
    for (long f = 0; f < options.frames; ++f) {
      const std::vector<Vector3d> points = person((static_cast<double>(f) - offset) / fps);
      for (int k = 0; k < kWalkerPoints; ++k) {
        if (share(random) < options.missing) continue;
        Eigen::Vector2d pixel = cameras[c].project(points[k]);
        pixel += Eigen::Vector2d(noise(random), noise(random));
        double confidence = 0.9;
        if (share(random) < options.outliers) {
          const double angle = 2.0 * M_PI * share(random);
          pixel += far(random) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
          confidence = 0.5;
        }
        track.at(f, k) = {pixel, confidence};
      }
    }
    tracks.cameras.push_back(std::move(track));
  }
  return tracks;
}

/// Cameras around the person, not all at the same height.
inline std::vector<Camera> rig_of(int count, int size) {
  std::vector<Camera> cameras;
  for (const PinholeCamera& camera : ring_of_cameras(count, size, {0.0, 0.9, 0.0})) {
    Camera higher = camera;
    const double lift = 0.4 * std::sin(2.3 * static_cast<double>(cameras.size()));
    const Eigen::AngleAxisd tilt(-std::atan(lift / 3.0), Vector3d::UnitX());
    const Vector3d centre = camera.centre() + Vector3d(0.0, lift, 0.0);
    higher.R = tilt.toRotationMatrix() * camera.R;
    higher.t = -higher.R * centre;
    cameras.push_back(higher);
  }
  return cameras;
}

/// Turns each camera by `degrees` about a random axis and shifts its centre by `metres`.
inline std::vector<Camera> disturbed(std::vector<Camera> cameras, double degrees, double metres, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto direction = [&] { return Vector3d(normal(random), normal(random), normal(random)).normalized(); };
  for (Camera& camera : cameras) {
    const Vector3d centre = camera.centre() + metres * direction();
    camera.R = Eigen::AngleAxisd(degrees * M_PI / 180.0, direction()).toRotationMatrix() * camera.R;
    camera.t = -camera.R * centre;
  }
  return cameras;
}

}  // namespace doppel::support
