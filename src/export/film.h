#pragma once

#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "doppel/export/animation.h"
#include "doppel/export/camera_path.h"
#include "doppel/nets/field_view.h"

namespace doppel {

/// What stands behind the actor: an image, or one colour.
struct Backdrop {
  cv::Mat image;                    ///< 8-bit BGR; empty: the colour
  cv::Vec3b colour{52, 46, 44};       ///< BGR
  std::string name = "the backdrop";  ///< of the image, for messages
};
/// `#rrggbb`, or one of the words black, white, grey, green, blue. @throws UsageError for anything else
cv::Vec3b parse_colour(const std::string& text);
/// The image at `width` x `height`: resized, and cut evenly at two sides where `may_crop` allows it.
/// @throws UsageError when the proportions differ by more than 1 % and it may not be cropped
cv::Mat fit_backdrop(const Backdrop& backdrop, int width, int height, bool may_crop);

/// How the surface is lit: softly from above the camera, or not at all (the texture as it is, which carries the light
/// of the studio it was scanned in).
enum class Light { soft, flat };

struct FilmOptions {
  double frames_per_second = 25.0;
  Light light = Light::soft;
  Backdrop backdrop;
  bool video = true;      ///< `<path's name>.mp4`
  bool images = false;  ///< `<path's name>_000000.png`, ...
  int supersampling = 3;  ///< per side of a pixel
  /// Its dynamic texture is shown where it has one, unlit: it carries the light of the capture. May be null; must
  /// outlive the writer.
  const ActorFile* actor = nullptr;
  /// Its radiance field is shown in place of the mesh where this is there: what a camera (projection [3,4]) sees at the
  /// end of a window [1,F+1,D], in H x W pixels.
  std::function<FieldImage(const torch::Tensor&, const torch::Tensor&, std::int64_t, std::int64_t)> radiance;
};

/// Films the textured surface from a camera path, over a backdrop. A character without texture is grey.
/// @throws Error while writing, when the camera stands inside the surface (with the frame)
std::unique_ptr<SequenceWriter> make_film_writer(const std::filesystem::path& folder, const Character& character,
                                                 std::unique_ptr<CameraPath> path, const FilmOptions& options);

/// How often a closed surface winds around a point: 1 inside, 0 outside.
/// @param vertices [N,3]
double winding_number(const TriangleMesh& mesh, const float* vertices, const Eigen::Vector3d& point);

}  // namespace doppel
