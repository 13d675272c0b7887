#include "render/embree_peer.h"

#include <ATen/Parallel.h>
#include <embree3/rtcore.h>

#include <atomic>
#include <cstring>
#include <limits>
#include <string>

#include "doppel/core/as_size.h"

namespace doppel::bench {

struct EmbreePeer::State {
  PeerScene scene;
  RTCDevice device;
  RTCScene bvh;
  RTCGeometry mesh;
  std::vector<int> id;
  std::vector<float> depth, barycentrics;

  void trace(int x0, int y0);
};

EmbreePeer::EmbreePeer(const PeerScene& scene) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.scene = scene;
  s.device = rtcNewDevice(("threads=" + std::to_string(scene.threads)).c_str());
  s.bvh = rtcNewScene(s.device);
  rtcSetSceneFlags(s.bvh, RTC_SCENE_FLAG_DYNAMIC);
  s.mesh = rtcNewGeometry(s.device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const auto vertices = as_size(scene.num_vertices), faces = as_size(scene.num_faces);
  std::memcpy(rtcSetNewGeometryBuffer(s.mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, vertices),
              scene.vertices, 12 * vertices);
  std::memcpy(rtcSetNewGeometryBuffer(s.mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, faces), scene.faces,
              12 * faces);
  rtcCommitGeometry(s.mesh);
  rtcAttachGeometry(s.bvh, s.mesh);
  rtcCommitScene(s.bvh);
  rtcSetGeometryBuildQuality(s.mesh, RTC_BUILD_QUALITY_REFIT);
  rtcCommitGeometry(s.mesh);
  rtcCommitScene(s.bvh);
  const auto pixels = as_size(scene.size) * as_size(scene.size);
  s.id.assign(pixels, -1);
  s.depth.assign(pixels, 0);
  s.barycentrics.assign(3 * pixels, 0);
}

EmbreePeer::~EmbreePeer() {
  rtcReleaseGeometry(state_->mesh);
  rtcReleaseScene(state_->bvh);
  rtcReleaseDevice(state_->device);
}

const std::vector<int>& EmbreePeer::face_id() const { return state_->id; }

void EmbreePeer::State::trace(int x0, int y0) {
  alignas(64) RTCRayHit16 packet;
  alignas(64) int valid[16];
  for (int i = 0; i < 16; ++i) {
    const int x = x0 + i % 4, y = y0 + i / 4;
    valid[i] = x < scene.size && y < scene.size ? -1 : 0;
    packet.ray.org_x[i] = packet.ray.org_y[i] = packet.ray.org_z[i] = 0;
    packet.ray.dir_x[i] = (static_cast<float>(x) + 0.5f - scene.centre) / scene.focal;
    packet.ray.dir_y[i] = (static_cast<float>(y) + 0.5f - scene.centre) / scene.focal;
    packet.ray.dir_z[i] = 1;
    packet.ray.tnear[i] = 0.01f;
    packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
    packet.ray.time[i] = 0;
    packet.ray.mask[i] = ~0u;
    packet.ray.flags[i] = 0;
    packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid, bvh, &context, &packet);
  for (int i = 0; i < 16; ++i) {
    if (!valid[i]) continue;
    const auto pixel = as_size((y0 + i / 4) * scene.size + x0 + i % 4);
    const bool hit = packet.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
    id[pixel] = hit ? static_cast<int>(packet.hit.primID[i]) : -1;
    depth[pixel] = packet.ray.tfar[i];
    barycentrics[3 * pixel] = hit ? 1 - packet.hit.u[i] - packet.hit.v[i] : 0;
    barycentrics[3 * pixel + 1] = hit ? packet.hit.u[i] : 0;
    barycentrics[3 * pixel + 2] = hit ? packet.hit.v[i] : 0;
  }
}

void EmbreePeer::draw() {
  State& s = *state_;
  rtcUpdateGeometryBuffer(s.mesh, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(s.mesh);
  rtcCommitScene(s.bvh);
  std::atomic<int> next{0};
  at::parallel_for(0, s.scene.threads, 1, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t thread = begin; thread < end; ++thread) {
      for (int y = 4 * next++; y < s.scene.size; y = 4 * next++) {
        for (int x = 0; x < s.scene.size; x += 4) s.trace(x, y);
      }
    }
  });
}

}  // namespace doppel::bench
