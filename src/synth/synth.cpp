#include "doppel/synth/synth.h"

#include <torch/types.h>
#include <torch/utils.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/core/random.h"
#include "doppel/geometry/image_file.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/synth/capture_writer.h"
#include "doppel/synth/other_body.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/studio.h"
#include "doppel/synth/xpbd_cloth.h"

namespace doppel::synth {

namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kLeadIn = 1.2;     ///< seconds before a take, in which the simulation of the clothes settles
constexpr double kMaxTurn = 360.0;  ///< degrees per second

void check(const SynthOptions& o) {
  const auto within = [](const char* what, long value, long low, long high) {
    if (value < low || value > high)
      fail<UsageError>("doppel synth: {} is {}; it must be {} to {}", what, value, low, high);
  };
  within("the number of cameras", o.cameras, 1, 64);
  within("the image size", o.size, 64, 2048);
  within("the number of training frames", o.frames, 4, 100000);
  within("the number of test frames", o.test_frames, 2, 100000);
  if (o.size % 2 != 0)
    fail<UsageError>("doppel synth: the image size is {}; video encoders need an even number", o.size);
  if (o.body != kOwnBody) measures_of(o.body);  // refuses a word that names no body
  if (o.body != kOwnBody && o.cloth.model == ClothModel::xpbd)
    fail<UsageError>(
        "doppel synth: the cloth model xpbd touches the actor's own body only, and the body is '{}'; give --cloth "
        "springs, or leave --body away",
        o.body);
  if (!(std::abs(o.turn) <= kMaxTurn))
    fail<UsageError>("doppel synth: the person turns by {} degrees per second; this must be {} to {}", o.turn,
                     -kMaxTurn, kMaxTurn);
}

Actor actor_of(const SynthOptions& options) {
  Actor actor = make_actor(options.actor);
  if (options.body != kOwnBody) give_body(actor, measures_of(options.body));
  return actor;
}

/// A temporary folder that the destructor removes unless it was renamed to its final name.
class FolderInTheMaking {
 public:
  FolderInTheMaking(const fs::path& target, bool force) : target_(fs::absolute(target).lexically_normal()) {
    if (!target_.has_filename()) target_ = target_.parent_path();
    if (fs::exists(target_) && !(fs::is_directory(target_) && fs::is_empty(target_))) {
      if (!force)
        fail<UsageError>("doppel synth: {} exists and is not empty; name another folder, or give --force",
                         target.string());
      // Only folders that `doppel synth` made are deleted.
      if (!fs::exists(target_ / "capture.yaml") || !fs::exists(target_ / "ground_truth"))
        fail<UsageError>(
            "doppel synth: {} is not a synthetic capture, so --force does not replace it; name another folder",
            target.string());
    }
    making_ = target_.parent_path() / fmt::format(".{}.making-{}", target_.filename().string(), getpid());
    fs::remove_all(making_);
    fs::create_directories(making_);
  }
  ~FolderInTheMaking() {
    std::error_code ignored;
    fs::remove_all(making_, ignored);
  }
  FolderInTheMaking(const FolderInTheMaking&) = delete;
  FolderInTheMaking& operator=(const FolderInTheMaking&) = delete;

  const fs::path& path() const { return making_; }
  std::string name() const { return target_.filename().string(); }

  void put_in_place() {
    const fs::path old = making_.string() + "-old";
    const bool replaces = fs::exists(target_);
    if (replaces) fs::rename(target_, old);
    fs::rename(making_, target_);
    if (replaces) fs::remove_all(old);
  }

