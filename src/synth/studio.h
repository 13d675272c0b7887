#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/synth/clothing.h"

namespace doppel::synth {

struct StudioOptions {
  int supersampling = 3;  ///< samples per pixel along each axis; odd, so that coverage is never exactly 1/2
  int shadow_size = 768;  ///< texels of the shadow map along each axis
  double noise = 1.5;     ///< standard deviation of the sensor noise, of 255
  std::uint64_t seed = 1;
};

/// Cameras on a ring around the centre of the floor, alternately at two heights, with slightly different focal lengths,
/// principal points and directions. Images are square with a side of `size` pixels; the actor never touches the border.
/// @param lens opencv: without distortion; fisheye: action cameras, 95 degrees from side to side, half as far away
/// @param room metres that the actor goes away from the centre; the cameras are farther away for it
/// @throws UsageError for another lens
std::vector<Camera> make_cameras(int count, int size, std::uint64_t seed, Lens lens = Lens::opencv, double room = 0);

/// A green studio with one key light and ambient light, in which the actor is filmed.
class Studio {
 public:
  Studio(const Actor& actor, std::vector<Camera> cameras, const StudioOptions& options = {});
  Studio(const Studio&) = delete;
  Studio& operator=(const Studio&) = delete;
  ~Studio();

  /// Sets the actor's surface for the following images. @param vertices [N] world metres
  void set_surface(const Points& vertices);

  struct Shot {
    cv::Mat image;  ///< 8-bit BGR
    cv::Mat mask;   ///< 8-bit, 255 where more than half of the pixel is covered
  };
  /// Renders an image and its mask. @param noise_key seed of the sensor noise
  Shot shoot(int camera, std::uint64_t noise_key);
  /// Whether a point is visible in the last image of `shoot`, or at most `depth` metres behind the visible surface.
  bool sees(int camera, const Eigen::Vector3d& point, double depth) const;
  /// The empty studio without noise.
  cv::Mat background(int camera) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel::synth
