/// Closest points on a mesh that has moved, one thread: our tree and its sign against Embree's point queries (if
/// installed), which refit their own hierarchy and call the same exact test per triangle. Points: 64 samples on each of
/// 1,000 short rays within 5 cm of the surface, as a radiance field takes them.
///   closest_point_bench [file.obj in millimetres, closed]

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#ifdef DOPPEL_HAVE_EMBREE
#include <embree3/rtcore.h>
#endif

#include "doppel/geometry/closed_surface.h"
#include "geometry/meshes.h"
#include "support/ratio.h"

namespace doppel::bench {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// 8,192 faces on an egg of a human's size.
TriangleMesh make_body() {
  TriangleMesh mesh = support::make_sphere(5);
  for (Vector3d& v : mesh.vertices) v = v.cwiseProduct(Vector3d(0.35, 0.9, 0.25)) * (1.0 + 0.1 * std::sin(9.0 * v.y()));
  return mesh;
}

/// Bent out of the pose that the tree was built in.
Points bent(Points vertices) {
  for (Vector3d& v : vertices) v.x() += 0.05 * std::sin(3.0 * v.y());
  return vertices;
}

Points points_near(const Points& vertices, int rays, int samples) {
  std::mt19937 random(1);
  const auto number = [&] { return static_cast<double>(random()) / 4294967295.0 - 0.5; };
  Points points;
  for (int r = 0; r < rays; ++r) {
    const Vector3d& start = vertices[random() % vertices.size()];
    const double x = number(), y = number();
    const Vector3d along = Vector3d(x, y, number()).normalized();
    for (int s = 0; s < samples; ++s) points.push_back(start + (0.1 * (s + 0.5) / samples - 0.05) * along);
  }
  return points;
}

#ifdef DOPPEL_HAVE_EMBREE
class EmbreePeer {
 public:
  EmbreePeer(const TriangleMesh& mesh, const Points& moved) : faces_(mesh.faces), vertices_(moved) {
    device_ = rtcNewDevice("threads=1");
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
    geometry_ = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    buffer_ = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertices_.size()));
    fill(mesh.vertices);
    std::memcpy(rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, faces_.size()),
                faces_.data(), 12 * faces_.size());
    rtcSetGeometryPointQueryFunction(geometry_, &EmbreePeer::visit);
    rtcCommitGeometry(geometry_);
    rtcAttachGeometry(scene_, geometry_);
    rtcCommitScene(scene_);
    rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
    fill(vertices_);
    move();
  }
  ~EmbreePeer() {
    rtcReleaseGeometry(geometry_);
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }

  void move() {
    rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(geometry_);
    rtcCommitScene(scene_);
  }
  double distance(const Vector3d& point) const {
    const Eigen::Vector3f p = point.cast<float>();
    RTCPointQuery query{p.x(), p.y(), p.z(), 0.0f, std::numeric_limits<float>::infinity()};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    Search search{this, point, {}};
    rtcPointQuery(scene_, &query, &context, nullptr, &search);
    return std::sqrt(search.best.squared_distance);
  }

 private:
  struct Search {
    const EmbreePeer* peer;
    Vector3d point;
    TrianglePoint best;
  };
  static bool visit(RTCPointQueryFunctionArguments* call) {
    Search& search = *static_cast<Search*>(call->userPtr);
    const Triangle& face = search.peer->faces_[call->primID];
    const Points& at = search.peer->vertices_;
    const TrianglePoint found = closest_on_triangle(search.point, {at[face[0]], at[face[1]], at[face[2]]});
    if (found.squared_distance >= search.best.squared_distance) return false;
    search.best = found;
    call->query->radius = 1.00001f * static_cast<float>(std::sqrt(found.squared_distance));
    return true;
  }
  void fill(const Points& points) {
    float* out = buffer_;
    for (const Vector3d& p : points)
      for (int k = 0; k < 3; ++k) *out++ = static_cast<float>(p[k]);
  }

  std::vector<Triangle> faces_;
  Points vertices_;
  float* buffer_;
  RTCDevice device_;
  RTCScene scene_;
  RTCGeometry geometry_;
};
#endif

int run(const char* file) {
  const TriangleMesh mesh = file ? read_obj(file, 0.001) : make_body();
  const Points moved = bent(mesh.vertices), points = points_near(moved, 1000, 64);
  ClosedSurface surface(mesh.vertices, mesh.faces);
  surface.move(moved);
  TriangleTree tree(mesh.vertices, mesh.faces);
  tree.refit(moved);
  double sum = 0.0;
  const auto with_hints = [&] {
    int near = -1;
    for (const Vector3d& p : points) {
      const auto hit = surface.closest(p, near);
      near = hit.face;
      sum += hit.distance;
    }
  };
  std::printf("%d faces, %zu points, one thread\n", mesh.num_faces(), points.size());
  std::vector<Candidate> search, move;
#ifdef DOPPEL_HAVE_EMBREE
  EmbreePeer peer(mesh, moved);
  double worst = 0.0;
  for (const Vector3d& p : points)
    worst = std::max(worst, std::abs(peer.distance(p) - std::abs(surface.closest(p).distance)));
  std::printf("largest difference to Embree %.1e m\n", worst);
  search.push_back({"Embree 3, distance", [&] {
                      for (const Vector3d& p : points) sum += peer.distance(p);
                    }});
  move.push_back({"Embree 3, refit", [&] { peer.move(); }});
#endif
  search.push_back({"ours, distance, no hints", [&] {
                      for (const Vector3d& p : points) sum += tree.closest(p).squared_distance;
                    }});
  search.push_back({"ours, signed, the last face as hint", with_hints});
  move.push_back({"ours, tree alone", [&] { tree.refit(moved); }});
  move.push_back({"ours, tree and normals", [&] { surface.move(moved); }});
  RatioOptions few;
  few.turns = 9;
  compare("closest points", search, few);
  compare("moving the mesh", move, few);
  return std::isfinite(sum) ? 0 : 1;
}

}  // namespace
}  // namespace doppel::bench

int main(int argc, char** argv) { return doppel::bench::run(argc > 1 ? argv[1] : nullptr); }
