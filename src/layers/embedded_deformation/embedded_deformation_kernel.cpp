#include "doppel/layers/embedded_deformation/embedded_deformation_kernel.h"

#include "doppel/layers/embedded_deformation/euler_lanes.h"
#include "doppel/layers/lanes.h"

// With v and g relative to the centre c of the template:
//   y - c = v + D + sum w ((R - I) v + (T + g - R g))
//   x - o = sum w (R_M (y - c) + R_M c + t_M - o)
// so that large sums cost no digits of small deformations or of people far from the origin.

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr int kBlock = 16;  // vertices or nodes transposed at a time

inline int block_size(int64_t start, int64_t end) {
  return static_cast<int>(end - start < kBlock ? end - start : kBlock);
}

/// Loads rows [start, start+n) of a [B,rows,width] tensor for the current items, [n,width,L].
template <int L>
inline void load_rows(const DeformationParams& p, const float* tensor, int64_t rows, int width, int64_t start, int n,
                      float* lanes) {
  const int64_t stride = rows * width;
  to_lanes<L>(tensor + p.first * stride + start * width, stride, p.count, width * n, lanes);
}
template <int L>
inline void store_rows(const DeformationParams& p, const float* lanes, int64_t rows, int width, int64_t start, int n,
                       float* tensor) {
  const int64_t stride = rows * width;
  from_lanes<L>(lanes, width * n, tensor + p.first * stride + start * width, stride, p.count);
}

template <int L>
void prepare(const DeformationParams& p, int64_t begin, int64_t end) {
  alignas(64) float angles[kBlock * 3 * L], translations[kBlock * 3 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    load_rows<L>(p, p.angles, p.num_nodes, 3, start, n, angles);
    load_rows<L>(p, p.translations, p.num_nodes, 3, start, n, translations);
    for (int i = 0; i < n; ++i) {
      Vector<L> R[9], axis_y[2];
      euler_rotation<L>(angles + 3 * i * L, R, axis_y);
      const float* g = p.nodes + 3 * (start + i);
      float* entry = p.table + (start + i) * 12 * L;
      for (int r = 0; r < 3; ++r) {
        R[4 * r] -= 1.0f;
        for (int k = 0; k < 3; ++k) store<L>(entry + (4 * r + k) * L, R[3 * r + k]);
        const Vector<L> moved = R[3 * r] * g[0] + R[3 * r + 1] * g[1] + R[3 * r + 2] * g[2];
        store<L>(entry + (4 * r + 3) * L, load<L>(translations + (3 * i + r) * L) - moved);
      }
    }
    if (!p.node_transforms) continue;
    float* entries = p.pose_table + start * 12 * L;
    load_rows<L>(p, p.node_transforms, p.num_nodes, 12, start, n, entries);
    for (int i = 0; i < 3 * n; ++i) {
      float* row = entries + 4 * i * L;
      const Vector<L> turned =
          load<L>(row) * p.centre[0] + load<L>(row + L) * p.centre[1] + load<L>(row + 2 * L) * p.centre[2];
      store<L>(row + 3 * L, turned + (load<L>(row + 3 * L) - load<L>(p.origin + (i % 3) * L)));
    }
  }
}

/// sum w of [3,4] table entries.
template <int L>
inline void blend(const DeformationParams& p, const float* table, int64_t vertex, Vector<L>* sum) {
  for (int c = 0; c < 12; ++c) sum[c] = Vector<L>{};
  for (int32_t e = p.offsets[vertex]; e < p.offsets[vertex + 1]; ++e) {
    const float* entry = table + static_cast<int64_t>(p.items[e]) * 12 * L;
    const float w = p.weights[e];
    for (int c = 0; c < 12; ++c) sum[c] += w * load<L>(entry + c * L);
  }
}

/// y - c of one vertex; `displacement` [3,L] or null.
template <int L>
inline void canonical_position(const DeformationParams& p, int64_t vertex, const float* displacement, Vector<L>* y) {
  Vector<L> m[12];
  blend<L>(p, p.table, vertex, m);
  const float* v = p.rest + 3 * vertex;
  for (int r = 0; r < 3; ++r) {
    Vector<L> moved = m[4 * r] * v[0] + m[4 * r + 1] * v[1] + m[4 * r + 2] * v[2] + m[4 * r + 3];
    if (displacement) moved += load<L>(displacement + r * L);
    y[r] = moved + v[r];
  }
}

