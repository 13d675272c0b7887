#include "doppel/actor/export/camera_path.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/angles.h"
#include "doppel/core/as_size.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

class Orbit : public CameraPath {
 public:
  Orbit(const Character& character, const OrbitOptions& options) : options_(options) {
    double lowest = HUGE_VAL, highest = -HUGE_VAL;
    for (const Vector3d& v : character.mesh.vertices) {
      lowest = std::min(lowest, v.y());
      highest = std::max(highest, v.y());
    }
    distance_ = 2.2 * (highest - lowest);
  }

  PinholeCamera at(int frame, std::span<const float> vertices) override {
    const Eigen::Map<const Eigen::Matrix3Xf> points(vertices.data(), 3, static_cast<Eigen::Index>(vertices.size() / 3));
    const Vector3d middle = points.cast<double>().rowwise().mean();
    // The camera follows smoothly, because jitter of the mean would shake the image.
    middle_ = frame == 0 ? middle : Vector3d(0.85 * middle_ + 0.15 * middle);
    const double angle = 2 * kPi * options_.turns_per_second * frame / options_.frames_per_second;
    PinholeCamera camera;
    camera.name = name();
    camera.width = camera.height = options_.size;
    camera.K << 1.8 * options_.size, 0, 0.5 * options_.size, 0, 1.8 * options_.size, 0.5 * options_.size, 0, 0, 1;
    camera.R.row(1) = Vector3d(0, -1, 0);
    camera.R.row(2) = Vector3d(-std::sin(angle), 0, -std::cos(angle));
    camera.R.row(0) = camera.R.row(1).cross(camera.R.row(2));
    camera.t = -camera.R * (middle_ - distance_ * camera.R.row(2).transpose());
    return camera;
  }
  std::string name() const override { return "turntable"; }
  int width() const override { return options_.size; }
  int height() const override { return options_.size; }

 private:
  OrbitOptions options_;
  double distance_ = 0.0;
  Vector3d middle_ = Vector3d::Zero();
};

class CalibratedPath : public CameraPath {
 public:
  CalibratedPath(std::vector<PinholeCamera> cameras, std::string name, double step)
      : cameras_(std::move(cameras)), name_("camera_" + std::move(name)), step_(step) {}
  PinholeCamera at(int frame, std::span<const float>) override {
    return cameras_[std::min(as_size(std::lround(frame * step_)), cameras_.size() - 1)];
  }
  std::string name() const override { return name_; }
  int width() const override { return cameras_.front().width; }
  int height() const override { return cameras_.front().height; }

 private:
  std::vector<PinholeCamera> cameras_;
  std::string name_;
  double step_;
};

int even(double pixels) { return std::max(2, 2 * static_cast<int>(std::lround(pixels / 2))); }

Camera at_size(const Camera& camera, int size) {
  const double scale = size == 0 ? 1.0 : static_cast<double>(size) / std::max(camera.width, camera.height);
  return camera.scaled_to(even(scale * camera.width), even(scale * camera.height));
}

}  // namespace

std::unique_ptr<CameraPath> make_orbit(const Character& character, const OrbitOptions& options) {
  return std::make_unique<Orbit>(character, options);
}

std::unique_ptr<CameraPath> make_calibrated_path(const std::vector<Camera>& cameras, const std::string& name, int size,
                                                 double step) {
  std::vector<PinholeCamera> chosen;
  std::vector<std::string> names;
  for (const Camera& camera : cameras) {
    const std::string own = camera.name.substr(0, camera.name.find('@'));
    if (names.empty() || names.back() != own) names.push_back(own);
    if (camera.name != name && own != name) continue;
    chosen.push_back(without_distortion(at_size(camera, size)));
    if (camera.has_distortion())
      log::warn("camera {} has a distorted lens; the image is drawn without distortion", camera.name);
  }
  if (chosen.empty())
    fail<UsageError>("there is no camera '{}'; the cameras are {}{}", name, fmt::join(names, ", "),
                     nearest_word_hint(name, names));
  return std::make_unique<CalibratedPath>(std::move(chosen), name, step);
}

}  // namespace doppel