 private:
  fs::path target_, making_;
};

std::vector<float> flat(const Points& points) {
  std::vector<float> values;
  values.reserve(3 * points.size());
  for (const Vector3d& p : points)
    for (const double x : p) values.push_back(static_cast<float>(x));
  return values;
}

/// The output of a simulated detector for the actor's landmarks in the last image.
std::vector<double> detect(const Studio& studio, int camera_index, const Camera& camera, const Points& markers,
                           const std::vector<int>& body25, std::uint64_t key) {
  std::vector<double> result;
  for (std::size_t k = 0; k < body25.size(); ++k) {
    if (body25[k] < 0) {
      result.insert(result.end(), {0.0, 0.0, 0.0});
      continue;
    }
    const Vector3d& p = markers[body25[k]];
    // Landmarks are inside the limbs: an occluder at less than this distance is the limb itself.
    const bool seen = studio.sees(camera_index, p, 0.11);
    const double sigma = (seen ? 0.0025 : 0.008) * camera.width;
    const Vector2d pixel = camera.project(p) + sigma * Vector2d(hash_normal(key + 4 * k), hash_normal(key + 4 * k + 1));
    const double confidence = (seen ? 0.88 : 0.4) + 0.04 * hash_normal(key + 4 * k + 2);
    const auto rounded = [](double x, double unit) { return std::round(x / unit) * unit; };
    result.insert(result.end(), {rounded(pixel.x(), 1e-3), rounded(pixel.y(), 1e-3),
                                 rounded(std::clamp(confidence, 0.05, 1.0), 1e-3)});
  }
  return result;
}

/// The simulated 3D estimates of a network: relative to the root, with an error that changes slowly (larger in depth)
/// and noise in every frame.
Points estimate_joints(const Camera& camera, const Points& markers, const std::vector<int>& body25, int frame,
                       std::uint64_t key) {
  constexpr double kNoise = 0.025, kBias = 0.01, kPeriod = 40.0;  // metres, metres, frames
  constexpr std::size_t kMidHip = 8;
  Points result(body25.size(), Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  const Vector3d& root = markers[body25[kMidHip]];
  for (std::size_t k = 0; k < body25.size(); ++k) {
    if (body25[k] < 0) continue;
    result[k] = camera.R * (markers[body25[k]] - root);
    if (k == kMidHip) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const double phase = 1.7 * static_cast<double>(3 * k + axis), depth = axis == 2 ? 2.0 : 1.0;
      result[k][axis] += depth * kBias * std::sin(2.0 * M_PI * frame / kPeriod + phase) +
                         kNoise * hash_normal(key + 4 * k + as_size(axis));
    }
  }
  return result;
}

Points marker_positions(const Skeleton& skeleton, const std::vector<double>& dofs) {
  const auto world_from_joint = skeleton.pose(dofs);
  Points points;
  for (const Marker& marker : skeleton.markers) points.push_back(world_from_joint[marker.joint] * marker.position);
  return points;
}

/// The data for filming a sequence.
struct Set {
  const Actor& actor;
  const std::vector<Camera>& cameras;
  Studio& studio;
  const SynthOptions& options;
  const fs::path& root;
};

void film(const Set& set, const std::string& name, int sequence, const std::vector<Take>& takes, Progress& progress) {
  SequenceWriter writer(set.root / name, set.cameras, set.options.fps);
  NpyStream ground_truth(set.root / "ground_truth" / name / "vertices.npy", {set.actor.character.num_vertices(), 3});
  const std::vector<int> body25 = body25_markers(set.actor.character.skeleton);
  Motion motion;
  for (const Take& take : takes)
    for (std::size_t f = 0; f < take.ground_truth.size(); ++f) {
      if (stop_requested()) fail("doppel synth: stopped; nothing was saved");
      const int frame = motion.num_frames();
      motion.frames.push_back(take.motion.frames[f]);
      motion.ids.push_back(frame);
      ground_truth.append(flat(take.ground_truth[f]));
      set.studio.set_surface(take.ground_truth[f]);
      const Points markers = marker_positions(set.actor.character.skeleton, motion.frames.back());
      for (std::size_t c = 0; c < set.cameras.size(); ++c) {
        const int camera = static_cast<int>(c);
        const std::uint64_t key =
            (static_cast<std::uint64_t>(sequence) << 40) + static_cast<std::uint64_t>(frame) * 64 + c;
        writer.write_shot(camera, set.studio.shoot(camera, key));
        writer.write_keypoints(
            camera, frame,
            detect(set.studio, camera, set.cameras[c], markers, body25, hash_bits(~key ^ set.options.seed)));
        writer.write_joints(
            camera, frame,
            estimate_joints(set.cameras[c], markers, body25, frame, hash_bits(key ^ ~set.options.seed) + 1000));
      }
      progress.advance(1, name);
    }
  writer.write_motion_rows(motion);
  writer.close();
  ground_truth.close();
}

torch::Tensor in_cameras(const Points& vertices, const std::vector<Camera>& cameras) {
  torch::Tensor points =
      torch::empty({static_cast<int64_t>(cameras.size()), static_cast<int64_t>(vertices.size()), 3}, torch::kFloat32);
  float* out = points.data_ptr<float>();
  for (const Camera& camera : cameras)
    for (const Vector3d& v : vertices)
      for (const double x : Vector3d(camera.camera_from_world(v))) *out++ = static_cast<float>(x);
  return points;
}

/// Mean intersection over union of two surfaces' silhouettes in all cameras.
double silhouette_iou(Rasterizer& rasterizer, const std::vector<Camera>& cameras, const Points& a, const Points& b) {
  torch::Tensor intrinsics = torch::empty({static_cast<int64_t>(cameras.size()), 4}, torch::kFloat32);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Eigen::Matrix3d& K = cameras[c].K;
    const std::array<double, 4> row{K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
    for (int k = 0; k < 4; ++k) intrinsics[static_cast<int64_t>(c)][k] = row[k];
  }
  const int64_t height = cameras.front().height, width = cameras.front().width;
  const torch::Tensor x = rasterizer.coverage(in_cameras(a, cameras), intrinsics, height, width).to(torch::kBool);
  const torch::Tensor y = rasterizer.coverage(in_cameras(b, cameras), intrinsics, height, width).to(torch::kBool);
  const torch::Tensor both = x.logical_and(y).sum({1, 2}).to(torch::kFloat64);
  const torch::Tensor any = x.logical_or(y).sum({1, 2}).to(torch::kFloat64);
  return (both / any).mean().item<double>();
}

SynthReport measure(const Actor& actor, const std::vector<Camera>& cameras, const Take& test) {
  SynthReport report;
  const Character& c = actor.character;
  report.vertices = c.num_vertices();
  report.faces = c.mesh.num_faces();
  report.nodes = c.num_nodes();
  report.dofs = c.num_dofs();
  Rasterizer rasterizer(face_tensor(c.mesh));
  int counted = 0;
  for (std::size_t f = 0; f < test.ground_truth.size(); ++f) {
    for (int v = 0; v < c.num_vertices(); ++v) {
      const double moved = (test.ground_truth[f][v] - test.skinned[f][v]).norm();
      report.largest_displacement = std::max(report.largest_displacement, moved);
      if (actor.looseness[v] < 0.05) continue;
      report.mean_displacement += moved;
      ++counted;
    }
    report.skinning_iou += silhouette_iou(rasterizer, cameras, test.skinned[f], test.ground_truth[f]) /
                           static_cast<double>(test.ground_truth.size());
  }
  report.mean_displacement /= std::max(counted, 1);
  return report;
}

void write_still_files(const Set& set, const std::string& name) {
  write_character(set.root / "character", set.actor.character);
  fs::create_directories(set.root / "calibration");
  for (const std::string& file : calibration_files(set.options))
    write_calibration(set.root / "calibration" / file, set.cameras);
  fs::create_directories(set.root / "background");
  for (std::size_t c = 0; c < set.cameras.size(); ++c) {
    const fs::path path = set.root / "background" / (three_digits(static_cast<int>(c)) + ".png");
    write_image(path, set.studio.background(static_cast<int>(c)));
  }
  write_atomically(set.root / "capture.yaml", capture_yaml(set.options, name));
  write_atomically(set.root / "README.txt", readme_text(set.options));
}

}  // namespace

