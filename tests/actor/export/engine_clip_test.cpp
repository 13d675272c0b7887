// Correctives that follow the bones: fitted to functions that are known.
#include "doppel/actor/export/correctives/engine_clip.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "doppel/actor/export/correctives/weight_fit.h"
#include "doppel/actor/export/correctives/window_mixer.h"
#include "doppel/character/resample_motion.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "support/gltf_pose.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::engine_clip_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;
using torch::Tensor;

constexpr double kRate = 25.0;
constexpr int kPastFrames = 2;

/// Smooth motions; each seed has other phases and frequencies. @param frames of 1/25 s
Motion swaying_motion(const Character& character, int frames, unsigned seed) {
  test_character::Noise noise(seed);
  std::vector<double> phase, speed;
  for (int d = 0; d < character.num_dofs(); ++d) {
    phase.push_back(M_PI * noise.next());
    speed.push_back(0.25 + 0.15 * noise.next());
  }
  Motion motion;
  for (int t = 0; t < frames; ++t) {
    motion.frames.push_back(character.rest_dofs);
    for (std::size_t d = 6; d < phase.size(); ++d) motion.frames.back()[d] += 0.3 * std::sin(phase[d] + speed[d] * t);
  }
  return motion;
}

/// An actor whose surface is skinned with two displacements: one follows an angle, the other the change of another.
class Actor {
 public:
  Character character = make_test_character();
  Figure figure = make_figure(character, BoneNames::skeletool);

  Tensor vertices(const Tensor& windows) const {
    const Tensor result = torch::empty({windows.size(0), character.num_vertices(), 3});
    const Tensor rows = windows.to(torch::kFloat64).contiguous();
    float* out = result.data_ptr<float>();
    for (std::int64_t b = 0; b < rows.size(0); ++b) {
      const double* now = rows[b][rows.size(1) - 1].data_ptr<double>();
      const double* before = rows[b][rows.size(1) - 2].data_ptr<double>();
      const std::vector<double> dofs(now, now + rows.size(2));
      const double bent = 0.05 * std::sin(now[angle_] - character.rest_dofs[angle_]),
                   late = 0.2 * (now[rate_] - before[rate_]);
      const auto blended = blend_transforms(figure, pose_nodes(figure, character.skeleton, dofs));
      for (std::size_t v = 0; v < blended.size(); ++v) {
        const Eigen::Vector3d rest = figure.rest_vertices[v];
        const Eigen::Vector3d moved =
            rest + Eigen::Vector3d(0.01 + bent * std::sin(9.0 * rest.y()), 0.0, late * std::cos(7.0 * rest.y()));
        const Eigen::Vector3d posed = blended[v] * moved;
        for (int axis = 0; axis < 3; ++axis) *out++ = static_cast<float>(posed[axis]);
      }
    }
    return result;
  }

  EngineTeacher teacher(std::vector<Motion> motions) const {
    EngineTeacher teacher;
    teacher.geometry = [this](const Tensor& windows) { return vertices(windows); };
    teacher.past_frames = kPastFrames;
    teacher.frames_per_second = kRate;
    for (Motion& motion : motions) teacher.motions.push_back({std::move(motion), 1.0});
    return teacher;
  }

 private:
  std::size_t angle_ = static_cast<std::size_t>(*character.skeleton.find_dof("flex_2")),
              rate_ = static_cast<std::size_t>(*character.skeleton.find_dof("lean_3"));
};

