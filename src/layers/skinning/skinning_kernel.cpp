#include "doppel/layers/skinning/skinning_kernel.h"

#include "doppel/layers/lanes.h"

// Bones are expressed in a local frame before anything is rounded to single precision. Let c be a point of the template
// and o its position under the first bone. T(-o) M_b T(c) blends to T(-o) M_i T(c) in both modes. Its numbers have the
// size of the body, for any position of the body in the world.

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr int kBlock = 16;  // points transposed at a time
constexpr float kMinSquaredNorm = 1e-12f;

// ---------------------------------------------------------------------------------------------- bones, in double

/// The row of quaternion candidates with the largest component, as in the reference: v = 4 q_largest q, linear in m.
/// `m` is a [3,4] transform.
int quaternion_row(const double* m, double* v) {
  const double trace = m[0] + m[5] + m[10];
  const double lead[4] = {trace, m[0], m[5], m[10]};
  int row = 0;
  for (int i = 1; i < 4; ++i) {
    if (lead[i] > lead[row]) row = i;
  }
  const double x = m[9] - m[6], y = m[2] - m[8], z = m[4] - m[1];
  const double xy = m[1] + m[4], xz = m[2] + m[8], yz = m[6] + m[9];
  const double candidates[4][4] = {{1.0 + trace, x, y, z},
                                   {x, 1.0 + 2.0 * m[0] - trace, xy, xz},
                                   {y, xy, 1.0 + 2.0 * m[5] - trace, yz},
                                   {z, xz, yz, 1.0 + 2.0 * m[10] - trace}};
  for (int i = 0; i < 4; ++i) v[i] = candidates[row][i];
  return row;
}

/// Adjoint of quaternion_row: grad_m += (dv/dm)^T grad_v.
void add_quaternion_row_adjoint(int row, const double* g, double* grad_m) {
  static const int kAxisEntry[3][2] = {{9, 6}, {2, 8}, {4, 1}};  // x, y, z: plus, minus
  static const int kPairEntry[3][2] = {{1, 4}, {2, 8}, {6, 9}};  // xy, xz, yz
  const auto add_axis = [&](int axis, double value) {
    grad_m[kAxisEntry[axis][0]] += value;
    grad_m[kAxisEntry[axis][1]] -= value;
  };
  const auto add_pair = [&](int pair, double value) {
    grad_m[kPairEntry[pair][0]] += value;
    grad_m[kPairEntry[pair][1]] += value;
  };
  for (int i = 0; i < 3; ++i) grad_m[5 * i] += row == 0 ? g[0] : row == i + 1 ? g[row] : -g[row];
  if (row == 0) {
    for (int axis = 0; axis < 3; ++axis) add_axis(axis, g[1 + axis]);
    return;
  }
  add_axis(row - 1, g[0]);
  // The pair of axes (row-1, i): xy, xz or yz.
  for (int i = 0; i < 3; ++i) {
    if (i != row - 1) add_pair(row - 1 + i - 1, g[1 + i]);
  }
}

struct BoneQuaternion {
  int row;
  double length;      // of the candidate row
  double q[4], t[3];  // unit quaternion; translation in the local frame
};

const float* bone_of(const SkinningParams& p, int64_t bone, int lane) {
  const int64_t item = p.first + (lane < p.count ? lane : p.count - 1);
  return p.bones + (item * p.num_bones + bone) * 12;
}

/// Linear: R c + t - o.
void local_translation(const SkinningParams& p, const double* m, int lane, double* t) {
  for (int r = 0; r < 3; ++r) {
    t[r] = m[4 * r + 3] - static_cast<double>(p.frame[(3 + r) * p.lanes + lane]);
    for (int k = 0; k < 3; ++k) t[r] += m[4 * r + k] * static_cast<double>(p.frame[k * p.lanes + lane]);
  }
}

void cross(const double* a, const double* b, double* c) {
  for (int r = 0; r < 3; ++r) c[r] = a[(r + 1) % 3] * b[(r + 2) % 3] - a[(r + 2) % 3] * b[(r + 1) % 3];
}

