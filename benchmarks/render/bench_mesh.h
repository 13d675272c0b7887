#pragma once

#include <torch/types.h>

#include <string>

#include "doppel/geometry/mesh.h"

/// What every rasterizer of the benchmark draws: the mesh in the axes of one camera.
namespace doppel::bench {

struct BenchMesh {
  std::string name;
  torch::Tensor vertices;    ///< float32 [N,3], metres, bounding box centred on the origin, y up
  torch::Tensor faces;       ///< int32 [F,3], counter-clockwise from outside
  torch::Tensor corner_uvs;  ///< float32 [F,3,2]
};

/// The character of the shared capture if the environment variable DOPPEL_SHARED leads to it, else a closed body of
/// 11,024 faces made here: a capsule with bumps, a human's height and width.
BenchMesh bench_mesh();

/// The same as a mesh without tensors, without UVs.
TriangleMesh triangle_mesh(const BenchMesh& mesh);

/// float32 [V,N,3]: the mesh seen by cameras k = 0..V-1 of V, 4 m away, 45 degrees apart, that look at the origin.
torch::Tensor bench_views(const BenchMesh& mesh, int num_views);

/// One view for a peer.
struct PeerScene {
  const float* vertices;  ///< [N,3] in the camera's axes
  long num_vertices;
  const int* faces;  ///< [F,3]
  long num_faces;
  int size;             ///< square image, pixels
  float focal, centre;  ///< pixels
  int threads;
};

}  // namespace doppel::bench