TEST(WindowMixer, WindowsAreFasterOrSlowerPiecesOfTheMotions) {
  // All DoFs rise by their own amounts from frame to frame, so a window shows its tempo.
  const Character character = make_test_character();
  Motion motion;
  for (int t = 0; t < 200; ++t) {
    motion.frames.emplace_back();
    for (int d = 0; d < character.num_dofs(); ++d) motion.frames.back().push_back(0.001 * t);
  }
  const WindowMixer mixer(character.skeleton, {{motion, 2.0}}, kPastFrames);
  Random random(3);
  int even = 0, mixed = 0;
  double slowest = 1.0, fastest = 0.0;
  for (int i = 0; i < 300; ++i) {
    const auto window = mixer.draw(random);
    ASSERT_EQ(window.size(), 3U);
    const double step = window[2][0] - window[1][0];  // of the root, which has no noise
    EXPECT_LE(step, 2.0 * 0.002 + 1e-9);
    EXPECT_GE(step, -1e-9);
    fastest = std::max(fastest, step);
    if (window[0][0] > 0.0 && window[2][0] < 0.199) slowest = std::min(slowest, step);  // the ends of the motion rest
    bool same = true;
    for (const double value : window[2]) same = same && std::abs(value - window[2][0]) < 1e-9;
    ++(same ? even : mixed);
    EXPECT_NEAR(window[2][1], window[2][0], 1e-9);  // the root stays together
  }
  EXPECT_NEAR(slowest, 0.5 * 0.002, 1e-4);
  EXPECT_NEAR(fastest, 2.0 * 0.002, 1e-4);
  EXPECT_GT(even, 3);
  EXPECT_GT(mixed, 150);
}

TEST(WindowMixer, AFullTurnOfAnAngleIsNoSpeed) {
  // Two motions that differ by full turns of the heading in some frames give windows of the same speeds.
  const Character character = make_test_character();
  const auto heading = static_cast<std::size_t>(*character.skeleton.find_dof("rotate_y"));
  const double turn = full_turns(character.skeleton)[heading];
  ASSERT_GT(turn, 0.0);
  Motion smooth, wrapped;
  for (int t = 0; t < 200; ++t) {
    smooth.frames.emplace_back(as_size(character.num_dofs()), 0.0);
    smooth.frames.back()[heading] = 0.001 * t;
    wrapped.frames.push_back(smooth.frames.back());
    if (t % 20 >= 10) wrapped.frames.back()[heading] -= turn;
  }
  const WindowMixer a(character.skeleton, {{smooth, 1.0}}, kPastFrames),
      b(character.skeleton, {{wrapped, 1.0}}, kPastFrames);
  Random first(5), second(5);
  for (int i = 0; i < 200; ++i) {
    const auto expected = a.draw(first), found = b.draw(second);
    const double off = (found[2][heading] - found[1][heading]) - (expected[2][heading] - expected[1][heading]);
    EXPECT_NEAR(std::remainder(off, turn), 0.0, 1e-6) << i;
  }
}

TEST(WeightFit, FindsAFunctionOfItsOwnForm) {
  auto generator = at::detail::createCPUGenerator(2);
  const int samples = 3000, inputs = 18;
  const Tensor x = torch::randn({samples, inputs}, generator) * 0.3 + 0.1;
  const Tensor linear = torch::randn({inputs, 2}, generator), inner = torch::randn({inputs, 2}, generator);
  const Tensor y = 0.01 * (x.matmul(linear) + 2.0 * at::tanh(x.matmul(inner)) + 3.0);
  const Tensor held_out = torch::arange(samples).remainder(5) == 0;
  CorrectiveFunction function;
  fit_weights({x, y, held_out}, {16, 2500, 1}, function);
  // Brought to 0 to 1, so that `weights` does not clamp.
  const Eigen::VectorXf low = Eigen::VectorXf::Constant(2, -1.0F), high = Eigen::VectorXf::Constant(2, 1.0F);
  scale_weights(function, low, high);
  double off = 0.0, spread = 0.0;
  const Tensor mean = y.mean(0);
  for (int s = 0; s < samples; s += 5) {
    const Eigen::VectorXf row = Eigen::Map<const Eigen::VectorXf>(x[s].data_ptr<float>(), inputs),
                          found = 2.0F * function.weights(row) - Eigen::VectorXf::Ones(2);
    for (int k = 0; k < 2; ++k) {
      off += std::pow(static_cast<double>(found(k)) - y[s][k].item<double>(), 2);
      spread += (y[s][k] - mean[k]).square().item<double>();
    }
  }
  EXPECT_LT(std::sqrt(off / spread), 0.05);
}

TEST(WeightFit, RefusesTooFewSamples) {
  CorrectiveFunction function;
  const WeightSamples none{torch::zeros({3, 2}), torch::zeros({3, 1}), torch::zeros({3}, torch::kBool)};
  EXPECT_THAT(message_of<Error>([&] { fit_weights(none, {}, function); }),
              HasSubstr("3 samples to fit and 0 held out"));
}