template <int L>
void forward(const DeformationParams& p, int64_t begin, int64_t end) {
  alignas(64) float displacements[kBlock * 3 * L], results[kBlock * 3 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    if (p.displacements) load_rows<L>(p, p.displacements, p.num_vertices, 3, start, n, displacements);
    for (int i = 0; i < n; ++i) {
      Vector<L> y[3];
      canonical_position<L>(p, start + i, p.displacements ? displacements + 3 * i * L : nullptr, y);
      float* result = results + 3 * i * L;
      if (!p.node_transforms) {
        for (int r = 0; r < 3; ++r) store<L>(result + r * L, y[r] + p.centre[r]);
        continue;
      }
      Vector<L> m[12];
      blend<L>(p, p.pose_table, start + i, m);
      for (int r = 0; r < 3; ++r) {
        const Vector<L> local = m[4 * r] * y[0] + m[4 * r + 1] * y[1] + m[4 * r + 2] * y[2] + m[4 * r + 3];
        store<L>(result + r * L, local + load<L>(p.origin + r * L));
      }
    }
    store_rows<L>(p, results, p.num_vertices, 3, start, n, p.out);
  }
}

template <int L>
void backward_vertices(const DeformationParams& p, int64_t begin, int64_t end) {
  if (!p.node_transforms) {
    // x = y: the nodes gather the gradient unchanged.
    for (int64_t start = begin; start < end; start += kBlock) {
      load_rows<L>(p, p.grad_out, p.num_vertices, 3, start, block_size(start, end),
                   p.canonical_gradient + start * 3 * L);
    }
    return;
  }
  alignas(64) float displacements[kBlock * 3 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    load_rows<L>(p, p.grad_out, p.num_vertices, 3, start, n, p.posed_gradient + start * 3 * L);
    if (p.displacements) load_rows<L>(p, p.displacements, p.num_vertices, 3, start, n, displacements);
    for (int i = 0; i < n; ++i) {
      const int64_t position = (start + i) * 3 * L;
      Vector<L> m[12];
      if (p.grad_node_transforms) {
        Vector<L> y[3];
        canonical_position<L>(p, start + i, p.displacements ? displacements + 3 * i * L : nullptr, y);
        for (int r = 0; r < 3; ++r) store<L>(p.canonical + position + r * L, y[r]);
      }
      // x = M y: dL/dy = M^T dL/dx.
      blend<L>(p, p.pose_table, start + i, m);
      const float* g = p.posed_gradient + position;
      for (int k = 0; k < 3; ++k) {
        store<L>(p.canonical_gradient + position + k * L,
                 m[k] * load<L>(g) + m[4 + k] * load<L>(g + L) + m[8 + k] * load<L>(g + 2 * L));
      }
    }
    if (p.grad_displacements) {
      store_rows<L>(p, p.canonical_gradient + start * 3 * L, p.num_vertices, 3, start, n, p.grad_displacements);
    }
  }
}

/// Gradients of one node's angles and translation, [3,L] each.
template <int L>
inline void node_adjoint(const DeformationParams& p, int64_t node, const float* angles, float* grad_angles,
                         float* grad_translation) {
  // y = ... + w (R (v - g) + T): dL/dR = sum w h (v - g)^T, dL/dT = sum w h with h = dL/dy.
  Vector<L> G[9], T[3];
  for (int c = 0; c < 9; ++c) G[c] = Vector<L>{};
  for (int c = 0; c < 3; ++c) T[c] = Vector<L>{};
  const float* g = p.nodes + 3 * node;
  for (int32_t e = p.transposed_offsets[node]; e < p.transposed_offsets[node + 1]; ++e) {
    const int64_t vertex = p.transposed_items[e];
    const float* h = p.canonical_gradient + vertex * 3 * L;
    const float* v = p.rest + 3 * vertex;
    const float d[3] = {v[0] - g[0], v[1] - g[1], v[2] - g[2]};
    for (int r = 0; r < 3; ++r) {
      const Vector<L> weighted = p.transposed_weights[e] * load<L>(h + r * L);
      T[r] += weighted;
      for (int k = 0; k < 3; ++k) G[3 * r + k] += weighted * d[k];
    }
  }
  for (int r = 0; r < 3; ++r) store<L>(grad_translation + r * L, T[r]);
  euler_adjoint<L>(angles, G, grad_angles);
}

