#include "doppel/synth/studio.h"

#include <ATen/Parallel.h>
#include <torch/types.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/random.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/synth/body_field.h"

namespace doppel::synth {

/// How a camera is drawn. The rasterizer knows no lenses: it draws an image without distortion that covers the whole
/// image of the camera, and each sample of the camera's image is looked up there.
struct CameraDrawing {
  Camera pinhole;                    ///< at the resolution of the samples
  std::vector<std::int32_t> sample;  ///< [samples of the camera's image] index in the drawn image; empty: the same

  std::size_t drawn(std::size_t of_camera) const {
    return sample.empty() ? of_camera : static_cast<std::size_t>(sample[of_camera]);
  }
};

namespace {

using Eigen::Array3f;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

/// Light is computed in linear RGB; the values of an image are its square root.
using Light = Array3f;

const Light kKeyColour(1.08f, 1.0f, 0.88f), kSkyColour(0.36f, 0.39f, 0.44f), kGroundColour(0.17f, 0.21f, 0.15f),
    kRimColour(0.20f, 0.24f, 0.30f);

Vector3d light_position() { return {2.3, 4.6, 3.4}; }
Vector3d light_target() { return {0, 0.6, 0}; }

Camera looking_at(const Vector3d& from, const Vector3d& at, double focal, int size) {
  Camera camera;
  camera.width = camera.height = size;
  camera.K << focal, 0, 0.5 * size, 0, focal, 0.5 * size, 0, 0, 1;
  const Vector3d forward = (at - from).normalized(), right = forward.cross(Vector3d::UnitY()).normalized();
  camera.R << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  camera.t = -camera.R * from;
  return camera;
}

torch::Tensor camera_space(const Points& vertices, const Camera& camera) {
  torch::Tensor points = torch::empty({1, static_cast<int64_t>(vertices.size()), 3}, torch::kFloat32);
  float* out = points.data_ptr<float>();
  for (const Vector3d& v : vertices)
    for (const double x : Vector3d(camera.camera_from_world(v))) *out++ = static_cast<float>(x);
  return points;
}

torch::Tensor intrinsics(const Camera& camera) {
  return torch::tensor({camera.K(0, 0), camera.K(1, 1), camera.K(0, 2), camera.K(1, 2)}, torch::kFloat64)
      .to(torch::kFloat32)
      .view({1, 4});
}

std::array<float, 256> linear_table() {
  std::array<float, 256> table;
  for (int i = 0; i < 256; ++i) table[i] = static_cast<float>(i * i) / (255.0f * 255.0f);
  return table;
}

/// The ray of a pixel, at depth 1 in camera space.
Vector3d ray_of(const Camera& camera, const Vector2d& pixel) {
  const Vector2d seen = (camera.K.inverse() * pixel.homogeneous()).head<2>();
  const std::optional<Vector2d> point = camera.undistorted(seen);
  if (!point) fail("doppel synth: the lens of camera {} has no inverse at {}, {}", camera.name, pixel.x(), pixel.y());
  return point->homogeneous();
}

Camera enlarged(const Camera& camera, int scale) {
  Camera large = camera;
  large.width *= scale;
  large.height *= scale;
  large.K.topRows<2>() *= scale;
  return large;
}

/// @param supersampling samples per pixel along each axis
CameraDrawing drawing_of(const Camera& camera, int supersampling) {
  CameraDrawing drawing{enlarged(camera, supersampling), {}};
  if (!camera.has_distortion()) return drawing;
  const Camera samples = drawing.pinhole;
  std::vector<Vector2d> points;
  points.reserve(as_size(samples.width) * as_size(samples.height));
  Eigen::AlignedBox2d extent;
  for (int y = 0; y < samples.height; ++y)
    for (int x = 0; x < samples.width; ++x)
      extent.extend(points.emplace_back(ray_of(samples, {x + 0.5, y + 0.5}).head<2>()));
  Camera& pinhole = drawing.pinhole;
  pinhole.lens = Lens::opencv;
  pinhole.distortion = {};
  pinhole.K.topRightCorner<2, 1>() = Vector2d::Ones() - pinhole.K.topLeftCorner<2, 2>() * extent.min();
  const Vector2d size = pinhole.K.topLeftCorner<2, 2>() * extent.sizes() + Vector2d::Constant(3);
  pinhole.width = static_cast<int>(size.x());
  pinhole.height = static_cast<int>(size.y());
  for (const Vector2d& point : points) {
    const Vector3d pixel = pinhole.K * point.homogeneous();
    drawing.sample.push_back(static_cast<int>(pixel.y()) * pinhole.width + static_cast<int>(pixel.x()));
  }
  return drawing;
}

}  // namespace

struct Studio::State {
  /// The image of the empty studio in one camera, and the positions of its floor.
  struct Backdrop {
    std::vector<Light> lit;    ///< [H*W]
    std::vector<float> floor;  ///< [H*W*2] x, z of the floor seen there; NaN: the wall, or too far to be shaded
  };

