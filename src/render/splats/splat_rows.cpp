#include "doppel/render/splats/splat_rows.h"

#include "doppel/core/tensor/checks.h"
#include "doppel/render/projection.h"
#include "doppel/render/splats/splats.h"
#include "doppel/render/splats/surface_frames.h"

namespace doppel {

using torch::Tensor;

namespace {
constexpr double kMinOpacity = 1e-6;
constexpr double kMinDeviation = 1e-12;  // metres
}  // namespace

Tensor splat_rows(const Splats& splats, const Tensor& projection) {
  check_splats("splat_rows", splats);
  check_shape("splat_rows", "projection", projection, {splats.positions.size(0), 3, 4}, "[B,3,4]");
  const Tensor offset = splats.positions - camera_placement(projection).centre.unsqueeze(1),
               direction = unit_vectors(offset);
  const Tensor basis = view_harmonics(direction, splats.harmonics.size(2));
  const Tensor colours = ((basis.unsqueeze(3) * splats.harmonics).sum(2) + 0.5).clamp_min(0.0);
  Tensor opacities = splats.opacities.sigmoid().unsqueeze(2);
  if (splats.normals.defined()) opacities = opacities * ((splats.normals * offset).sum(2, true) <= 0);
  return torch::cat({splats.positions, unit_vectors(splats.rotations), splats.log_scales.exp(), opacities, colours}, 2);
}

Splats splats_of_rows(const Tensor& rows) {
  check_shape("splats_of_rows", "rows", rows, {-1, -1, kSplatColumns}, "[B,N,14]");
  const Tensor opacity = rows.select(2, 10).clamp(kMinOpacity, 1.0 - kMinOpacity);
  return {rows.narrow(2, 0, 3).contiguous(),
          rows.narrow(2, 3, 4).contiguous(),
          rows.narrow(2, 7, 3).clamp_min(kMinDeviation).log(),
          (opacity / (1.0 - opacity)).log(),
          ((rows.narrow(2, 11, 3) - 0.5) / kFirstHarmonic).unsqueeze(2),
          {}};
}

}  // namespace doppel