/// Writes clips of some motions, the last of which is unseen.
EngineClipReport written_clip(const Actor& actor, const std::filesystem::path& folder, std::vector<Motion> motions,
                              EngineClipOptions options) {
  EngineClipReport report;
  int first = 0;
  for (const Motion& motion : motions) {
    options.parts.push_back({"clip" + std::to_string(first), first, motion.num_frames(), kRate});
    first += motion.num_frames();
    options.unseen.push_back(false);
  }
  options.unseen.back() = true;
  const std::vector<Motion> fitted(motions.begin(), motions.end() - 1);
  const auto writer = make_engine_clip_writer(folder, actor.character, actor.teacher(fitted), options, report);
  for (const Motion& motion : motions)
    for (int t = 0; t < motion.num_frames(); ++t) {
      const Tensor window = motion_window(motion, t, kPastFrames), vertices = actor.vertices(window.unsqueeze(0));
      writer->write({{vertices.data_ptr<float>(), static_cast<std::size_t>(vertices.numel())}, window});
    }
  const torch::NoGradGuard no_gradient;  // as in `animate`
  writer->close();
  return report;
}

/// Mean distance of the vertices of a file from those of an actor in frames of an animation, millimetres.
double distance_of_file(const support::GltfPose& file, const Actor& actor, const Motion& motion, std::size_t animation,
                        const std::vector<int>& frames) {
  const auto index = file.rows(file.primitive()["attributes"]["_VERTEX"].get<int>());
  double sum = 0.0;
  for (const int t : frames) {
    const auto found = file.vertices(t / kRate, animation);
    const Tensor wanted = actor.vertices(motion_window(motion, t, kPastFrames).unsqueeze(0))[0];
    for (std::size_t i = 0; i < found.size(); ++i) {
      const float* at = wanted.data_ptr<float>() + 3 * static_cast<std::size_t>(index[i][0]);
      sum += 1000.0 * (found[i] - Eigen::Map<const Eigen::Vector3f>(at).cast<double>()).norm() /
             static_cast<double>(frames.size() * found.size());
    }
  }
  return sum;
}

std::vector<Motion> three_motions(const Actor& actor) {
  std::vector<Motion> motions;
  for (const unsigned seed : {1U, 2U, 3U}) motions.push_back(swaying_motion(actor.character, 120, seed));
  return motions;
}

TEST(EngineClip, FollowsAnActorOnAnUnseenClip) {
  const support::TemporaryFolder folder;
  const Actor actor;
  const std::vector<Motion> motions = three_motions(actor);
  EngineClipOptions options;
  options.shapes = 4;
  options.windows = 1500;
  const EngineClipReport report = written_clip(actor, folder.path(), motions, options);
  ASSERT_EQ(report.clips.size(), 3U);
  EXPECT_EQ(report.clips[0].frames, 24);
  EXPECT_EQ(report.clips[2].frames, 120);
  EXPECT_TRUE(report.clips[2].unseen);
  EXPECT_EQ(report.inputs, 5 * 15);
  EXPECT_NEAR(report.history, 0.08, 1e-9);
  for (const EngineClipError& clip : report.clips) {
    EXPECT_GT(clip.skinning, 5.0) << clip.name;
    EXPECT_LT(clip.share(clip.function), 0.1) << clip.name;
    EXPECT_LT(clip.best, 0.1) << clip.name;  // two displacements and their mean
  }
  // The clips in the file: the vertices of the weights, to the stated error.
  const support::GltfPose file(folder / "engine.glb");
  EXPECT_EQ(file.json["meshes"][0]["extras"]["targetNames"][0], "Corrective_Base");
  ASSERT_EQ(file.json["animations"].size(), 3U);
  const double off = distance_of_file(file, actor, motions[2], 2, {0, 50, 119});
  EXPECT_LT(off, 3.0 * report.clips[2].function + 0.2);
  EXPECT_LT(off, 0.2 * report.clips[2].skinning);
}