  State(const Actor& who, std::vector<Camera> all, const StudioOptions& how)
      : actor(who),
        cameras(std::move(all)),
        options(how),
        rasterizer(face_tensor(who.character.mesh)),
        shadow_rasterizer(face_tensor(who.character.mesh)),
        to_linear(linear_table()) {
    shadow_camera = looking_at(light_position(), light_target(), 1.35 * options.shadow_size, options.shadow_size);
    for (const Camera& camera : cameras) {
      backdrops.push_back(make_backdrop(camera));
      drawings.push_back(drawing_of(camera, options.supersampling));
    }
  }

  Backdrop make_backdrop(const Camera& camera) const;
  void light_rows(int camera, std::uint64_t key, Shot& shot, int begin, int end) const;
  bool light_sample(std::size_t sample, Light& sum) const;
  Light lit_surface(const Vector3f& position, const Vector3f& normal, const Light& albedo, float open) const;
  Light albedo(float u, float v) const;
  float key_share(const Vector3f& position) const;
  float floor_shade(float x, float z) const;

  const Actor& actor;
  std::vector<Camera> cameras;
  StudioOptions options;
  Rasterizer rasterizer, shadow_rasterizer;
  std::array<float, 256> to_linear;
  Camera shadow_camera;
  std::vector<Backdrop> backdrops;
  std::vector<CameraDrawing> drawings;

  // Of the current surface.
  Points vertices;
  std::vector<Vector3f> position, normal;
  const float* shadow_depth = nullptr;
  Vector3f eye = Vector3f::Zero();
  // Of the current image.
  const int* face_id = nullptr;
  const float* depth = nullptr;
  const float* barycentrics = nullptr;
};

Studio::State::Backdrop Studio::State::make_backdrop(const Camera& camera) const {
  Backdrop backdrop;
  const Vector3d centre = camera.centre();
  const float nowhere = std::numeric_limits<float>::quiet_NaN();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vector3d ray = (camera.R.transpose() * ray_of(camera, {x + 0.5, y + 0.5})).normalized();
      const double reach = ray.y() < -1e-3 ? -centre.y() / ray.y() : 1e3;
      const Vector3d ground = centre + reach * ray;
      const double away = std::hypot(ground.x(), ground.z());
      // The floor passes smoothly into the wall at about 3.5 m from the centre.
      const double wall = smooth_step(2.6, 4.2, away);
      const double glow = 0.9 + 0.16 * ray.y() + 0.07 * std::sin(1.7 * std::atan2(ray.x(), ray.z()) + 0.6);
      const Light floor_colour = Light(0.040f, 0.255f, 0.072f) * static_cast<float>(1.16 - 0.10 * away);
      const Light wall_colour = Light(0.036f, 0.270f, 0.070f) * static_cast<float>(glow);
      backdrop.lit.emplace_back(floor_colour * static_cast<float>(1 - wall) + wall_colour * static_cast<float>(wall));
      backdrop.floor.push_back(wall < 0.5 ? static_cast<float>(ground.x()) : nowhere);
      backdrop.floor.push_back(wall < 0.5 ? static_cast<float>(ground.z()) : nowhere);
    }
  return backdrop;
}

