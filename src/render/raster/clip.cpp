#include "doppel/render/raster/clip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "doppel/core/as_size.h"

namespace doppel::render {
namespace {

using kernels::CutTriangle;
using kernels::RasterView;

/// A corner before the perspective division: (u w, v w, w).
struct ClipPoint {
  double u, v, w;
  bool on_screen;            ///< a vertex with a screen position
  float screen_u, screen_v;  ///< this position, which uncut neighbours also use
};

bool before(const ClipPoint& a, const ClipPoint& b) { return std::tie(a.w, a.u, a.v) < std::tie(b.w, b.u, b.v); }

/// Signed distance to one of the planes; kept where >= 0.
double distance(const ClipPoint& p, int plane, double z_near) {
  switch (plane) {
    case 0:
      return p.w - z_near;
    case 1:
      return p.u - kernels::kGuardMin * p.w;
    case 2:
      return kernels::kGuardMax * p.w - p.u;
    case 3:
      return p.v - kernels::kGuardMin * p.w;
    default:
      return kernels::kGuardMax * p.w - p.v;
  }
}

/// The intersection of an edge with a plane. The ends are sorted, so that both faces of an edge compute the same point.
ClipPoint cross(ClipPoint a, ClipPoint b, int plane, double z_near) {
  if (before(b, a)) std::swap(a, b);
  const double da = distance(a, plane, z_near), db = distance(b, plane, z_near), t = da / (da - db);
  return {a.u + t * (b.u - a.u), a.v + t * (b.v - a.v), a.w + t * (b.w - a.w), false, 0, 0};
}

struct Polygon {
  std::array<ClipPoint, 8> points;
  int size = 0;
  void add(const ClipPoint& p) { points[size++] = p; }
  const ClipPoint& operator[](int i) const { return points[i]; }
};

Polygon cut_by_plane(const Polygon& in, int plane, double z_near) {
  Polygon out;
  for (int i = 0; i < in.size; ++i) {
    const ClipPoint& a = in[i];
    const ClipPoint& b = in[(i + 1) % in.size];
    const bool keep_a = distance(a, plane, z_near) >= 0, keep_b = distance(b, plane, z_near) >= 0;
    if (keep_a) out.add(a);
    if (keep_a != keep_b) out.add(cross(a, b, plane, z_near));
  }
  return out;
}

/// 1/w as a linear function of the pixel: M^T g = (1,1,1) with the corners as rows of M.
bool inverse_depth_plane(const Polygon& face, CutTriangle& out) {
  const ClipPoint &a = face[0], &b = face[1], &c = face[2];
  const std::array<double, 3> bc{b.v * c.w - b.w * c.v, b.w * c.u - b.u * c.w, b.u * c.v - b.v * c.u};
  const std::array<double, 3> ca{c.v * a.w - c.w * a.v, c.w * a.u - c.u * a.w, c.u * a.v - c.v * a.u};
  const std::array<double, 3> ab{a.v * b.w - a.w * b.v, a.w * b.u - a.u * b.w, a.u * b.v - a.v * b.u};
  const double determinant = a.u * bc[0] + a.v * bc[1] + a.w * bc[2];
  out.izx = (bc[0] + ca[0] + ab[0]) / determinant;
  out.izy = (bc[1] + ca[1] + ab[1]) / determinant;
  out.iz = (bc[2] + ca[2] + ab[2]) / determinant;
  if (std::isfinite(out.izx) && std::isfinite(out.izy) && std::isfinite(out.iz)) return true;
  out.izx = out.izy = out.iz = 0;  // edge-on: the limits of the corners apply
  return determinant == 0;
}

std::int32_t snap(float pixels) { return static_cast<std::int32_t>(std::lrintf(pixels * kernels::kSubpixels)); }

}  // namespace

void cut_face(const RasterView& view, std::int32_t face, std::vector<CutTriangle>& out) {
  Polygon polygon;
  for (int k = 0; k < 3; ++k) {
    const std::int64_t vertex = view.faces[4 * static_cast<std::int64_t>(face) + k];
    const float* x = view.vertices + 3 * vertex;
    const float* screen = view.screen + 4 * vertex;
    std::array<double, 3> h{};
    for (std::size_t r = 0; r < 3; ++r) {
      const float* m = view.matrix + 4 * r;
      h[r] =
          static_cast<double>(m[0]) * x[0] + static_cast<double>(m[1]) * x[1] + static_cast<double>(m[2]) * x[2] + m[3];
      if (!std::isfinite(h[r])) return;
    }
    polygon.add({h[0], h[1], h[2], screen[2] > 0, screen[0], screen[1]});
  }
  CutTriangle triangle{};
  triangle.face = face;
  if (!inverse_depth_plane(polygon, triangle)) return;
  for (int plane = 0; plane < 5 && polygon.size > 0; ++plane) polygon = cut_by_plane(polygon, plane, view.z_near);
  if (polygon.size < 3) return;

  std::array<std::int32_t, 8> x{}, y{};
  triangle.iz_min = triangle.iz_max = static_cast<float>(1 / polygon[0].w);
  for (int i = 0; i < polygon.size; ++i) {
    const ClipPoint& p = polygon[i];
    const auto k = as_size(i);
    x[k] = snap(p.on_screen ? p.screen_u : static_cast<float>(p.u / p.w));
    y[k] = snap(p.on_screen ? p.screen_v : static_cast<float>(p.v / p.w));
    triangle.iz_min = std::min(triangle.iz_min, static_cast<float>(1 / p.w));
    triangle.iz_max = std::max(triangle.iz_max, static_cast<float>(1 / p.w));
  }
  for (std::size_t i = 1; i + 1 < as_size(polygon.size); ++i) {
    const std::array<std::size_t, 3> corner{0, i, i + 1};
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.x[k] = x[corner[k]];
      triangle.y[k] = y[corner[k]];
    }
    out.push_back(triangle);
  }
}

}  // namespace doppel::render