/// Dual quaternion: R(q) c + t - o. The change of frame is exact only for a rotation. R(q) is a rotation even if the
/// matrix is only nearly one.
void local_translation(const SkinningParams& p, const double* m, int lane, const double* q, double* t) {
  const double c[3] = {p.frame[lane], p.frame[p.lanes + lane], p.frame[2 * p.lanes + lane]};
  double once[3], twice[3];
  cross(q + 1, c, once);
  cross(q + 1, once, twice);
  for (int r = 0; r < 3; ++r) {
    t[r] = c[r] + 2.0 * (q[0] * once[r] + twice[r]) + m[4 * r + 3] -
           static_cast<double>(p.frame[(3 + r) * p.lanes + lane]);
  }
}

/// Adjoint of R(q) c = c + 2 (w v x c + v x (v x c)) with respect to q: gq += ...
void add_turned_adjoint(const SkinningParams& p, int lane, const double* q, const double* g, double* gq) {
  const double c[3] = {p.frame[lane], p.frame[p.lanes + lane], p.frame[2 * p.lanes + lane]};
  const double* v = q + 1;
  double once[3], c_cross_g[3], vc = 0.0, vg = 0.0, cg = 0.0;
  cross(v, c, once);
  cross(c, g, c_cross_g);
  for (int r = 0; r < 3; ++r) {
    vc += v[r] * c[r];
    vg += v[r] * g[r];
    cg += c[r] * g[r];
    gq[0] += 2.0 * g[r] * once[r];
  }
  for (int r = 0; r < 3; ++r) gq[1 + r] += 2.0 * (q[0] * c_cross_g[r] + g[r] * vc + c[r] * vg - 2.0 * v[r] * cg);
}

BoneQuaternion quaternion_of_bone(const SkinningParams& p, const double* m, int lane) {
  BoneQuaternion bone;
  bone.row = quaternion_row(m, bone.q);
  bone.length =
      std::sqrt(bone.q[0] * bone.q[0] + bone.q[1] * bone.q[1] + bone.q[2] * bone.q[2] + bone.q[3] * bone.q[3]);
  for (double& value : bone.q) value /= bone.length;
  local_translation(p, m, lane, bone.q, bone.t);
  return bone;
}

/// Dual part of a bone: 1/2 (0,t) q.
void dual_part(const BoneQuaternion& bone, double* e) {
  const double* q = bone.q;
  const double* t = bone.t;
  e[0] = -0.5 * (t[0] * q[1] + t[1] * q[2] + t[2] * q[3]);
  e[1] = 0.5 * (t[0] * q[0] + t[1] * q[3] - t[2] * q[2]);
  e[2] = 0.5 * (t[1] * q[0] + t[2] * q[1] - t[0] * q[3]);
  e[3] = 0.5 * (t[2] * q[0] + t[0] * q[2] - t[1] * q[1]);
}

/// Gradient to one bone's [3,4] from the gradient `g` to its dual quaternion.
void dual_quaternion_adjoint(const SkinningParams& p, const double* m, int lane, const double* g, double* grad_m) {
  const BoneQuaternion bone = quaternion_of_bone(p, m, lane);
  const double* q = bone.q;
  const double* t = bone.t;
  const double* ge = g + 4;
  double gq[4] = {g[0] + 0.5 * (ge[1] * t[0] + ge[2] * t[1] + ge[3] * t[2]),
                  g[1] + 0.5 * (-ge[0] * t[0] + ge[2] * t[2] - ge[3] * t[1]),
                  g[2] + 0.5 * (-ge[0] * t[1] - ge[1] * t[2] + ge[3] * t[0]),
                  g[3] + 0.5 * (-ge[0] * t[2] + ge[1] * t[1] - ge[2] * t[0])};
  const double gt[3] = {0.5 * (-ge[0] * q[1] + ge[1] * q[0] - ge[2] * q[3] + ge[3] * q[2]),
                        0.5 * (-ge[0] * q[2] + ge[1] * q[3] + ge[2] * q[0] - ge[3] * q[1]),
                        0.5 * (-ge[0] * q[3] - ge[1] * q[2] + ge[2] * q[1] + ge[3] * q[0])};
  add_turned_adjoint(p, lane, q, gt, gq);
  // q = v / |v|: dv = (dq - q <q,dq>) / |v|.
  const double along = gq[0] * q[0] + gq[1] * q[1] + gq[2] * q[2] + gq[3] * q[3];
  for (int i = 0; i < 4; ++i) gq[i] = (gq[i] - along * q[i]) / bone.length;
  for (int i = 0; i < 12; ++i) grad_m[i] = 0.0;
  add_quaternion_row_adjoint(bone.row, gq, grad_m);
  for (int r = 0; r < 3; ++r) grad_m[4 * r + 3] = gt[r];
}

