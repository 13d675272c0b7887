#include "doppel/synth/takes.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "doppel/character/root_motion.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/random.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/repertoire.h"
#include "doppel/synth/xpbd_cloth.h"

namespace doppel::synth {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kLeadIn = 1.2;    ///< seconds
constexpr double kClipRoom = 0.6;  ///< metres, from the middle of its way, that a person may go in a clip

/// The numbers of frames of `takes` takes of equal length.
std::vector<int> split_frames(int frames, int takes) {
  std::vector<int> lengths;
  for (int k = 0; k < takes; ++k) {
    const auto end = [&](int take) { return static_cast<int>(static_cast<long>(frames) * take / takes); };
    lengths.push_back(end(k + 1) - end(k));
  }
  return lengths;
}

/// The number of generated takes.
int num_takes(int frames, int take_frames, int otherwise) {
  if (frames == 0) return 0;
  return take_frames == 0 ? otherwise : std::max(1, (frames + take_frames / 2) / take_frames);
}

/// Brings the person to the centre of the studio, and the lowest sole of all frames to the floor.
void bring_into_studio(const Skeleton& skeleton, const std::filesystem::path& file, Motion& motion) {
  const std::optional<Skeleton::Root> root = root_that_travels(skeleton);
  if (!root) fail("doppel synth: the root of the actor does not travel");
  Eigen::AlignedBox2d way;
  for (const auto& dofs : motion.frames) way.extend(ground_position(*root, dofs));
  Vector2d middle = way.center();
  const double reach = 0.5 * way.diagonal().norm();
  if (reach > kClipRoom) {
    log::info(
        "{}: the person goes {:.2f} m from the middle of the way, and the studio has {} m; the person is held above "
        "one point",
        file.string(), reach, kClipRoom);
    motion = in_place(*root, std::move(motion));
    middle = ground_position(*root, motion.frames.front());
  }
  double lowest = std::numeric_limits<double>::infinity();
  for (const auto& dofs : motion.frames) lowest = std::min(lowest, sole_height(skeleton, dofs));
  const std::array<double, 3> shift{-middle.x(), -lowest, -middle.y()};
  for (auto& dofs : motion.frames)
    for (int axis = 0; axis < 3; ++axis) dofs[root->translation[axis]] += shift[axis] / root->translation_weight[axis];
}

TakePlan plan_clip(const std::filesystem::path& file, const Character& character, double fps) {
  MotionFileOptions options;
  options.frames_per_second = fps;
  MotionFromFile read = read_motion_file(file, character, options);
  for (const std::string& note : read.notes) log::info("{}: {}", file.string(), note);
  for (const std::string& warning : read.warnings) log::warn("{}: {}", file.string(), warning);
  if (read.motion.frames.empty()) fail<UsageError>("{}: the motion has no frames", file.string());
  bring_into_studio(character.skeleton, file, read.motion);
  return {read.motion.num_frames(), 0, std::move(read.motion)};
}

/// The motion of a file after a person who stands in its first pose.
Motion after_standing(const Motion& clip, int lead) {
  Motion motion;
  motion.frames.assign(static_cast<std::size_t>(lead), clip.frames.front());
  motion.frames.insert(motion.frames.end(), clip.frames.begin(), clip.frames.end());
  motion.ids.resize(motion.frames.size());
  std::iota(motion.ids.begin(), motion.ids.end(), 0L);
  return motion;
}

/// The motion of a take after its lead-in.
Motion motion_of(const TakePlan& plan, const SynthOptions& options, const Skeleton& skeleton) {
  const int lead = lead_in(options.fps), frames = lead + plan.frames;
  if (plan.clip) return after_standing(*plan.clip, lead);
  if (options.movements == Movements::varied)
    return make_varied_motion(skeleton, frames, options.fps, plan.seed, options.room);
  return make_motion(skeleton, frames, options.fps, plan.seed, options.turn * M_PI / 180.0);
}

}  // namespace

std::vector<Points> skin_motion(const Character& character, const Motion& motion, const Points& offset) {
  constexpr int kChunk = 64;  // frames at a time, which bounds the memory of long takes
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

int lead_in(double fps) { return static_cast<int>(std::ceil(kLeadIn * fps)); }

Take perform(const Actor& actor, Motion with_lead_in, double fps, const ClothOptions& cloth) {
  const int lead = lead_in(fps);
  Take take;
  take.motion = std::move(with_lead_in);
  const std::vector<Points> worn = skin_motion(actor.character, take.motion, actor.hang);
  take.ground_truth = cloth.model == ClothModel::xpbd ? drape_clothes(actor, worn, take.motion, fps, cloth.xpbd)
                                                      : move_clothes(actor, worn, fps);
  take.ground_truth.erase(take.ground_truth.begin(), take.ground_truth.begin() + lead);
  take.motion.frames.erase(take.motion.frames.begin(), take.motion.frames.begin() + lead);
  take.motion.ids.resize(take.motion.frames.size());
  return take;
}

int SequencePlan::frames() const {
  return std::accumulate(takes.begin(), takes.end(), 0,
                         [](int sum, const TakePlan& take) { return sum + take.frames; });
}

std::vector<int> SequencePlan::cuts() const {
  std::vector<int> cuts;
  for (std::size_t k = 0, first = 0; k + 1 < takes.size(); ++k) {
    first += static_cast<std::size_t>(takes[k].frames);
    cuts.push_back(static_cast<int>(first));
  }
  return cuts;
}

std::vector<SequencePlan> plan_sequences(const SynthOptions& options, const Character& character) {
  std::vector<SequencePlan> sequences;
  std::uint64_t number = 0;
  for (const bool training : {true, false}) {
    SequencePlan sequence{training ? "training" : "testing", training, {}};
    const int frames = training ? options.frames : options.test_frames;
    for (const int length : split_frames(frames, num_takes(frames, options.take_frames, training ? 2 : 1)))
      sequence.takes.push_back({length, hash_bits(options.seed * 1000 + ++number), {}});
    for (const std::filesystem::path& file : training ? options.clips : options.test_clips)
      sequence.takes.push_back(plan_clip(file, character, options.fps));
    sequences.push_back(std::move(sequence));
  }
  return sequences;
}

Take perform(const Actor& actor, const TakePlan& plan, const SynthOptions& options) {
  return perform(actor, motion_of(plan, options, actor.character.skeleton), options.fps, options.cloth);
}

}  // namespace doppel::synth
