#include "doppel/render/raster/face_table.h"

#include <limits>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"

namespace doppel::render {

FaceTable make_face_table(const torch::Tensor& faces, const char* caller) {
  check_tensor(caller, "faces", faces, {torch::kInt32, torch::kInt64}, {-1, 3}, "[F,3]");
  if (!faces.device().is_cpu())
    fail<UsageError>("{}: faces are on {}; they must be on the CPU", caller, faces.device().str());
  if (faces.size(0) > std::numeric_limits<std::int32_t>::max() / 4) {
    fail<UsageError>("{}: {} faces; at most {} can be drawn", caller, faces.size(0),
                     std::numeric_limits<std::int32_t>::max() / 4);
  }
  const torch::Tensor wide = faces.to(torch::kInt64).contiguous();
  const std::int64_t* in = wide.data_ptr<std::int64_t>();
  FaceTable table;
  table.num_faces = faces.size(0);
  table.corners.assign(4 * table.num_faces, 0);
  for (std::int64_t f = 0; f < table.num_faces; ++f) {
    for (std::int64_t k = 0; k < 3; ++k) {
      const std::int64_t vertex = in[3 * f + k];
      if (vertex < 0 || vertex >= std::numeric_limits<std::int32_t>::max()) {
        fail<UsageError>("{}: corner {} of face {} is vertex {}; indices start at 0", caller, k, f, vertex);
      }
      table.corners[4 * f + k] = static_cast<std::int32_t>(vertex);
      table.num_vertices = std::max(table.num_vertices, vertex + 1);
    }
  }
  return table;
}

void check_image_size(std::int64_t height, std::int64_t width, const char* caller) {
  if (height < 1 || width < 1 || height > kernels::kMaxImage || width > kernels::kMaxImage) {
    fail<UsageError>("{}: an image of {} x {} pixels; width and height must be 1 to {}", caller, width, height,
                     kernels::kMaxImage);
  }
}

void check_corners(const char* caller, const FaceTable& faces, std::int64_t num_vertices) {
  if (faces.num_vertices > num_vertices)
    fail<UsageError>("{}: a face names vertex {}, and there are only {}", caller, faces.num_vertices - 1, num_vertices);
}

void check_drawing(const char* caller, const torch::Tensor& vertices, const torch::Tensor& projection,
                   const FaceTable& faces, std::int64_t height, std::int64_t width) {
  check_floats(caller, "vertices", vertices, {-1, -1, 3}, "[B,N,3]");
  check_floats(caller, "projection", projection, {vertices.size(0), -1, 3, 4}, "[B,C,3,4]");
  check_image_size(height, width, caller);
  check_corners(caller, faces, vertices.size(1));
}

}  // namespace doppel::render
