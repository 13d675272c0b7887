#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/texture/texture_space.h"

namespace doppel {

/// Makes a texture from images of a surface whose position is known in each of them.
///
/// A texel takes the mean of the images in which its point of the surface is visible, weighted by the sixth power of
/// the cosine between the normal and the direction to the camera: the views that face the surface decide, and the
/// weights fall smoothly to 0 where another view takes over. Points nearer than two pixels to the outline of a nearer
/// part, or to the mask's, do not count. That is for the low frequencies of an image. The high ones, which a mean of
/// views that do not quite agree would remove, are taken from the sharpest views: nearly only those that face the
/// surface most, from nearest by. Each camera gets one gain for each colour channel, so that they agree where
/// they see the same texels. Texels that no camera sees get colours that vary smoothly over the surface between those
/// that are seen.
class TextureBake {
 public:
  /// @param mesh with UVs @param size texels along each side. @throws UsageError as TextureSpace
  TextureBake(const TriangleMesh& mesh, int size);

  /// Adds an image.
  /// @param vertices [N] world metres @param camera a number for each camera, for the gains
  /// @param image 8-bit BGR of the camera's size @param mask 0 or 255, of the same size; empty: everything counts
  void add(const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera, int number, const cv::Mat& image,
           const cv::Mat& mask);

  /// The texture, 8-bit BGR [size, size]. @throws Error when no image showed the surface
  cv::Mat texture() const;
  /// The share of the surface's texels that an image showed.
  double coverage() const;
  /// The gains of each camera, BGR; their geometric mean over the cameras is 1.
  std::map<int, cv::Vec3d> gains() const;

 private:
  /// Weighted colours of the texels, BGR 0..255.
  struct Sum {
    std::vector<cv::Vec3f> colour;
    std::vector<float> weight;
    explicit Sum(int texels) : colour(texels), weight(texels) {}
    void add(int texel, const cv::Vec3f& colour, float weight);
    cv::Vec3f mean(int texel) const { return colour[texel] / std::max(weight[texel], 1e-12F); }
  };
  int num_texels() const;
  Sum evened_sum() const;
  std::vector<cv::Vec3f> spread_colours(const Sum& seen) const;

  const TriangleMesh& mesh_;
  int size_;
  TexelPoints texels_;  ///< those with a point of the surface
  Rasterizer rasterizer_;
  std::map<int, Sum> cameras_;  ///< of the low frequencies
  Sum detail_;                  ///< of the high frequencies, of all cameras
};

}  // namespace doppel