// ------------------------------------------------------------------------------------------- vertices, L lanes each

/// A blended transform [R|t], row-major.
template <int L>
struct Transform {
  Vector<L> m[12];
};

/// +-w: the weight with the sign that aligns a bone's quaternion with that of the first bone.
template <int L>
inline Vector<L> aligned_weight(float weight, const float* bone, const Vector<L>* first) {
  const Vector<L> cosine = load<L>(bone) * first[0] + load<L>(bone + L) * first[1] + load<L>(bone + 2 * L) * first[2] +
                           load<L>(bone + 3 * L) * first[3];
  const Vector<L> w = broadcast<L>(weight);
  return cosine < 0.0f ? -w : w;
}

constexpr int kKeptWeights = 8;

/// b = sum s w dq. @param kept receives the first kKeptWeights aligned weights s w; null: not wanted
template <int L>
inline void blend_dual_quaternion(const SkinningParams& p, int64_t i, Vector<L>* b, Vector<L>* first, Vector<L>* kept) {
  const int32_t begin = p.offsets[i], end = p.offsets[i + 1];
  const float* pivot = p.table + static_cast<int64_t>(p.items[begin]) * 8 * L;
  for (int c = 0; c < 4; ++c) first[c] = load<L>(pivot + c * L);
  for (int c = 0; c < 8; ++c) b[c] = p.weights[begin] * load<L>(pivot + c * L);
  if (kept) kept[0] = aligned_weight<L>(p.weights[begin], pivot, first);
  for (int32_t e = begin + 1; e < end; ++e) {
    const float* bone = p.table + static_cast<int64_t>(p.items[e]) * 8 * L;
    const Vector<L> w = aligned_weight<L>(p.weights[e], bone, first);
    if (kept && e - begin < kKeptWeights) kept[e - begin] = w;
    for (int c = 0; c < 8; ++c) b[c] += w * load<L>(bone + c * L);
  }
}

template <int L>
inline Vector<L> twice_inverse_squared_norm(const Vector<L>* b) {
  const Vector<L> squared = b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + b[3] * b[3];
  const Vector<L> least = broadcast<L>(kMinSquaredNorm);
  return 2.0f / (squared < least ? least : squared);
}

template <int L>
inline void rigid_of(const Vector<L>* b, Transform<L>* out) {
  const Vector<L> s = twice_inverse_squared_norm<L>(b);
  const Vector<L> w = b[0], x = b[1], y = b[2], z = b[3], ew = b[4], ex = b[5], ey = b[6], ez = b[7];
  Vector<L>* m = out->m;
  m[0] = 1.0f - s * (y * y + z * z);
  m[1] = s * (x * y - w * z);
  m[2] = s * (x * z + w * y);
  m[3] = s * (w * ex - ew * x + y * ez - z * ey);
  m[4] = s * (x * y + w * z);
  m[5] = 1.0f - s * (x * x + z * z);
  m[6] = s * (y * z - w * x);
  m[7] = s * (w * ey - ew * y + z * ex - x * ez);
  m[8] = s * (x * z - w * y);
  m[9] = s * (y * z + w * x);
  m[10] = 1.0f - s * (x * x + y * y);
  m[11] = s * (w * ez - ew * z + x * ey - y * ex);
}

