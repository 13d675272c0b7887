#include "doppel/losses/arap_kernel.h"

#include "doppel/layers/embedded_deformation/euler_lanes.h"
#include "doppel/layers/lanes.h"

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr int kBlock = 16;

inline int block_size(int64_t start, int64_t end) {
  return static_cast<int>(end - start < kBlock ? end - start : kBlock);
}

template <int L>
inline void load_block(const ArapParams& p, const float* tensor, int64_t start, int n, float* lanes) {
  const int64_t stride = 3 * p.num_nodes;
  to_lanes<L>(tensor + p.first * stride + 3 * start, stride, p.count, 3 * n, lanes);
}

template <int L>
void prepare(const ArapParams& p, int64_t begin, int64_t end) {
  alignas(64) float angles[kBlock * 3 * L], translations[kBlock * 3 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    load_block<L>(p, p.angles, start, n, angles);
    load_block<L>(p, p.translations, start, n, translations);
    for (int i = 0; i < n; ++i) {
      Vector<L> R[9], axis_y[2];
      euler_rotation<L>(angles + 3 * i * L, R, axis_y);
      float* entry = p.table + (start + i) * 12 * L;
      for (int r = 0; r < 3; ++r) {
        R[4 * r] -= 1.0f;
        store<L>(entry + (9 + r) * L, load<L>(translations + (3 * i + r) * L));
      }
      for (int c = 0; c < 9; ++c) store<L>(entry + c * L, R[c]);
    }
  }
}

/// (R - I) rest + T_from - T_to, component r.
template <int L>
inline Vector<L> residual(const float* from, const float* to, const float* rest, float sign, int r) {
  const float* row = from + 3 * r * L;
  const Vector<L> turned = load<L>(row) * rest[0] + load<L>(row + L) * rest[1] + load<L>(row + 2 * L) * rest[2];
  return sign * turned + (load<L>(from + (9 + r) * L) - load<L>(to + (9 + r) * L));
}

template <int L>
void forward(const ArapParams& p, int64_t begin, int64_t end) {
  for (int64_t start = begin; start < end; start += kBlock) {
    Vector<L> sum{};
    for (int64_t node = start; node < start + block_size(start, end); ++node) {
      const float* own = p.table + node * 12 * L;
      for (int32_t e = p.offsets[node]; e < p.offsets[node + 1]; ++e) {
        const float* other = p.table + static_cast<int64_t>(p.targets[e]) * 12 * L;
        Vector<L> length{};
        for (int r = 0; r < 3; ++r) {
          const Vector<L> d = residual<L>(own, other, p.rest + 3 * e, 1.0f, r);
          length += d < 0.0f ? -d : d;
        }
        sum += p.rigidity[e] * length;
      }
    }
    float lanes[L];
    store<L>(lanes, sum);
    for (int l = 0; l < p.count; ++l) p.sums[start / kBlock] += static_cast<double>(lanes[l]);
  }
}

/// u sign(x), 0 at 0.
template <int L>
inline Vector<L> weighted_sign(Vector<L> x, float weight) {
  const Vector<L> plus = broadcast<L>(weight), none{};
  return x > 0.0f ? plus : (x < 0.0f ? -plus : none);
}

/// Gradients [3,L] of one node, from its outgoing and its incoming edges.
template <int L>
inline void node_adjoint(const ArapParams& p, int64_t node, const float* angles, float* grad_angles,
                         float* grad_translation) {
  Vector<L> G[9], T[3];
  for (int c = 0; c < 9; ++c) G[c] = Vector<L>{};
  for (int c = 0; c < 3; ++c) T[c] = Vector<L>{};
  const float* own = p.table + node * 12 * L;
  for (int32_t e = p.offsets[node]; e < p.offsets[node + 1]; ++e) {
    const float* other = p.table + static_cast<int64_t>(p.targets[e]) * 12 * L;
    const float* rest = p.rest + 3 * e;
    const float weight = p.rigidity[e] * p.scale;
    for (int r = 0; r < 3; ++r) {
      const Vector<L> g = weighted_sign<L>(residual<L>(own, other, rest, 1.0f, r), weight);
      for (int k = 0; k < 3; ++k) G[3 * r + k] += g * rest[k];
      // The reverse edge has the opposite rest offset and the same rigidity. It ends at this node.
      T[r] += g - weighted_sign<L>(residual<L>(other, own, rest, -1.0f, r), weight);
    }
  }
  for (int r = 0; r < 3; ++r) store<L>(grad_translation + r * L, T[r]);
  euler_adjoint<L>(angles, G, grad_angles);
}

template <int L>
void backward(const ArapParams& p, int64_t begin, int64_t end) {
  alignas(64) float angles[kBlock * 3 * L], grad_angles[kBlock * 3 * L], grad_translations[kBlock * 3 * L];
  const int64_t stride = 3 * p.num_nodes;
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = block_size(start, end);
    load_block<L>(p, p.angles, start, n, angles);
    for (int i = 0; i < n; ++i) {
      node_adjoint<L>(p, start + i, angles + 3 * i * L, grad_angles + 3 * i * L, grad_translations + 3 * i * L);
    }
    from_lanes<L>(grad_angles, 3 * n, p.grad_angles + p.first * stride + 3 * start, stride, p.count);
    from_lanes<L>(grad_translations, 3 * n, p.grad_translations + p.first * stride + 3 * start, stride, p.count);
  }
}

}  // namespace

int arap_lanes(int64_t count) { return lanes_for(count); }

void arap_prepare(const ArapParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { prepare<decltype(lanes)::value>(p, begin, end); });
}

void arap_forward(const ArapParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { forward<decltype(lanes)::value>(p, begin, end); });
}

void arap_backward(const ArapParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { backward<decltype(lanes)::value>(p, begin, end); });
}

}  // namespace doppel::kernels::DOPPEL_ISA
