#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/geometry/camera.h"
#include "doppel/geometry/mesh.h"

namespace doppel {

/// `count` cameras on a circle around a box. Each sees the whole box and looks at its middle. The first camera stands
/// on the side of +z, the next ones towards +x.
/// @param elevation of the cameras above the middle of the box, radians
/// @param phase of the first camera, in steps between two cameras
/// @param size of the square images, pixels
std::vector<PinholeCamera> cameras_around(const Eigen::AlignedBox3d& box, int count, double elevation, double phase,
                                          int size);

/// Draws a mesh as a photograph of a person: its texture or colours, or the colour of clay, under a lamp beside the
/// camera, before a grey wall. Both sides of a face are drawn.
class ScanPainter {
 public:
  /// @param mesh metres; must outlive the painter
  explicit ScanPainter(const TriangleMesh& mesh);
  ~ScanPainter();
  ScanPainter(const ScanPainter&) = delete;
  ScanPainter& operator=(const ScanPainter&) = delete;

  /// @return 8-bit BGR
  cv::Mat draw(const PinholeCamera& camera);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
