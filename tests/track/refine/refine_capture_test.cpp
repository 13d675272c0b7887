#include "doppel/track/refine/refine_capture.h"

#include <gmock/gmock.h>

#include <map>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/track/track_capture.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::refine_capture_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

/// The masks are the images, too: a white person before black.
class RefineCapture : public TrackCapture {
 protected:
  void describe(const std::string& videos, const std::string& more = "split: train") const {
    std::ofstream(root() / "capture.yaml")
        << "doppel_capture: 1\nname: tube\ncharacter: " << fs::relative(character_file_, root()).string()
        << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nsequences:\n  - {name: walk, " << more
        << ", videos: '" << videos << "', masks: 'mask_{name}_{frame}.png', keypoints: points.csv, cuts: [" << kCut
        << "]}\n";
  }
  void track() const {
    TrackOptions options;
    options.out = root() / "tracked";
    options.sheet_frames = 0;
    options.config.smoothing = 0.0;
    track_capture(*Footage::open(root(), options.config.fit.outline_pixels), options);
  }
  RefineOptions options() const {
    RefineOptions refine;
    refine.out = root() / "refined";
    refine.frames = 4;
    refine.rounds = 1;
    refine.texture_size = 128;
    refine.smoothing = 0.0;
    return refine;
  }
  TrackReport refine(const fs::path& capture) const {
    return refine_capture(*Footage::open(capture, options().config.fit.outline_pixels), options());
  }
};

TEST_F(RefineCapture, WritesACaptureWithCharacterAndMotion) {
  describe("mask_{name}_{frame}.png");
  track();
  const auto report = to_json(refine(root() / "tracked"));
  EXPECT_EQ(report["method"], "refine");
  EXPECT_EQ(report["sequences"]["walk"]["per_frame"].size(), static_cast<std::size_t>(kFrames));

  const Capture capture = read_capture(options().out);
  EXPECT_EQ(fs::canonical(capture.character_path().parent_path()), fs::canonical(options().out / "character"));
  const Character refined = load_character(capture.character_path());
  EXPECT_EQ(refined.mesh.texture.cols, 128);
  EXPECT_EQ(refined.num_vertices(), character_.num_vertices());
  const Motion motion = read_motion(capture.resolve(capture.sequences[0].motion), character_.num_dofs());
  ASSERT_EQ(motion.num_frames(), kFrames);
  for (int frame = 0; frame < kFrames; ++frame) EXPECT_LT(error(motion, frame), 0.02) << "frame " << frame;
  EXPECT_TRUE(fs::exists(options().out / "walk.bvh"));
  EXPECT_TRUE(fs::exists(options().out / "walk.jpg"));
}

TEST_F(RefineCapture, TheSameRunGivesTheSameFiles) {
  describe("mask_{name}_{frame}.png");
  track();
  const auto files = [&] {
    refine(root() / "tracked");
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(options().out))
      if (entry.is_regular_file() && entry.path().filename() != "track.json" && entry.path().extension() != ".html")
        contents[entry.path().lexically_relative(options().out).string()] = read_file(entry.path());
    return contents;
  };
  const auto first = files();
  EXPECT_GT(first.size(), 5u);
  for (const auto& [name, content] : files()) EXPECT_EQ(content, first.at(name)) << name;
}

TEST_F(RefineCapture, WithoutRoundsTheTemplateStays) {
  describe("mask_{name}_{frame}.png");
  track();
  RefineOptions baked = options();
  baked.rounds = 0;
  refine_capture(*Footage::open(root() / "tracked", baked.config.fit.outline_pixels), baked);
  const Character refined = load_character(read_capture(baked.out).character_path());
  for (int v = 0; v < refined.num_vertices(); ++v)
    EXPECT_LT((refined.mesh.vertices[v] - character_.mesh.vertices[v]).norm(), 1e-5);
  EXPECT_FALSE(refined.mesh.texture.empty());
}

TEST_F(RefineCapture, SaysWhatIsMissing) {
  describe("mask_{name}_{frame}.png");
  EXPECT_THAT(message_of<UsageError>([&] { refine(root()); }), HasSubstr("`doppel track`"));
  track();
  const Capture tracked = read_capture(root() / "tracked");
  fs::copy(tracked.resolve(tracked.sequences[0].motion), root() / "walk.motion");
  describe("none_{name}.mp4", "split: train, motion: walk.motion");
  EXPECT_THAT(message_of<Error>([&] { refine(root()); }), HasSubstr("has no images"));
  describe("mask_{name}_{frame}.png", "split: test, motion: walk.motion");
  EXPECT_THAT(message_of<UsageError>([&] { refine(root()); }), HasSubstr("`split: train`"));
  describe("mask_{name}_{frame}.png", "split: train, motion: short.motion");
  Motion motion = read_motion(root() / "walk.motion", character_.num_dofs());
  motion.frames.resize(3);
  motion.ids.resize(3);
  write_motion(root() / "short.motion", motion, true);
  EXPECT_THAT(message_of<Error>([&] { refine(root()); }), HasSubstr("has 3 rows"));
}

}  // namespace
}  // namespace doppel::refine_capture_test
