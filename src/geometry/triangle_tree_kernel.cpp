#include "doppel/geometry/triangle_tree_kernel.h"

#include <cstring>

#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int kDoubles = kVectorBytes / sizeof(double);

typedef double Vec __attribute__((vector_size(kVectorBytes)));
typedef std::int64_t Mask __attribute__((vector_size(kVectorBytes)));

struct Vec3 {
  Vec x, y, z;
};

inline Vec load(const double* p) {
  Vec v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
inline Vec spread(double v) { return v - Vec{}; }
inline Vec3 load(const double (*p)[kTreeWidth], int lane) {
  return {load(p[0] + lane), load(p[1] + lane), load(p[2] + lane)};
}
inline Vec smaller(Vec a, Vec b) { return a < b ? a : b; }
inline Vec larger(Vec a, Vec b) { return a > b ? a : b; }

inline Vec3 minus(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline unsigned bits_of(Mask mask) {
  unsigned bits = 0;
  for (int i = 0; i < kDoubles; ++i) bits |= static_cast<unsigned>(mask[i] & 1) << i;
  return bits;
}

/// Squared distance from a corner's offset `start` = point - corner to the segment `along`.
inline Vec segment_distance(const Vec3& start, const Vec3& along) {
  const Vec length = dot(along, along);
  const Vec safe = length > 0.0 ? length : spread(1.0);
  const Vec t = smaller(larger(dot(start, along) / safe, Vec{}), spread(1.0));
  const Vec3 offset{start.x - t * along.x, start.y - t * along.y, start.z - t * along.z};
  return dot(offset, offset);
}

}  // namespace

unsigned near_children(const TreeNode& node, const double* point, double bound, double* distance) {
  unsigned bits = 0;
  for (int lane = 0; lane < kTreeWidth; lane += kDoubles) {
    Vec sum = {};
    for (int axis = 0; axis < 3; ++axis) {
      const Vec p = spread(point[axis]);
      const Vec outside = larger(larger(load(node.low[axis] + lane) - p, p - load(node.high[axis] + lane)), Vec{});
      sum += outside * outside;
    }
    std::memcpy(distance + lane, &sum, sizeof(sum));
    bits |= bits_of(sum <= bound) << lane;
  }
  return bits;
}

unsigned near_triangles(const TreeLeaf& leaf, const double* point, double bound) {
  unsigned bits = 0;
  const Vec3 p{spread(point[0]), spread(point[1]), spread(point[2])};
  for (int lane = 0; lane < kTreeWidth; lane += kDoubles) {
    const Vec3 a = load(leaf.corner[0], lane), b = load(leaf.corner[1], lane), c = load(leaf.corner[2], lane);
    const Vec3 ab = minus(b, a), bc = minus(c, b), ca = minus(a, c);
    const Vec3 pa = minus(p, a), pb = minus(p, b), pc = minus(p, c);
    const Vec3 normal = cross(ab, bc);
    const Vec area = dot(normal, normal);
    const Mask inside = (dot(cross(bc, pb), normal) >= 0.0) & (dot(cross(ca, pc), normal) >= 0.0) &
                        (dot(cross(ab, pa), normal) >= 0.0) & (area > 0.0);
    const Vec height = dot(pa, normal);
    const Vec plane = height * height / (area > 0.0 ? area : spread(1.0));
    const Vec edges = smaller(smaller(segment_distance(pa, ab), segment_distance(pb, bc)), segment_distance(pc, ca));
    const Vec nearest = inside ? smaller(plane, edges) : edges;
    bits |= bits_of(nearest <= bound) << lane;
  }
  return bits;
}

}  // namespace doppel::kernels::DOPPEL_ISA
