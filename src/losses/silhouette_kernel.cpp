#include "doppel/losses/silhouette_kernel.h"

#include <algorithm>
#include <cmath>

#include "doppel/losses/silhouette_terms.h"

namespace doppel::silhouette {
namespace {

constexpr int kCell = 8;  ///< pixels; about the distance between contour and vertex in training

float row(const float* p, int r, const float* x) { return p[4 * r] * x[0] + p[4 * r + 1] * x[1] + p[4 * r + 2] * x[2]; }

void collect_points(const CameraInput& in, std::vector<BoundaryPoint>& points) {
  points.clear();
  for (std::int64_t i = 0; i < in.num_vertices; ++i) {
    if (!in.boundary[i]) continue;
    const float* x = in.vertices + 3 * i;
    const float* p = in.projection;
    const float w = row(p, 2, x) + p[11];
    if (!(w > 0)) continue;
    points.push_back(
        {static_cast<std::int32_t>(i), (row(p, 0, x) + p[3]) / w, (row(p, 1, x) + p[7]) / w, w, {{0, 0}, {0, 0}}});
  }
}

/// r = d / scale, value r^2, gradient rho 2 r grad r.
double pull_to_outline(const CameraInput& in, BoundaryPoint& point) {
  const auto inset = static_cast<float>(kInset), limit = static_cast<float>(in.size) - inset;
  if (!(point.u >= inset && point.v >= inset && point.u <= limit && point.v <= limit)) return 0;
  const float x = point.u - 0.5f, y = point.v - 0.5f;
  const auto x0 = std::min(static_cast<std::int64_t>(x), in.size - 2),
             y0 = std::min(static_cast<std::int64_t>(y), in.size - 2);
  const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
  const float* d = in.distance + y0 * in.size + x0;
  const float d00 = d[0], d10 = d[1], d01 = d[in.size], d11 = d[in.size + 1];
  const float top = d00 + fx * (d10 - d00), bottom = d01 + fx * (d11 - d01);
  const float distance = top + fy * (bottom - top) + in.inset;
  const float du = (1 - fy) * (d10 - d00) + fy * (d11 - d01), dv = (1 - fx) * (d01 - d00) + fx * (d11 - d10);

  const float* n = in.normals + 3 * static_cast<std::int64_t>(point.vertex);
  const float* p = in.projection;
  const float nw = row(p, 2, n);
  const float nu = row(p, 0, n) - point.u * nw, nv = row(p, 1, n) - point.v * nw;  // times w > 0; the sign suffices
  const float rho = distance < 0 && nu * du + nv * dv < 0 ? -1.0f : 1.0f;

  const float residual = distance * in.residual_scale;
  point.gradient[0][0] = rho * 2 * residual * in.residual_scale * du;
  point.gradient[0][1] = rho * 2 * residual * in.residual_scale * dv;
  return static_cast<double>(residual) * residual;
}

double pull_to_contour(const CameraInput& in, CameraScratch& scratch) {
  scratch.nearest.build(scratch.points, in.size);
  double value = 0;
  for (std::int64_t i = 0; i < in.num_contour; ++i) {
    const float u = in.contour[2 * i], v = in.contour[2 * i + 1];
    const int nearest = scratch.nearest.find(u, v, in.radius);
    if (nearest < 0) continue;
    BoundaryPoint& point = scratch.points[static_cast<std::size_t>(nearest)];
    const float ru = (point.u - u) * in.contour_scale, rv = (point.v - v) * in.contour_scale;
    value += static_cast<double>(ru) * ru + static_cast<double>(rv) * rv;
    point.gradient[1][0] += 2 * ru * in.contour_scale;
    point.gradient[1][1] += 2 * rv * in.contour_scale;
  }
  return value;
}

}  // namespace

void NearestPoint::build(const std::vector<BoundaryPoint>& points, std::int64_t size) {
  points_ = &points;
  cells_ = static_cast<int>(size / kCell) + 1;
  const auto cells = static_cast<std::size_t>(cells_);
  offsets_.assign(cells * cells + 2, 0);
  items_.resize(points.size());
  // Boundary vertices lie in the image. Vertices of a set given by the caller may not; they go to the outer cells.
  const auto cell = [this, cells](const BoundaryPoint& p) {
    const auto top = static_cast<float>(cells_ * kCell - 1);
    const auto along = [top](float x) { return static_cast<std::size_t>(std::clamp(x, 0.0f, top)) / kCell; };
    return along(p.v) * cells + along(p.u);
  };
  for (const BoundaryPoint& p : points) ++offsets_[cell(p) + 2];
  for (std::size_t i = 2; i < offsets_.size(); ++i) offsets_[i] += offsets_[i - 1];
  for (std::size_t i = 0; i < points.size(); ++i) {
    items_[static_cast<std::size_t>(offsets_[cell(points[i]) + 1]++)] = static_cast<int>(i);
  }
}

void NearestPoint::visit(int x, int y, float u, float v, float& best, int& index) const {
  if (x < 0 || y < 0 || x >= cells_ || y >= cells_) return;
  const std::size_t cell = static_cast<std::size_t>(y) * static_cast<std::size_t>(cells_) + static_cast<std::size_t>(x);
  for (int i = offsets_[cell]; i < offsets_[cell + 1]; ++i) {
    const int item = items_[static_cast<std::size_t>(i)];
    const BoundaryPoint& p = (*points_)[static_cast<std::size_t>(item)];
    const float du = u - p.u, dv = v - p.v, squared = du * du + dv * dv;
    if (squared < best || (squared == best && (index < 0 || item < index))) {
      best = squared;
      index = item;
    }
  }
}

int NearestPoint::find(float u, float v, float radius) const {
  const int cx = static_cast<int>(std::floor(u / kCell)), cy = static_cast<int>(std::floor(v / kCell));
  float best = radius * radius;
  int index = -1;
  const int last = static_cast<int>(radius / kCell) + 1;
  for (int ring = 0; ring <= last; ++ring) {
    // The distance to the cells of this ring is at least (ring - 1) cells plus the distance to the own cell's border.
    const float reach = static_cast<float>(std::max(ring - 1, 0) * kCell);
    if (index >= 0 && reach * reach > best) break;
    for (int y = cy - ring; y <= cy + ring; ++y) {
      const bool whole_row = y == cy - ring || y == cy + ring;
      for (int x = cx - ring; x <= cx + ring; x += whole_row || ring == 0 ? 1 : 2 * ring)
        visit(x, y, u, v, best, index);
    }
  }
  return index;
}

CameraResult evaluate_camera(const CameraInput& in, CameraScratch& scratch) {
  CameraResult result;
  collect_points(in, scratch.points);
  if (in.model_to_data && in.size > 2 * static_cast<std::int64_t>(kInset)) {
    for (BoundaryPoint& point : scratch.points) result.value[0] += pull_to_outline(in, point);
  }
  if (in.data_to_model && !scratch.points.empty()) result.value[1] = pull_to_contour(in, scratch);

  // u = h0/w, v = h1/w: du/dx = (P0 - u P2) / w.
  const float* p = in.projection;
  result.gradients.reserve(scratch.points.size());
  for (const BoundaryPoint& point : scratch.points) {
    VertexGradient& g = result.gradients.emplace_back();
    g.vertex = point.vertex;
    for (int d = 0; d < 3; ++d) {
      const float du = (p[d] - point.u * p[8 + d]) / point.w, dv = (p[4 + d] - point.v * p[8 + d]) / point.w;
      for (int s = 0; s < 2; ++s) g.gradient[s][d] = point.gradient[s][0] * du + point.gradient[s][1] * dv;
    }
  }
  return result;
}

}  // namespace doppel::silhouette
