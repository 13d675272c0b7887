#include "doppel/render/face_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <limits>
#include <sstream>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel::render {

std::string describe(const torch::Tensor& t) {
  if (!t.defined()) return "no tensor";
  std::ostringstream text;
  text << t.dtype().name() << " " << t.sizes() << " on " << t.device();
  return text.str();
}

std::string describe_sizes(torch::IntArrayRef sizes) { return fmt::format("[{}]", fmt::join(sizes, ",")); }

namespace {

std::string wanted(torch::IntArrayRef sizes) {
  std::string text = "[";
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    text += (i ? "," : "") + (sizes[i] < 0 ? std::string("any") : std::to_string(sizes[i]));
  }
  return text + "]";
}

}  // namespace

FaceTable make_face_table(const torch::Tensor& faces, const char* caller) {
  const bool integers = faces.defined() && (faces.dtype() == torch::kInt32 || faces.dtype() == torch::kInt64);
  if (!integers || !faces.device().is_cpu() || faces.dim() != 2 || faces.size(1) != 3) {
    fail<UsageError>("{}: faces are {}; they must be int32 or int64 [F,3] on the CPU", caller, describe(faces));
  }
  if (faces.size(0) > std::numeric_limits<std::int32_t>::max() / 4) {
    fail<UsageError>("{}: {} faces; at most {} can be drawn", caller, faces.size(0),
                     std::numeric_limits<std::int32_t>::max() / 4);
  }
  const torch::Tensor wide = faces.to(torch::kInt64).contiguous();
  const std::int64_t* in = wide.data_ptr<std::int64_t>();
  FaceTable table;
  table.num_faces = faces.size(0);
  table.corners.assign(as_size(4 * table.num_faces), 0);
  for (std::int64_t f = 0; f < table.num_faces; ++f) {
    for (std::int64_t k = 0; k < 3; ++k) {
      const std::int64_t vertex = in[3 * f + k];
      if (vertex < 0 || vertex >= std::numeric_limits<std::int32_t>::max()) {
        fail<UsageError>("{}: corner {} of face {} is vertex {}; indices start at 0", caller, k, f, vertex);
      }
      table.corners[as_size(4 * f + k)] = static_cast<std::int32_t>(vertex);
      table.num_vertices = std::max(table.num_vertices, vertex + 1);
    }
  }
  return table;
}

void check_floats(const torch::Tensor& t, const char* caller, const char* name, torch::IntArrayRef sizes) {
  bool good = t.defined() && t.dtype() == torch::kFloat32 && t.device().is_cpu() &&
              t.dim() == static_cast<std::int64_t>(sizes.size());
  for (std::size_t i = 0; good && i < sizes.size(); ++i) {
    good = sizes[i] < 0 || t.size(static_cast<std::int64_t>(i)) == sizes[i];
  }
  if (!good) fail<UsageError>("{}: {} is {}; it must be float {} on the CPU", caller, name, describe(t), wanted(sizes));
}

void check_image_size(std::int64_t height, std::int64_t width, const char* caller) {
  if (height < 1 || width < 1 || height > kernels::kMaxImage || width > kernels::kMaxImage) {
    fail<UsageError>("{}: an image of {} x {} pixels; width and height must be 1 to {}", caller, width, height,
                     kernels::kMaxImage);
  }
}

}  // namespace doppel::render