/// Adjoint of rigid_of: gradient to b from the gradient g to the twelve numbers.
template <int L>
inline void rigid_adjoint(const Vector<L>* b, const Vector<L>* g, Vector<L>* grad) {
  const Vector<L> squared = b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + b[3] * b[3];
  const Vector<L> least = broadcast<L>(kMinSquaredNorm);
  const auto guarded = squared < least;
  const Vector<L> s = 2.0f / (guarded ? least : squared);
  const Vector<L> w = b[0], x = b[1], y = b[2], z = b[3], ew = b[4], ex = b[5], ey = b[6], ez = b[7];
  const Vector<L> tx = g[3], ty = g[7], tz = g[11];
  const Vector<L> gs = g[1] * (x * y - w * z) - g[0] * (y * y + z * z) + g[2] * (x * z + w * y) +
                       g[4] * (x * y + w * z) - g[5] * (x * x + z * z) + g[6] * (y * z - w * x) +
                       g[8] * (x * z - w * y) + g[9] * (y * z + w * x) - g[10] * (x * x + y * y) +
                       tx * (w * ex - ew * x + y * ez - z * ey) + ty * (w * ey - ew * y + z * ex - x * ez) +
                       tz * (w * ez - ew * z + x * ey - y * ex);
  // s = 2 / |b|^2 (constant where guarded): ds/db = -s^2 b.
  const Vector<L> radial = guarded ? Vector<L>{} : gs * s * s;
  grad[0] = s * (z * (g[4] - g[1]) + y * (g[2] - g[8]) + x * (g[9] - g[6]) + ex * tx + ey * ty + ez * tz) - radial * w;
  grad[1] = s * (y * (g[1] + g[4]) + z * (g[2] + g[8]) + w * (g[9] - g[6]) - 2.0f * x * (g[5] + g[10]) - ew * tx -
                 ez * ty + ey * tz) -
            radial * x;
  grad[2] = s * (x * (g[1] + g[4]) + w * (g[2] - g[8]) + z * (g[6] + g[9]) - 2.0f * y * (g[0] + g[10]) + ez * tx -
                 ew * ty - ex * tz) -
            radial * y;
  grad[3] = s * (w * (g[4] - g[1]) + x * (g[2] + g[8]) + y * (g[6] + g[9]) - 2.0f * z * (g[0] + g[5]) - ey * tx +
                 ex * ty - ew * tz) -
            radial * z;
  grad[4] = -s * (x * tx + y * ty + z * tz);
  grad[5] = s * (w * tx + z * ty - y * tz);
  grad[6] = s * (w * ty + x * tz - z * tx);
  grad[7] = s * (w * tz + y * tx - x * ty);
}

template <int L>
inline void blend_linear(const SkinningParams& p, int64_t i, Transform<L>* out) {
  for (int c = 0; c < 12; ++c) out->m[c] = Vector<L>{};
  for (int32_t e = p.offsets[i]; e < p.offsets[i + 1]; ++e) {
    const float* bone = p.table + static_cast<int64_t>(p.items[e]) * 12 * L;
    const float w = p.weights[e];
    for (int c = 0; c < 12; ++c) out->m[c] += w * load<L>(bone + c * L);
  }
}

/// Local coordinates (point - centre) of up to kBlock points, [n,3,L].
template <int L>
void load_points(const SkinningParams& p, int64_t begin, int n, float* lanes) {
  if (p.point_stride == 0) {
    for (int f = 0; f < 3 * n; ++f) store<L>(lanes + f * L, broadcast<L>(p.points[3 * begin + f]));
  } else {
    to_lanes<L>(p.points + p.first * p.point_stride + 3 * begin, p.point_stride, p.count, 3 * n, lanes);
  }
  for (int f = 0; f < 3 * n; ++f) store<L>(lanes + f * L, load<L>(lanes + f * L) - load<L>(p.frame + (f % 3) * L));
}

/// The result of one point: [3,L], or [12,L] for `blend_only`.
template <int L>
inline void write_result(const SkinningParams& p, const Transform<L>& blend, const float* point, float* result) {
  const float* origin = p.frame + 3 * L;
  if (p.blend_only) {
    for (int c = 0; c < 12; ++c) store<L>(result + c * L, blend.m[c]);
    for (int r = 0; r < 3; ++r) store<L>(result + (4 * r + 3) * L, blend.m[4 * r + 3] + load<L>(origin + r * L));
    return;
  }
  const Vector<L> x = load<L>(point), y = load<L>(point + L), z = load<L>(point + 2 * L);
  for (int r = 0; r < 3; ++r) {
    const Vector<L>* m = blend.m + 4 * r;
    store<L>(result + r * L, (m[0] * x + m[1] * y + m[2] * z + m[3]) + load<L>(origin + r * L));
  }
}

template <int L>
void forward(const SkinningParams& p, int64_t begin, int64_t end) {
  const int width = p.blend_only ? 12 : 3;
  alignas(64) float points[kBlock * 3 * L], results[kBlock * 12 * L];
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = static_cast<int>(end - start < kBlock ? end - start : kBlock);
    if (!p.blend_only) load_points<L>(p, start, n, points);
    for (int i = 0; i < n; ++i) {
      Transform<L> blend;
      if (p.linear) {
        blend_linear<L>(p, start + i, &blend);
      } else {
        Vector<L> b[8], first[4];
        blend_dual_quaternion<L>(p, start + i, b, first, nullptr);
        rigid_of<L>(b, &blend);
      }
      write_result<L>(p, blend, points + 3 * i * L, results + width * i * L);
    }
    const int64_t stride = p.num_points * width;
    from_lanes<L>(results, width * n, p.out + p.first * stride + start * width, stride, p.count);
  }
}

