#define GL_GLEXT_PROTOTYPES
#include "render/osmesa_peer.h"

#include <GL/gl.h>
#include <GL/glext.h>
#include <GL/osmesa.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "doppel/core/as_size.h"

namespace doppel::bench {

struct OsmesaPeer::State {
  PeerScene scene;
  OSMesaContext context = nullptr;
  std::vector<unsigned> frame, colour;
  std::vector<float> depth;
  std::vector<int> id;
  GLsizei count = 0;
};

namespace {

constexpr float kNear = 0.5f, kFar = 20;

/// Image rows run downward, window rows upward: drawing upside down makes them one.
void set_projection(const PeerScene& s) {
  const float scale = 2 * s.focal / static_cast<float>(s.size), shift = 2 * s.centre / static_cast<float>(s.size) - 1;
  const float a = (kFar + kNear) / (kFar - kNear), b = -2 * kFar * kNear / (kFar - kNear);
  const float columns[16] = {scale, 0, 0, 0, 0, scale, 0, 0, shift, shift, a, 1, 0, 0, b, 0};
  glMatrixMode(GL_PROJECTION);
  glLoadMatrixf(columns);
}

void upload(const PeerScene& s) {
  std::vector<float> corners;
  std::vector<unsigned> colours;
  for (long f = 0; f < s.num_faces; ++f) {
    for (int k = 0; k < 3; ++k) {
      const float* x = s.vertices + 3 * s.faces[3 * f + k];
      corners.insert(corners.end(), x, x + 3);
      colours.push_back(static_cast<unsigned>(f + 1) | 0xff000000u);
    }
  }
  GLuint buffers[2];
  glGenBuffers(2, buffers);
  glBindBuffer(GL_ARRAY_BUFFER, buffers[0]);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(4 * corners.size()), corners.data(), GL_STATIC_DRAW);
  glVertexPointer(3, GL_FLOAT, 0, nullptr);
  glBindBuffer(GL_ARRAY_BUFFER, buffers[1]);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(4 * colours.size()), colours.data(), GL_STATIC_DRAW);
  glColorPointer(4, GL_UNSIGNED_BYTE, 0, nullptr);
  glEnableClientState(GL_VERTEX_ARRAY);
  glEnableClientState(GL_COLOR_ARRAY);
}

}  // namespace

OsmesaPeer::OsmesaPeer(const PeerScene& scene) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.scene = scene;
  setenv("LP_NUM_THREADS", std::to_string(scene.threads).c_str(), 1);
  setenv("GALLIUM_DRIVER", "llvmpipe", 1);
  const auto pixels = as_size(scene.size) * as_size(scene.size);
  s.frame.assign(pixels, 0);
  s.colour.assign(pixels, 0);
  s.depth.assign(pixels, 0);
  s.id.assign(pixels, -1);
  s.context = OSMesaCreateContextExt(OSMESA_RGBA, 32, 0, 0, nullptr);
  if (!s.context || !OSMesaMakeCurrent(s.context, s.frame.data(), GL_UNSIGNED_BYTE, scene.size, scene.size)) {
    throw std::runtime_error("OSMesa gives no context");
  }
  glViewport(0, 0, scene.size, scene.size);
  set_projection(scene);
  glEnable(GL_DEPTH_TEST);
  glEnable(GL_CULL_FACE);
  glFrontFace(GL_CW);  // upside down
  glShadeModel(GL_FLAT);
  glDisable(GL_DITHER);
  upload(scene);
  s.count = static_cast<GLsizei>(3 * scene.num_faces);
}

OsmesaPeer::~OsmesaPeer() { OSMesaDestroyContext(state_->context); }

void OsmesaPeer::draw() {
  State& s = *state_;
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  glDrawArrays(GL_TRIANGLES, 0, s.count);
  glReadPixels(0, 0, s.scene.size, s.scene.size, GL_RGBA, GL_UNSIGNED_BYTE, s.colour.data());
  glReadPixels(0, 0, s.scene.size, s.scene.size, GL_DEPTH_COMPONENT, GL_FLOAT, s.depth.data());
}

const std::vector<int>& OsmesaPeer::face_id() {
  State& s = *state_;
  for (std::size_t i = 0; i < s.id.size(); ++i) s.id[i] = static_cast<int>(s.colour[i] & 0xffffff) - 1;
  return s.id;
}

}  // namespace doppel::bench