ClothModel cloth_model(const std::string& name) {
  if (name == "springs") return ClothModel::springs;
  if (name == "xpbd") return ClothModel::xpbd;
  fail<UsageError>("doppel synth: there is no cloth model '{}'; use springs or xpbd", name);
}

std::string cloth_name(ClothModel model) { return model == ClothModel::xpbd ? "xpbd" : "springs"; }

Lens synth_lens(const std::string& name) {
  if (name == "pinhole") return Lens::opencv;
  if (name == "fisheye") return Lens::fisheye;
  fail<UsageError>("doppel synth: there is no lens '{}'; use pinhole or fisheye", name);
}

SynthOptions SynthOptions::preset(const std::string& name) {
  SynthOptions o;
  if (name == "small") return o;
  if (name != "tiny") fail<UsageError>("doppel synth: there is no preset '{}'; use tiny or small", name);
  o.actor.vertices = 1500;
  o.actor.nodes = 150;
  o.actor.texture_size = 512;
  o.cameras = 4;
  o.size = 192;
  o.frames = 24;
  o.test_frames = 12;
  return o;
}

std::vector<Points> skin_motion(const Character& character, const Motion& motion, const Points& offset) {
  constexpr int kChunk = 16;
  const torch::NoGradGuard no_grad;
  const int64_t n = character.num_vertices();
  // In double precision, because this is the ground truth for evaluation.
  torch::Tensor points = torch::empty({n, 3}, torch::kFloat64);
  for (int64_t v = 0; v < n; ++v) {
    const Vector3d p = character.mesh.vertices[v] + (offset.empty() ? Vector3d(Vector3d::Zero()) : offset[v]);
    for (int a = 0; a < 3; ++a) points.data_ptr<double>()[3 * v + a] = p[a];
  }
  Kinematics kinematics(character);
  Skinning skinning(character.skin, character.skinning);
  std::vector<Points> frames;
  for (int begin = 0; begin < motion.num_frames(); begin += kChunk) {
    const int count = std::min(kChunk, motion.num_frames() - begin);
    torch::Tensor dofs = torch::empty({count, character.num_dofs()}, torch::kFloat64);
    for (int f = 0; f < count; ++f)
      std::copy(motion.frames[begin + f].begin(), motion.frames[begin + f].end(),
                dofs.data_ptr<double>() + static_cast<int64_t>(f) * character.num_dofs());
    const torch::Tensor skinned = skinning->forward(points, kinematics->bones(dofs)).contiguous();
    const double* x = skinned.data_ptr<double>();
    for (int f = 0; f < count; ++f) {
      Points frame;
      for (int64_t v = 0; v < n; ++v, x += 3) frame.emplace_back(x[0], x[1], x[2]);
      frames.push_back(std::move(frame));
    }
  }
  return frames;
}