/// The share of the key light that reaches a point: 25 comparisons with the shadow map around it.
float Studio::State::key_share(const Vector3f& point) const {
  const Vector3d p = shadow_camera.camera_from_world(point.cast<double>());
  const int size = options.shadow_size;
  const double u = shadow_camera.K(0, 0) * p.x() / p.z() + 0.5 * size,
               v = shadow_camera.K(1, 1) * p.y() / p.z() + 0.5 * size;
  const int column = static_cast<int>(std::floor(u)), row = static_cast<int>(std::floor(v));
  if (column < 3 || row < 3 || column >= size - 3 || row >= size - 3) return 1;
  const float limit = static_cast<float>(p.z()) - 0.02f;
  const float fu = static_cast<float>(u - column), fv = static_cast<float>(v - row);
  const auto in_light = [&](int dy, int dx) { return shadow_depth[as_size(row + dy) * size + column + dx] > limit; };
  int lit_texels = 0;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) lit_texels += in_light(dy, dx) ? 1 : 0;
  if (lit_texels == 0 || lit_texels == 25) return lit_texels == 0 ? 0.0f : 1.0f;
  float lit = 0, total = 0;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) {
      // A tent filter around the point, so that the penumbra has no steps.
      const float weight =
          std::max(0.0f, 2.5f - std::abs(dx + 0.5f - fu)) * std::max(0.0f, 2.5f - std::abs(dy + 0.5f - fv));
      lit += weight * (in_light(dy, dx) ? 1.0f : 0.0f);
      total += weight;
    }
  return lit / total;
}

Light Studio::State::lit_surface(const Vector3f& at, const Vector3f& n, const Light& colour, float open) const {
  const Vector3f key = (light_position().cast<float>() - at).normalized();
  const Vector3f rim = Vector3f(-0.6f, 0.25f, -0.75f).normalized();
  const float up = 0.5f + 0.5f * n.y(), facing = n.dot(key);
  const Light around = (kSkyColour * up + kGroundColour * (1 - up)) * open;
  const float direct = facing > 0 ? facing * key_share(at + 0.012f * n) : 0;
  return colour * (around + kKeyColour * direct + kRimColour * std::max(0.0f, n.dot(rim)));
}

/// Bilinear texture value in linear RGB.
Light Studio::State::albedo(float u, float v) const {
  const cv::Mat& texture = actor.character.mesh.texture;
  const float x = std::clamp(u * texture.cols - 0.5f, 0.0f, texture.cols - 1.001f);
  const float y = std::clamp((1 - v) * texture.rows - 0.5f, 0.0f, texture.rows - 1.001f);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float fx = x - column, fy = y - row;
  const auto texel = [&](int dy, int dx) {
    const uchar* bgr = texture.ptr<uchar>(row + dy) + 3 * (column + dx);
    return Light(to_linear[bgr[2]], to_linear[bgr[1]], to_linear[bgr[0]]);
  };
  return (texel(0, 0) * (1 - fx) + texel(0, 1) * fx) * (1 - fy) + (texel(1, 0) * (1 - fx) + texel(1, 1) * fx) * fy;
}

/// Light on the floor relative to the empty studio: the actor's shadow, and ambient occlusion at the feet.
float Studio::State::floor_shade(float x, float z) const {
  if (std::isnan(x)) return 1;
  const float dx = x - eye.x(), dz = z - eye.z(), near = dx * dx + dz * dz;
  if (near > 9) return 1;
  const float key = key_share({x, 0.0f, z});
  return (0.5f + 0.5f * key) * (1 - 0.28f * std::exp(-near / 0.12f));
}

