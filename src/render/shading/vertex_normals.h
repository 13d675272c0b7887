#pragma once

#include <ATen/Parallel.h>

#include <cstdint>

#include "doppel/render/shading/shading_kernel.h"

namespace doppel::render {

/// Sums of the face normals at each vertex, by the kernels. @param of_faces [F,4] scratch @param of_vertices [N,4]
inline void sum_vertex_normals(const kernels::NormalMesh& mesh, std::int64_t num_faces, std::int64_t num_vertices,
                               float* of_faces, float* of_vertices) {
  constexpr std::int64_t kItemsPerThread = 4096;  // fewer do not pay for another thread
  at::parallel_for(0, num_faces, kItemsPerThread,
                   [&](std::int64_t begin, std::int64_t end) { kernels::face_normals(mesh, begin, end, of_faces); });
  at::parallel_for(0, num_vertices, kItemsPerThread, [&](std::int64_t begin, std::int64_t end) {
    kernels::sum_normals(mesh, of_faces, begin, end, of_vertices);
  });
}

}  // namespace doppel::render
