#pragma once

#include <Eigen/Core>
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
  /// What one camera saw of each texel.
  struct Sum {
    cv::Mat colour;  ///< CV_32FC3, weighted sum, BGR 0..255
    cv::Mat weight;  ///< CV_32F
    explicit Sum(int size) : colour(cv::Mat::zeros(size, size, CV_32FC3)), weight(cv::Mat::zeros(size, size, CV_32F)) {}
    void add(const cv::Mat& colour, const cv::Mat& weight);
    cv::Mat mean() const;
  };
  cv::Mat seen_weight() const;
  cv::Mat corrected_sum(const std::map<int, cv::Vec3d>& gains) const;
  cv::Mat spread_colours(const cv::Mat& colour, const cv::Mat& weight) const;

  const TriangleMesh& mesh_;
  TextureSpace space_;
  Rasterizer rasterizer_;
  std::map<int, Sum> cameras_;  ///< of the low frequencies
  Sum detail_;                  ///< of the high frequencies, of all cameras
};

}  // namespace doppel
