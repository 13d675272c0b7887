#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

/// A textured surface, drawn in the part of a camera's image around it.
struct DrawnSurface {
  cv::Rect box;     ///< of the camera's image; empty: the surface lies outside
  cv::Mat colour;   ///< 8-bit BGR, of the size of the box; 0 where no surface is drawn
  cv::Mat covered;  ///< 8-bit, 255 where the surface is drawn, else 0
  cv::Mat depth;    ///< float32, metres along the camera's axis; infinity where no surface is drawn

  bool empty() const { return box.empty(); }
};

/// Draws a mesh with its texture, unlit, for the comparison with film.
class SurfaceDrawer {
 public:
  /// @param mesh with UVs and a texture, whose texels must not change meanwhile @throws Error without texture
  explicit SurfaceDrawer(const TriangleMesh& mesh);
  /// @param vertices [N] world metres
  DrawnSurface draw(const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera);

 private:
  std::vector<std::array<Eigen::Vector2f, 3>> corner_texels_;  ///< [F] position in the texture, texels
  cv::Mat texture_;
  Rasterizer rasterizer_;
};

}  // namespace doppel
