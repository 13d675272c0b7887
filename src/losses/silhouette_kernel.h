#pragma once

#include <cstdint>
#include <vector>

/// The fused silhouette loss of one camera: value and gradient in one pass over the boundary vertices and contour
/// pixels.
///
/// The code is scalar: some hundreds of scattered vertices and pixels per camera leave nothing to vectorise. It is fast
/// because it reads only these vertices and pixels.
namespace doppel::silhouette {

struct CameraInput {
  const float* vertices;  ///< [N,3]
  const float* normals;   ///< [N,3]
  const bool* boundary;   ///< [N]
  std::int64_t num_vertices;
  const float* projection;  ///< [3,4]
  const float* distance;    ///< [S,S]
  std::int64_t size;        ///< S
  const float* contour;     ///< [P,2]
  std::int64_t num_contour;
  float residual_scale;  ///< residual per crop pixel, model to data
  float inset;           ///< crop pixels inside the outline where that residual is 0
  float contour_scale;   ///< residual per crop pixel, data to model
  float radius;          ///< data to model, crop pixels
  bool model_to_data, data_to_model;
};

/// A boundary vertex and the gradient of both sums at it.
struct VertexGradient {
  std::int32_t vertex;
  float gradient[2][3];
};

struct CameraResult {
  double value[2] = {0, 0};
  std::vector<VertexGradient> gradients;  ///< ascending by vertex
};

/// Boundary vertices in the image, with the gradient to their pixel.
struct BoundaryPoint {
  std::int32_t vertex;
  float u, v, w;
  float gradient[2][2];  ///< [sum][u,v]
};

/// Finds the nearest of a set of points with buckets, the first among equally near points.
class NearestPoint {
 public:
  void build(const std::vector<BoundaryPoint>& points, std::int64_t size);
  /// @return index into the points, or -1 if none lies within `radius`
  int find(float u, float v, float radius) const;

 private:
  void visit(int x, int y, float u, float v, float& best, int& index) const;
  const std::vector<BoundaryPoint>* points_ = nullptr;
  int cells_ = 0;
  std::vector<int> offsets_, items_;
};

/// Memory that is reused for the next camera.
struct CameraScratch {
  std::vector<BoundaryPoint> points;
  NearestPoint nearest;
};

CameraResult evaluate_camera(const CameraInput& in, CameraScratch& scratch);

}  // namespace doppel::silhouette