/// Gradients to the blended transform and to the local coordinates of a point, from the gradient to the result.
template <int L>
inline void result_adjoint(const SkinningParams& p, const Transform<L>& blend, const float* point, const float* grad,
                           Vector<L>* grad_blend, float* grad_point) {
  if (p.blend_only) {
    for (int c = 0; c < 12; ++c) grad_blend[c] = load<L>(grad + c * L);
    return;
  }
  for (int r = 0; r < 3; ++r) {
    const Vector<L> g = load<L>(grad + r * L);
    for (int k = 0; k < 3; ++k) grad_blend[4 * r + k] = g * load<L>(point + k * L);
    grad_blend[4 * r + 3] = g;
  }
  for (int k = 0; k < 3; ++k) {
    store<L>(grad_point + k * L,
             blend.m[k] * load<L>(grad) + blend.m[4 + k] * load<L>(grad + L) + blend.m[8 + k] * load<L>(grad + 2 * L));
  }
}

template <int L>
inline void backward_dual_quaternion(const SkinningParams& p, int64_t i, const float* point, const float* grad,
                                     float* grad_point, float* part) {
  Vector<L> b[8], first[4], kept[kKeptWeights], grad_blend[12], grad_b[8];
  Transform<L> blend;
  blend_dual_quaternion<L>(p, i, b, first, kept);
  rigid_of<L>(b, &blend);
  result_adjoint<L>(p, blend, point, grad, grad_blend, grad_point);
  if (!part) return;
  rigid_adjoint<L>(b, grad_blend, grad_b);
  const int32_t begin = p.offsets[i], end = p.offsets[i + 1];
  for (int32_t e = begin; e < end; ++e) {
    const int64_t position = static_cast<int64_t>(p.items[e]) * 8 * L;
    const Vector<L> w =
        e - begin < kKeptWeights ? kept[e - begin] : aligned_weight<L>(p.weights[e], p.table + position, first);
    for (int c = 0; c < 8; ++c) store<L>(part + position + c * L, load<L>(part + position + c * L) + w * grad_b[c]);
  }
}

template <int L>
inline void backward_linear(const SkinningParams& p, int64_t i, const float* point, const float* grad,
                            float* grad_point, float* part) {
  Vector<L> grad_blend[12];
  Transform<L> blend;
  blend_linear<L>(p, i, &blend);
  result_adjoint<L>(p, blend, point, grad, grad_blend, grad_point);
  if (!part) return;
  for (int32_t e = p.offsets[i]; e < p.offsets[i + 1]; ++e) {
    float* to = part + static_cast<int64_t>(p.items[e]) * 12 * L;
    const float w = p.weights[e];
    for (int c = 0; c < 12; ++c) store<L>(to + c * L, load<L>(to + c * L) + w * grad_blend[c]);
  }
}

/// Adds the sum over the real lanes to each of n numbers.
template <int L>
void add_lane_sums(const float* lanes, int n, int count, float* sums) {
  for (int f = 0; f < n; ++f) {
    float sum = 0.0f;
    for (int l = 0; l < count; ++l) sum += lanes[f * L + l];
    sums[f] += sum;
  }
}

template <int L>
void backward(const SkinningParams& p, int64_t begin, int64_t end, int64_t part_index) {
  const int width = p.blend_only ? 12 : 3;
  alignas(64) float points[kBlock * 3 * L], grads[kBlock * 12 * L], grad_points[kBlock * 3 * L];
  float* part = p.grad_bones ? p.grad_tables + part_index * p.num_bones * (p.linear ? 12 : 8) * L : nullptr;
  const int64_t stride = p.num_points * width;
  for (int64_t start = begin; start < end; start += kBlock) {
    const int n = static_cast<int>(end - start < kBlock ? end - start : kBlock);
    if (!p.blend_only) load_points<L>(p, start, n, points);
    to_lanes<L>(p.grad_out + p.first * stride + start * width, stride, p.count, width * n, grads);
    for (int i = 0; i < n; ++i) {
      const float *point = points + 3 * i * L, *grad = grads + width * i * L;
      float* grad_point = grad_points + 3 * i * L;
      if (p.linear) {
        backward_linear<L>(p, start + i, point, grad, grad_point, part);
      } else {
        backward_dual_quaternion<L>(p, start + i, point, grad, grad_point, part);
      }
    }
    if (!p.grad_points) continue;
    if (p.point_stride == 0) {
      add_lane_sums<L>(grad_points, 3 * n, p.count, p.grad_points + 3 * start);
    } else {
      from_lanes<L>(grad_points, 3 * n, p.grad_points + p.first * p.point_stride + 3 * start, p.point_stride, p.count);
    }
  }
}

}  // namespace