/// Adds the light of one sample. False if the actor does not cover the sample.
bool Studio::State::light_sample(std::size_t sample, Light& sum) const {
  const int face = face_id[sample];
  if (face < 0) return false;
  const TriangleMesh& mesh = actor.character.mesh;
  const Triangle &corner = mesh.faces[face], &corner_uv = mesh.face_uvs[face];
  Vector3f at = Vector3f::Zero(), n = Vector3f::Zero();
  float u = 0, v = 0, open = 0;
  for (int c = 0; c < 3; ++c) {
    const float weight = barycentrics[3 * sample + c];
    at += weight * position[corner[c]];
    n += weight * normal[corner[c]];
    open += weight * static_cast<float>(actor.openness[corner[c]]);
    u += weight * static_cast<float>(mesh.uvs[corner_uv[c]].x());
    v += weight * static_cast<float>(mesh.uvs[corner_uv[c]].y());
  }
  sum += lit_surface(at, n.normalized(), albedo(u, v), open);
  return true;
}

void Studio::State::light_rows(int camera, std::uint64_t key, Shot& shot, int begin, int end) const {
  const int size_x = cameras[camera].width, s = options.supersampling;
  const Backdrop& backdrop = backdrops[camera];
  const CameraDrawing& drawing = drawings[camera];
  const float noise = static_cast<float>(options.noise);
  for (int y = begin; y < end; ++y)
    for (int x = 0; x < size_x; ++x) {
      Light sum = Light::Zero();
      int covered = 0;
      for (int dy = 0; dy < s; ++dy)
        for (int dx = 0; dx < s; ++dx)
          covered +=
              light_sample(drawing.drawn((as_size(y) * s + dy) * (as_size(size_x) * s) + as_size(x * s + dx)), sum);
      const std::size_t pixel = as_size(y) * size_x + x;
      if (covered < s * s) {
        const float shade = floor_shade(backdrop.floor[2 * pixel], backdrop.floor[2 * pixel + 1]);
        sum += backdrop.lit[pixel] * (shade * static_cast<float>(s * s - covered));
      }
      const Light display = 255 * (sum / static_cast<float>(s * s)).max(0).min(1).sqrt();
      uchar* bgr = shot.image.ptr<uchar>(y) + 3 * x;
      for (int c = 0; c < 3; ++c)
        bgr[c] = cv::saturate_cast<uchar>(display[2 - c] + noise * hash_normal(key + 3 * pixel + as_size(c)));
      shot.mask.at<uchar>(y, x) = 2 * covered > s * s ? 255 : 0;
    }
}

std::vector<Camera> make_cameras(int count, int size, std::uint64_t seed, Lens lens, double room) {
  if (lens == Lens::polynomial) fail<UsageError>("doppel synth: the lenses are pinhole and fisheye");
  const bool fisheye = lens == Lens::fisheye;
  const double distance = (fisheye ? 2.2 : 4.3) + 1.6 * room, focal_per_side = fisheye ? 0.6 : 1.72;
  Random random(hash_bits(seed ^ 0xca3e7a));
  std::vector<Camera> cameras;
  for (int c = 0; c < count; ++c) {
    const double angle = 6.283185307179586 * (c + random.uniform(-0.12, 0.12)) / count + 0.35;
    const double height = (c % 2 == 0 ? 1.15 : 2.15) + random.uniform(-0.12, 0.12),
                 radius = distance + random.uniform(-0.15, 0.15);
    const Vector3d target(random.uniform(-0.04, 0.04), 0.97 + random.uniform(-0.03, 0.03), random.uniform(-0.04, 0.04));
    const double focal = focal_per_side * size * random.uniform(0.98, 1.02);
    Camera camera = looking_at({radius * std::sin(angle), height, radius * std::cos(angle)}, target, focal, size);
    camera.name = std::to_string(c);
    camera.K(1, 1) *= random.uniform(0.998, 1.002);
    camera.K(0, 2) += size * random.uniform(-0.012, 0.012);
    camera.K(1, 2) += size * random.uniform(-0.012, 0.012);
    const Eigen::Matrix3d roll = Eigen::AngleAxisd(random.uniform(-0.015, 0.015), Vector3d::UnitZ()).toRotationMatrix();
    camera.R = roll * camera.R;
    camera.t = roll * camera.t;
    camera.lens = lens;
    if (fisheye)  // of the size of an action camera's
      camera.distortion = {random.uniform(-0.04, -0.02), random.uniform(0.0, 0.01), random.uniform(-0.006, -0.002),
                           random.uniform(0.0, 0.001)};
    cameras.push_back(camera);
  }
  return cameras;
}

