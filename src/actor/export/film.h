#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/camera_path.h"
#include "doppel/nets/field_view.h"

namespace doppel {

/// The background of a film: an image, or one colour.
struct Backdrop {
  cv::Mat image;                      ///< 8-bit BGR; empty: the colour
  cv::Vec3b colour{52, 46, 44};       ///< BGR
  std::string name = "the backdrop";  ///< of the image, for messages
};
/// Parses `#rrggbb`, or one of the words black, white, grey, green, blue. @throws UsageError for anything else
cv::Vec3b parse_colour(const std::string& text);
/// The image at `width` x `height`: resized and, if `may_crop` is set, cropped evenly at two sides.
/// @throws UsageError when the aspect ratios differ by more than 1 % and `may_crop` is not set
cv::Mat fit_backdrop(const Backdrop& backdrop, int width, int height, bool may_crop);

/// The lighting of the surface: soft light from above the camera, or none (the texture as it is, which contains the
/// light of the studio where it was scanned).
enum class Light { soft, flat };

/// Draws an actor at the end of a motion window [1,F+1,D], whose surface has the vertices [1,N,3], in a camera
/// (projection [3,4]) with H x W pixels.
using FieldFunction = std::function<FieldImage(const torch::Tensor& window, const torch::Tensor& projection,
                                               const torch::Tensor& vertices, std::int64_t H, std::int64_t W)>;

struct FilmOptions {
  double frames_per_second = 25.0;
  Light light = Light::soft;
  Backdrop backdrop;
  bool video = true;      ///< `<path's name>.mp4`
  bool images = false;    ///< `<path's name>_000000.png`, ...
  int supersampling = 3;  ///< per side of a pixel
  /// The image that stands to the left of a frame, 8-bit BGR of any size; empty: none. Called from another thread, in
  /// the order of the frames.
  std::function<cv::Mat(int)> beside;
  /// The dynamic texture of the actor; empty: the static one. The dynamic texture is unlit, because it contains the
  /// light of the capture.
  LookFunction texture;
  /// If set, what it draws over black is shown in place of the textured mesh: a radiance field, or Gaussians.
  FieldFunction field;
  std::string field_name;      ///< of `field` in the profile
  Profile* profile = nullptr;  ///< the times of texture, drawing and files are added to it
};

/// Films the textured surface from a camera path, over a backdrop. A character without texture is grey.
/// @throws Error while writing, naming the frame, when the camera is inside the surface
std::unique_ptr<SequenceWriter> make_film_writer(const std::filesystem::path& folder, const Character& character,
                                                 std::unique_ptr<CameraPath> path, const FilmOptions& options);

/// The winding number of a closed surface around a point: 1 inside, 0 outside.
/// @param vertices [N,3]
double winding_number(const TriangleMesh& mesh, std::span<const float> vertices, const Eigen::Vector3d& point);

}  // namespace doppel