Take perform(const Actor& actor, int frames, double fps, std::uint64_t seed, const ClothOptions& cloth, double turn) {
  const int lead = static_cast<int>(std::ceil(kLeadIn * fps));
  Take take;
  take.motion = make_motion(actor.character.skeleton, lead + frames, fps, seed, turn);
  const std::vector<Points> worn = skin_motion(actor.character, take.motion, actor.hang);
  take.ground_truth = cloth.model == ClothModel::xpbd ? drape_clothes(actor, worn, take.motion, fps, cloth.xpbd)
                                                      : move_clothes(actor, worn, fps, cloth.springs);
  take.ground_truth.erase(take.ground_truth.begin(), take.ground_truth.begin() + lead);
  take.motion.frames.erase(take.motion.frames.begin(), take.motion.frames.begin() + lead);
  take.motion.ids.resize(frames);
  take.skinned = skin_motion(actor.character, take.motion, {});
  return take;
}

SynthReport write_synthetic_capture(const fs::path& folder, const SynthOptions& options) {
  check(options);
  FolderInTheMaking making(folder, options.force);
  Progress progress("synth", options.frames + options.test_frames);
  const Actor actor = actor_of(options);
  const std::vector<Camera> cameras = make_cameras(options.cameras, options.size, options.seed, options.lens);
  StudioOptions studio_options;
  studio_options.seed = options.seed;
  Studio studio(actor, cameras, studio_options);
  const Set set{actor, cameras, studio, options, making.path()};
  write_still_files(set, making.name());

  const auto take = [&](int frames, std::uint64_t number) {
    return perform(actor, frames, options.fps, hash_bits(options.seed * 1000 + number), options.cloth,
                   options.turn * M_PI / 180.0);
  };
  const int first = options.frames / 2;
  film(set, "training", 0, {take(first, 1), take(options.frames - first, 2)}, progress);
  const Take test = take(options.test_frames, 3);
  film(set, "testing", 1, {test}, progress);
  progress.finish();
  const SynthReport report = measure(actor, cameras, test);
  making.put_in_place();
  return report;
}

}  // namespace doppel::synth