TEST(EngineClip, HelpersFollowAnActorByOrdinarySkinning) {
  const support::TemporaryFolder folder;
  const Actor actor;
  const std::vector<Motion> motions = three_motions(actor);
  EngineClipOptions options;
  options.helpers = 10;
  options.windows = 1000;
  const EngineClipReport report = written_clip(actor, folder.path(), motions, options);
  EXPECT_EQ(report.helpers, 10);
  EXPECT_EQ(report.figure.morphs, 0);
  EXPECT_EQ(report.figure.nodes, 5 + 10);
  EXPECT_LT(report.figure.mean_error_mm, 2.5);
  ASSERT_EQ(report.clips.size(), 3U);
  for (const EngineClipError& clip : report.clips) {
    EXPECT_GT(clip.skinning, 5.0) << clip.name;
    EXPECT_LT(clip.share(clip.best), 0.2) << clip.name;
    EXPECT_LT(clip.share(clip.function), 0.3) << clip.name;
  }
  const support::GltfPose file(folder / "engine.glb");
  EXPECT_FALSE(file.primitive().contains("targets"));
  EXPECT_TRUE(file.json["meshes"][0]["extras"].contains("helpers"));
  EXPECT_EQ(file.json["skins"][0]["joints"].size(), 15U);
  // The keys of the unseen clip, by the equations of glTF.
  std::vector<int> frames;
  for (int t = 0; t < 120; t += 7) frames.push_back(t);
  EXPECT_NEAR(distance_of_file(file, actor, motions[2], 2, frames), report.clips[2].best, 0.3);
}

TEST(EngineClip, ShapesAndHelpersAreCompressed) {
  const Actor actor;
  for (const int helpers : {0, 4}) {
    const support::TemporaryFolder folder;
    EngineClipOptions options;
    options.helpers = helpers;
    options.shapes = 4;
    options.windows = 100;
    options.compress = true;
    const EngineClipReport report =
        written_clip(actor, folder.path(),
                     {swaying_motion(actor.character, 60, 1), swaying_motion(actor.character, 30, 2)}, options);
    EXPECT_EQ(support::GltfPose(folder / "engine.glb").json["extensionsRequired"][0], "EXT_meshopt_compression");
    ASSERT_TRUE(report.figure.compression);
    EXPECT_GT(report.figure.compression->worst, 0.0);
    EXPECT_LT(report.figure.compression->worst, 0.1);
  }
}

TEST(EngineClip, TheValidatorOfKhronosFindsNoError) {
  if (std::system(WEB_TESTS "/modules.sh") != 0) GTEST_SKIP() << "node or its packages are missing";
  const support::TemporaryFolder folder;
  const Actor actor;
  EngineClipOptions options;
  options.shapes = 3;
  options.windows = 100;
  for (const int helpers : {0, 5}) {
    options.helpers = helpers;
    written_clip(actor, folder.path(), {swaying_motion(actor.character, 40, 1), swaying_motion(actor.character, 10, 2)},
                 options);
    EXPECT_EQ(std::system(("node " WEB_TESTS "/validate_glb.mjs '" + (folder / "engine.glb").string() + "'").c_str()),
              0);
  }
}

TEST(EngineClip, RefusesWhatItCannotFit) {
  const support::TemporaryFolder folder;
  const Actor actor;
  const auto refused = [&](int shapes, int frames) {
    EngineClipOptions options;
    options.shapes = shapes;
    return message_of<UsageError>([&] {
      written_clip(actor, folder.path(),
                   {swaying_motion(actor.character, frames, 1), Motion{{actor.character.rest_dofs}, {}}}, options);
    });
  };
  EXPECT_THAT(refused(1, 100), HasSubstr("2 to 256 corrective shapes (--morphs), found 1"));
  EXPECT_THAT(refused(257, 2000), HasSubstr("found 257"));
  EXPECT_THAT(message_of<UsageError>([&] {
                EngineClipOptions options;
                options.helpers = 300;
                written_clip(actor, folder.path(), {swaying_motion(actor.character, 9, 1)}, options);
              }),
              HasSubstr("1 to 256 helper joints (--helpers), found 300"));
  EXPECT_THAT(refused(32, 95), ::testing::AllOf(HasSubstr("have 95 poses at 25 a second, and at least 96 are needed"),
                                                HasSubstr("give more or longer motions (--motion")));
}

}  // namespace
}  // namespace doppel::engine_clip_test