Studio::Studio(const Actor& actor, std::vector<Camera> cameras, const StudioOptions& options)
    : state_(std::make_unique<State>(actor, std::move(cameras), options)) {}

Studio::~Studio() = default;

void Studio::set_surface(const Points& vertices) {
  State& s = *state_;
  s.vertices = vertices;
  TriangleMesh mesh;
  mesh.vertices = vertices;
  mesh.faces = s.actor.character.mesh.faces;
  s.position.clear();
  s.normal.clear();
  for (const Vector3d& n : vertex_normals(mesh)) s.normal.emplace_back(n.cast<float>());
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& v : vertices) {
    s.position.emplace_back(v.cast<float>());
    middle += v / static_cast<double>(vertices.size());
  }
  s.eye = middle.cast<float>();
  const int size = s.options.shadow_size;
  s.shadow_depth =
      s.shadow_rasterizer.rasterize(camera_space(vertices, s.shadow_camera), intrinsics(s.shadow_camera), size, size)
          .depth.data_ptr<float>();
}

Studio::Shot Studio::shoot(int camera, std::uint64_t noise_key) {
  State& s = *state_;
  const Camera& c = s.cameras[camera];
  const Camera& drawn = s.drawings[camera].pinhole;
  const RasterImage& raster =
      s.rasterizer.rasterize(camera_space(s.vertices, drawn), intrinsics(drawn), drawn.height, drawn.width);
  s.face_id = raster.face_id.data_ptr<int>();
  s.depth = raster.depth.data_ptr<float>();
  s.barycentrics = raster.barycentrics.data_ptr<float>();
  Shot shot{cv::Mat(c.height, c.width, CV_8UC3), cv::Mat(c.height, c.width, CV_8U)};
  const std::uint64_t key = hash_bits(hash_bits(s.options.seed) ^ noise_key);
  at::parallel_for(0, c.height, 8, [&](int64_t begin, int64_t end) {
    s.light_rows(camera, key, shot, static_cast<int>(begin), static_cast<int>(end));
  });
  return shot;
}

bool Studio::sees(int camera, const Vector3d& point, double depth) const {
  const State& s = *state_;
  const Camera& c = s.drawings[camera].pinhole;
  const Vector2d pixel = c.project(point);
  const int x = static_cast<int>(std::floor(pixel.x())), y = static_cast<int>(std::floor(pixel.y()));
  if (s.depth == nullptr || x < 0 || y < 0 || x >= c.width || y >= c.height) return false;
  return c.camera_from_world(point).z() < s.depth[as_size(y) * as_size(c.width) + as_size(x)] + depth;
}

cv::Mat Studio::background(int camera) const {
  const Camera& c = state_->cameras[camera];
  cv::Mat image(c.height, c.width, CV_8UC3);
  for (int y = 0; y < c.height; ++y)
    for (int x = 0; x < c.width; ++x) {
      const Light display = 255 * state_->backdrops[camera].lit[as_size(y) * c.width + x].max(0).min(1).sqrt();
      image.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uchar>(display[2]), cv::saturate_cast<uchar>(display[1]),
                                   cv::saturate_cast<uchar>(display[0])};
    }
  return image;
}

}  // namespace doppel::synth