/// Gradient to one node transform, [12,L].
template <int L>
inline void node_transform_adjoint(const DeformationParams& p, int64_t node, float* grad) {
  // x = ... + w (R (y - c) + R c + t): dL/dR = sum w g (y - c)^T + (sum w g) c^T, dL/dt = sum w g with g = dL/dx.
  Vector<L> G[12];
  for (int c = 0; c < 12; ++c) G[c] = Vector<L>{};
  for (int32_t e = p.transposed_offsets[node]; e < p.transposed_offsets[node + 1]; ++e) {
    const int64_t position = static_cast<int64_t>(p.transposed_items[e]) * 3 * L;
    Vector<L> y[3];
    for (int k = 0; k < 3; ++k) y[k] = load<L>(p.canonical + position + k * L);
    for (int r = 0; r < 3; ++r) {
      const Vector<L> weighted = p.transposed_weights[e] * load<L>(p.posed_gradient + position + r * L);
      for (int k = 0; k < 3; ++k) G[4 * r + k] += weighted * y[k];
      G[4 * r + 3] += weighted;
    }
  }
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 3; ++k) store<L>(grad + (4 * r + k) * L, G[4 * r + k] + G[4 * r + 3] * p.centre[k]);
    store<L>(grad + (4 * r + 3) * L, G[4 * r + 3]);
  }
}

template <int L>
void backward_nodes(const DeformationParams& p, int64_t begin, int64_t end) {
  alignas(64) float angles[kBlock * 3 * L], grad_angles[kBlock * 3 * L], grad_translations[kBlock * 3 * L];
  alignas(64) float grad_transforms[kBlock * 12 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    if (p.grad_angles) {
      load_rows<L>(p, p.angles, p.num_nodes, 3, start, n, angles);
      for (int i = 0; i < n; ++i) {
        node_adjoint<L>(p, start + i, angles + 3 * i * L, grad_angles + 3 * i * L, grad_translations + 3 * i * L);
      }
      store_rows<L>(p, grad_angles, p.num_nodes, 3, start, n, p.grad_angles);
      store_rows<L>(p, grad_translations, p.num_nodes, 3, start, n, p.grad_translations);
    }
    if (p.grad_node_transforms) {
      for (int i = 0; i < n; ++i) node_transform_adjoint<L>(p, start + i, grad_transforms + 12 * i * L);
      store_rows<L>(p, grad_transforms, p.num_nodes, 12, start, n, p.grad_node_transforms);
    }
  }
}

}  // namespace

int deformation_lanes(int64_t count) { return lanes_for(count); }

void deformation_prepare_origin(const DeformationParams& p) {
  for (int lane = 0; lane < p.lanes; ++lane) {
    const int64_t item = p.first + (lane < p.count ? lane : p.count - 1);
    const float* m = p.node_transforms + item * p.num_nodes * 12;
    for (int r = 0; r < 3; ++r) {
      p.origin[r * p.lanes + lane] =
          m[4 * r] * p.centre[0] + m[4 * r + 1] * p.centre[1] + m[4 * r + 2] * p.centre[2] + m[4 * r + 3];
    }
  }
}

void deformation_prepare(const DeformationParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { prepare<decltype(lanes)::value>(p, begin, end); });
}

void deformation_forward(const DeformationParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { forward<decltype(lanes)::value>(p, begin, end); });
}

void deformation_backward_vertices(const DeformationParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { backward_vertices<decltype(lanes)::value>(p, begin, end); });
}

void deformation_backward_nodes(const DeformationParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { backward_nodes<decltype(lanes)::value>(p, begin, end); });
}

}  // namespace doppel::kernels::DOPPEL_ISA