int skinning_lanes(int64_t count) { return lanes_for(count); }

void skinning_prepare_frame(const SkinningParams& p) {
  for (int lane = 0; lane < p.lanes; ++lane) {
    const int64_t item = p.first + (lane < p.count ? lane : p.count - 1);
    const float* bone = bone_of(p, 0, lane);
    float centre[3] = {0.0f, 0.0f, 0.0f};
    if (!p.blend_only) {
      for (int k = 0; k < 3; ++k) centre[k] = p.points[item * p.point_stride + k];
    }
    for (int r = 0; r < 3; ++r) {
      p.frame[r * p.lanes + lane] = centre[r];
      p.frame[(3 + r) * p.lanes + lane] =
          bone[4 * r] * centre[0] + bone[4 * r + 1] * centre[1] + bone[4 * r + 2] * centre[2] + bone[4 * r + 3];
    }
  }
}

void skinning_prepare(const SkinningParams& p, int64_t begin, int64_t end) {
  const int width = p.linear ? 12 : 8;
  for (int64_t bone = begin; bone < end; ++bone) {
    float* entry = p.table + bone * width * p.lanes;
    for (int lane = 0; lane < p.lanes; ++lane) {
      double m[12], values[12];
      for (int i = 0; i < 12; ++i) values[i] = m[i] = bone_of(p, bone, lane)[i];
      if (p.linear) {
        double t[3];
        local_translation(p, m, lane, t);
        for (int r = 0; r < 3; ++r) values[4 * r + 3] = t[r];
      } else {
        const BoneQuaternion quaternion = quaternion_of_bone(p, m, lane);
        for (int i = 0; i < 4; ++i) values[i] = quaternion.q[i];
        dual_part(quaternion, values + 4);
      }
      for (int c = 0; c < width; ++c) entry[c * p.lanes + lane] = static_cast<float>(values[c]);
    }
  }
}

void skinning_forward(const SkinningParams& p, int64_t begin, int64_t end) {
  with_lanes(p.lanes, [&](auto lanes) { forward<decltype(lanes)::value>(p, begin, end); });
}

void skinning_backward(const SkinningParams& p, int64_t begin, int64_t end, int64_t part) {
  with_lanes(p.lanes, [&](auto lanes) { backward<decltype(lanes)::value>(p, begin, end, part); });
}

void skinning_finish(const SkinningParams& p, int64_t begin, int64_t end) {
  const int width = p.linear ? 12 : 8;
  const int64_t part_size = p.num_bones * width * p.lanes;
  for (int64_t bone = begin; bone < end; ++bone) {
    float* sums = p.grad_tables + bone * width * p.lanes;  // of part 0, to which the other parts are added
    for (int64_t part = 1; part < p.num_parts; ++part) {
      for (int i = 0; i < width * p.lanes; ++i) sums[i] += sums[part * part_size + i];
    }
    for (int lane = 0; lane < p.count; ++lane) {
      double g[12], m[12], grad_m[12];
      for (int c = 0; c < width; ++c) g[c] = sums[c * p.lanes + lane];
      for (int i = 0; i < 12; ++i) m[i] = bone_of(p, bone, lane)[i];
      if (p.linear) {
        // The local translation is R c + t - o.
        for (int i = 0; i < 12; ++i) {
          grad_m[i] =
              i % 4 == 3 ? g[i] : g[i] + g[4 * (i / 4) + 3] * static_cast<double>(p.frame[(i % 4) * p.lanes + lane]);
        }
      } else {
        dual_quaternion_adjoint(p, m, lane, g, grad_m);
      }
      float* to = p.grad_bones + ((p.first + lane) * p.num_bones + bone) * 12;
      for (int i = 0; i < 12; ++i) to[i] = static_cast<float>(grad_m[i]);
    }
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
