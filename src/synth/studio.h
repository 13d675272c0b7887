#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/synth/clothing.h"
#include "doppel/geometry/camera.h"

namespace doppel::synth {

struct StudioOptions {
  int supersampling = 3;  ///< samples per pixel along each axis; odd, so that coverage is never exactly one half
  int shadow_size = 768;  ///< texels of the shadow map along each axis
  double noise = 1.5;     ///< standard deviation of the sensor noise, of 255
  std::uint64_t seed = 1;
};

/// Cameras on a ring around the floor's middle, at two heights in turn, each a little different in focal length,
/// principal point and aim. Square images of `size` pixels in which the actor never touches the border.
std::vector<Camera> make_cameras(int count, int size, std::uint64_t seed);

/// A green studio with one key light and soft light from everywhere, in which the actor is filmed.
class Studio {
 public:
  Studio(const Actor& actor, std::vector<Camera> cameras, const StudioOptions& options = {});
  ~Studio();

  /// The actor's surface for the images that follow. @param vertices [N] world metres
  void set_surface(const Points& vertices);

  struct Shot {
    cv::Mat image;  ///< 8-bit BGR
    cv::Mat mask;   ///< 8-bit, 255 where more than half of the pixel is covered
  };
  /// Takes an image. @param noise_key another number gives another noise
  Shot shoot(int camera, std::uint64_t noise_key);
  /// Whether a point is seen in the last image taken by `shoot`, or lies at most `depth` metres behind what is.
  bool sees(int camera, const Eigen::Vector3d& point, double depth) const;
  /// The empty studio without noise.
  cv::Mat background(int camera) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel::synth
