#include "doppel/data/capture/capture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "data/capture/capture_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/video_file.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::capture_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

constexpr char kFull[] = R"(doppel_capture: 1
name: anna
root: footage
character: character/anna.character
calibration: calibration/cameras.yml
fps: 50
camera_fps: {left: 59.94}
cameras: [0, left]
background: background/{camera:03}.png
sequences:
  - name: walk
    split: train
    videos: walk/stream{camera:03}.mp4
    masks: walk/masks/{name}/{frame:06}.png
    mask_threshold: 100
    largest_component: true
    keypoints: walk/{camera}_{frame:012}_keypoints.json
    motion: walk/poses.motion
    frame_offset: {"0": 2, left: -1.5}
    mask_offset: {left: 1}
    keypoint_offset: {"0": 1, left: -3}
    first_frame: 10
    last_frame: 99
    cuts: [40, 60]
  - name: dance
    split: test
    videos:
      "0": dance/front.mp4
      left: dance/side of {name}.mp4
    chroma_key: {space: hsv, against: background, tolerance: 25, min_saturation: 0.3, smooth: 5}
    motion: dance/poses.motion
  - name: street
    split: test
    videos: street/{name}.mp4
    background_subtraction: {frames: [0, 19], threshold: 5, shadow: 0.4, refine: false}
    motion: street/poses.motion
  - name: park
    split: test
    videos: park/{name}.mp4
    background_subtraction: {empty: "empty/{name}/{frame:04}.png"}
    joints3d: park/{name}.csv
    person: {near: [0.5, 1, -2]}
person: 1
detector: {model: pose.prototxt, weights: pose.caffemodel, input_height: 256, mean: [104, 117, 123], rgb: true}
unit: cm
up: -z
subject: S9
)";

/// A folder that holds `text` as capture.yaml beside an empty folder `footage`.
class CaptureFile {
 public:
  explicit CaptureFile(const std::string& text) {
    fs::create_directories(folder_ / "footage");
    std::ofstream(path()) << text;
  }
  fs::path path() const { return folder_ / "capture.yaml"; }
  Capture read() const { return read_capture(folder_.path()); }
  std::string error() const {
    return message_of<Error>([&] { read(); });
  }

 private:
  support::TemporaryFolder folder_;
};

std::string changed(const std::string& from, const std::string& to) { return support::replaced(kFull, from, to); }

TEST(CaptureReference, ReadsEveryField) {
  const CaptureFile file(kFull);
  const Capture capture = file.read();
  EXPECT_EQ(capture.name, "anna");
  EXPECT_EQ(capture.resolve("a/../b"), file.path().parent_path() / "footage/b");
  EXPECT_EQ(capture.resolve("/x"), "/x");
  EXPECT_EQ(capture.cameras, (std::vector<std::string>{"0", "left"}));
  EXPECT_DOUBLE_EQ(capture.fps, 50.0);
  EXPECT_EQ(capture.calibration_options.unit, "cm");
  EXPECT_EQ(capture.calibration_options.up, "-z");
  ASSERT_EQ(capture.sequences.size(), 4u);
  const SequenceEntry& walk = capture.sequences[0];
  EXPECT_EQ(walk.split, Split::train);
  EXPECT_EQ(walk.mask_threshold, 100);
  EXPECT_TRUE(walk.largest_component);
  EXPECT_EQ(capture.clock(walk, "0").offset, 2.0);
  EXPECT_EQ(capture.clock(walk, "left").offset, -1.5);
  EXPECT_EQ(capture.clock(walk, "right").offset, 0.0);
  EXPECT_DOUBLE_EQ(capture.clock(walk, "left").rate, 59.94 / 50.0);
  EXPECT_EQ(capture.clock(walk, "0").rate, 1.0);
  EXPECT_EQ(walk.first_frame, 10);
  EXPECT_EQ(walk.last_frame, 99);
  EXPECT_EQ(walk.cuts, (std::vector<long>{40, 60}));
  const SequenceEntry& dance = capture.sequences[1];
  ASSERT_TRUE(dance.chroma_key.has_value());
  EXPECT_EQ(dance.chroma_key->space, ChromaKey::Space::hsv);
  EXPECT_TRUE(dance.chroma_key->against_background);
  EXPECT_EQ(dance.chroma_key->smooth, 5);
  EXPECT_FALSE(dance.last_frame.has_value());
  EXPECT_TRUE(dance.masks_from_images());
  EXPECT_FALSE(walk.masks_from_images());
  const SequenceEntry &street = capture.sequences[2], &park = capture.sequences[3];
  ASSERT_TRUE(street.subtraction && park.subtraction);
  EXPECT_EQ(street.subtraction->empty, "");
  EXPECT_EQ(street.subtraction->last_frame, 19);
  EXPECT_EQ(street.subtraction->model.threshold, 5.0);
  EXPECT_EQ(street.subtraction->model.shadow, 0.4);
  EXPECT_FALSE(street.subtraction->model.refine);
  EXPECT_EQ(park.subtraction->empty, "empty/{name}/{frame:04}.png");
  EXPECT_FALSE(park.subtraction->last_frame.has_value());
  EXPECT_TRUE(park.subtraction->model.refine);
  EXPECT_EQ(park.joints3d, "park/{name}.csv");
  EXPECT_EQ(park.motion, "");
  EXPECT_EQ(capture.person_of(walk).person, 1);
  EXPECT_FALSE(capture.person_of(park).person.has_value());
  EXPECT_EQ(*capture.person_of(park).near, Eigen::Vector3d(0.5, 1.0, -2.0));
  ASSERT_TRUE(capture.detector.has_value());
  EXPECT_EQ(capture.detector->network.weights, "pose.caffemodel");
  EXPECT_EQ(capture.detector->network.input_height, 256);
  EXPECT_EQ(capture.detector->network.mean, (std::array<double, 3>{104, 117, 123}));
  EXPECT_TRUE(capture.detector->network.rgb);
  EXPECT_EQ(capture.source(park.subtraction->empty, 3, "left"), (capture.root / "empty/left/{frame:04}.png").string());
}

TEST(CaptureReference, TheRootGoesThroughSymbolicLinks) {
  const support::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "anna/prepared");
  write_atomically(folder / "anna/prepared/capture.yaml",
                   "doppel_capture: 1\nroot: ..\ncalibration: c.yml\ncameras: [Kamera S\u00fcd 0]\n"
                   "sequences:\n  - {name: a, split: train, videos: a.mp4}\n");
  std::filesystem::create_directories(folder / "bob");
  std::filesystem::create_directory_symlink(folder / "anna/prepared", folder / "bob/link");
  const Capture capture = read_capture(folder / "bob/link");
  EXPECT_EQ(capture.root, std::filesystem::canonical(folder / "anna"));
  EXPECT_EQ(capture.name, "anna");
  EXPECT_EQ(capture.cameras.at(0), "Kamera S\u00fcd 0") << "names are those of the calibration";
}

TEST(CaptureReference, WritingAndReadingGivesTheSame) {
  const CaptureFile file(kFull);
  const Capture capture = file.read();
  const fs::path first = file.path().parent_path() / "out/capture.yaml", second = file.path().parent_path() / "b.yaml";
  write_capture(first, capture);
  const Capture again = read_capture(first);
  EXPECT_EQ(again.root, capture.root);
  EXPECT_EQ(again.calibration_options.up, "-z");
  EXPECT_EQ(again.calibration_options.subject, "S9");
  EXPECT_EQ(again.sequences[0].frame_offset, capture.sequences[0].frame_offset);
  EXPECT_EQ(again.sequences[0].mask_offset, capture.sequences[0].mask_offset);
  EXPECT_EQ(again.sequences[0].mask_offset_of("left"), 1);
  EXPECT_EQ(again.sequences[0].keypoint_offset, capture.sequences[0].keypoint_offset);
  EXPECT_EQ(again.sequences[0].keypoint_offset_of("left"), -3);
  EXPECT_EQ(again.sequences[0].keypoint_offset_of("other"), 0);
  EXPECT_EQ(again.camera_fps, capture.camera_fps);
  EXPECT_EQ(again.sequences[1].videos, capture.sequences[1].videos);
  EXPECT_EQ(again.sequences[0].cuts, capture.sequences[0].cuts);
  EXPECT_EQ(again.sequences[1].chroma_key->tolerance, 25.0);
  EXPECT_EQ(again.sequences[2].subtraction->last_frame, 19);
  EXPECT_EQ(again.sequences[2].subtraction->model.shadow, 0.4);
  EXPECT_EQ(again.sequences[3].subtraction->empty, capture.sequences[3].subtraction->empty);
  EXPECT_EQ(again.sequences[3].joints3d, capture.sequences[3].joints3d);
  EXPECT_EQ(again.detector->network.mean, capture.detector->network.mean);
  EXPECT_EQ(again.detector->network.weights, capture.detector->network.weights);
  EXPECT_TRUE(again.detector->network.rgb);
  EXPECT_EQ(again.person.person, 1);
  EXPECT_FALSE(again.sequences[0].person.has_value());
  EXPECT_EQ(again.sequences[3].person->near, capture.sequences[3].person->near);
  write_capture(second, again);
  write_capture(first, read_capture(second));
  EXPECT_EQ(read_capture(first).sequences[0].keypoints, capture.sequences[0].keypoints);
}

TEST(CaptureReference, FilesMayBeNamedByCamera) {
  const Capture capture = CaptureFile(kFull).read();
  const CameraPaths& videos = capture.sequences[1].videos;
  EXPECT_EQ(videos.by_camera().size(), 2u);
  EXPECT_EQ(capture.source(videos, 7, "0"), (capture.root / "dance/front.mp4").string());
  EXPECT_EQ(capture.source(videos, 7, "left"), (capture.root / "dance/side of left.mp4").string());
  const std::string error = message_of<Error>([&] { capture.source(videos, 7, "right"); });
  EXPECT_THAT(error, HasSubstr("'right'"));
  EXPECT_THAT(error, HasSubstr("dance/front.mp4"));
  EXPECT_THAT(CaptureFile(changed("dance/front.mp4", "dance/{front}.mp4")).error(), HasSubstr("{front}"));
  EXPECT_THAT(CaptureFile(changed("      \"0\": dance/front.mp4\n      left: dance/side of {name}.mp4\n", "")).error(),
              HasSubstr("videos"));
}

TEST(CaptureReference, MasksAndCharacterMayBeMissing) {
  const CaptureFile file(
      "doppel_capture: 1\nname: bare\ncalibration: b\nsequences: [{name: c, split: test, videos: d}]\n");
  const Capture capture = file.read();
  EXPECT_FALSE(capture.sequences[0].has_masks());
  const std::string no_masks = message_of<Error>([&] { capture.sequences[0].require_masks("`doppel prepare`"); });
  for (const char* part : {"sequence c", "`doppel prepare`", "masks", "chroma_key", "background_subtraction"})
    EXPECT_THAT(no_masks, HasSubstr(part));
  const std::string no_body = message_of<Error>([&] { capture.character_path(); });
  for (const char* part : {"bare", "doppel character create", "capture.yaml"}) EXPECT_THAT(no_body, HasSubstr(part));
  write_capture(file.path(), capture, {"first line\nof two", "second"});
  EXPECT_EQ(read_file(file.path()).rfind("# first line of two\n# second\ndoppel_capture: 1\n", 0), 0u);
  const Capture again = file.read();
  EXPECT_FALSE(again.sequences[0].has_masks());
  EXPECT_EQ(again.character, "");
}

TEST(CaptureRejects, NamesOfCamerasThatTheCalibrationLacks) {
  const support::TemporaryFolder folder;
  write_calibration(folder / "cameras.yml", {test_capture::ring_camera(0, 2), test_capture::ring_camera(1, 2)});
  const auto error = [&](const std::string& extra, const std::string& videos) {
    write_atomically(folder / "capture.yaml", "doppel_capture: 1\ncalibration: cameras.yml\n" + extra +
                                                  "sequences: [{name: c, split: test, videos: " + videos + "}]\n");
    return message_of([&] { choose_cameras(read_capture(folder.path())); });
  };
  EXPECT_EQ(error("", "{'0': a, '1': b}"), "nothing was thrown");
  EXPECT_THAT(error("", "{'0': a, '2': b}"), HasSubstr("`videos` names camera '2'"));
  EXPECT_THAT(error("camera_fps: {x: 30}\n", "a"), HasSubstr("`camera_fps` names camera 'x'"));
  EXPECT_THAT(error("", "a, frame_offset: {y: 0.5}"), HasSubstr("`frame_offset` names camera 'y'"));
  EXPECT_THAT(error("", "a, mask_offset: {y: 1}"), HasSubstr("`mask_offset` names camera 'y'"));
  EXPECT_THAT(error("", "a, keypoint_offset: {y: 1}"), HasSubstr("`keypoint_offset` names camera 'y'"));
}

TEST(CaptureReference, IsNamedAfterItsFolderUnlessItSays) {
  const CaptureFile file(
      "doppel_capture: 1\ncharacter: a\ncalibration: b\nsequences: [{name: c, split: test, videos: "
      "d, masks: e}]\n");
  EXPECT_EQ(file.read().name, file.path().parent_path().filename().string());
}

TEST(CaptureReference, ExpandsPatterns) {
  EXPECT_EQ(expand_pattern("a{camera}b{camera:03}c{name}", 7, "left"), "a7b007cleft");
  EXPECT_EQ(expand_pattern("{frame:012}.json", 0, "", 123), "000000000123.json");
  EXPECT_EQ(expand_camera("{camera:02}/{frame:06}.png", 3, "x"), "03/{frame:06}.png");
  EXPECT_TRUE(has_frame_placeholder("{frame}"));
  EXPECT_FALSE(has_frame_placeholder("{camera:03}"));
}

TEST(CaptureRejects, BadPatterns) {
  EXPECT_THROW(expand_pattern("{frame}", 0, ""), Error);
  EXPECT_THROW(expand_pattern("{kamera}", 0, ""), Error);
  EXPECT_THROW(expand_pattern("{camera", 0, ""), Error);
  EXPECT_THROW(expand_pattern("{camera:999999}", 0, ""), Error);
  EXPECT_THROW(expand_pattern("{camera:3x}", 0, ""), Error);
  EXPECT_THROW(expand_pattern("{camera:-3}", 0, ""), Error);
}

TEST(CaptureRejects, NamesFileLineAndKey) {
  EXPECT_THAT(CaptureFile(changed("split: train", "split: training")).error(), HasSubstr("capture.yaml:12"));
  EXPECT_THAT(CaptureFile(changed("mask_threshold: 100", "mask_treshold: 100")).error(), HasSubstr("mask_threshold"));
  EXPECT_THAT(CaptureFile(changed("doppel_capture: 1", "doppel_capture: 2")).error(), HasSubstr("version 2"));
  EXPECT_THAT(CaptureFile(changed("doppel_capture: 1\n", "")).error(), HasSubstr("doppel_capture"));
  EXPECT_THAT(CaptureFile(changed("root: footage", "root: elsewhere")).error(), HasSubstr("does not exist"));
  EXPECT_THAT(CaptureFile(changed("cuts: [40, 60]", "cuts: [60, 40]")).error(), HasSubstr("ascending"));
  EXPECT_THAT(CaptureFile(changed("last_frame: 99", "last_frame: 9")).error(), HasSubstr("before first_frame"));
  EXPECT_THAT(CaptureFile(changed("name: dance", "name: walk")).error(), HasSubstr("two sequences"));
  EXPECT_THAT(CaptureFile(changed("name: dance", "name: a/b")).error(), HasSubstr("no usable name"));
  EXPECT_THAT(CaptureFile(changed("cameras: [0, left]", "cameras: [0, 0]")).error(), HasSubstr("twice"));
  EXPECT_THAT(CaptureFile(changed("smooth: 5", "smooth: 4")).error(), HasSubstr("odd"));
  EXPECT_THAT(CaptureFile(changed("background: background/{camera:03}.png\n", "")).error(), HasSubstr("background"));
  EXPECT_THAT(CaptureFile(changed("{name}.mp4", "{nome}.mp4")).error(), HasSubstr("{nome}"));
  EXPECT_THAT(CaptureFile(changed("{frames: [0, 19], ", "{")).error(), HasSubstr("frames"));
  EXPECT_THAT(CaptureFile(changed("[104, 117, 123]", "[104, 117]")).error(), HasSubstr("three numbers"));
  EXPECT_THAT(CaptureFile(changed("model: pose.prototxt, ", "")).error(), HasSubstr("model"));
  EXPECT_THAT(CaptureFile(changed("[0, 19]", "[19, 0]")).error(), HasSubstr("[0, 19]"));
  EXPECT_THAT(CaptureFile(changed("[0.5, 1, -2]", "[0.5, 1]")).error(), HasSubstr("as in [0.2, 1.0, -0.5]"));
  EXPECT_THAT(CaptureFile(changed("person: 1\n", "person: -1\n")).error(), HasSubstr("person"));
  EXPECT_THAT(CaptureFile(changed("{near: [0.5", "{far: [0.5")).error(), HasSubstr("near"));
  EXPECT_THAT(CaptureFile(changed("shadow: 0.4", "shadow: 4")).error(), HasSubstr("shadow"));
  EXPECT_THAT(
      CaptureFile(changed("    background_subtraction: {frames", "    masks: m\n    background_subtraction: {frames"))
          .error(),
      HasSubstr("only one of them"));
}

TEST(CaptureRejects, HostileFiles) {
  const CaptureFile file(kFull);
  support::expect_survives_hostile_files(
      file.path(), kFull, [](const fs::path& path) { read_capture(path); }, 40);
}

// ---- folders of the public datasets ----

void touch(const fs::path& path, const std::string& text = "x") {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}

/// Calibration of `count` cameras at `path`.
void touch_calibration(const fs::path& path, int count) {
  fs::create_directories(path.parent_path());
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) cameras.push_back(test_capture::ring_camera(i, count));
  write_calibration(path, cameras);
}

TEST(LayoutReference, FoldersWithBracesAreRefused) {
  const support::TemporaryFolder folder;
  const fs::path braces = folder / "anna {2}";
  fs::create_directories(braces);
  EXPECT_THAT(message_of<Error>([&] { guess_folder(braces); }), HasSubstr("has braces"));
  touch(braces / "capture.yaml", "doppel_capture: 1\nname: anna\n");
  EXPECT_THAT(message_of<Error>([&] { find_capture(braces); }), HasSubstr("has braces"));
}

TEST(LayoutReference, RecognisesAsh) {
  const support::TemporaryFolder folder;
  touch_calibration(folder / "meta_data/Subject/cameras.calibration", 3);
  touch(folder / "meta_data/Subject/ddc.character");
  for (const std::string split : {"training", "testing"})
    for (const std::string camera : {"000", "001", "002"}) {
      touch(folder / (split + "/videos/stream" + camera + ".mp4"));
      touch(folder / (split + "/foregroundSegmentation/stream" + camera + ".mkv"));
    }
  touch(folder / "meta_data/Subject/skeletoolToGTPose/poseAngles.motion");
  touch(folder / "meta_data/Subject/skeletoolToGTPoseTest/poseAngles.motion");
  touch(folder / "training/frames.csv", "frame,segment\r\n0,0\r\n1,0\r\n2,1\r\n3,1\r\n4,7\r\n");
  const auto found = recognise_capture(folder.path());
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->layout, "ASH/TriHuman");
  const Capture& capture = found->capture;
  ASSERT_EQ(capture.sequences.size(), 2u);
  EXPECT_TRUE(capture.cameras.empty());
  EXPECT_EQ(capture.character, "meta_data/Subject/ddc.character");
  EXPECT_EQ(capture.sequences[0].videos, "training/videos/stream{camera:03}.mp4");
  EXPECT_EQ(capture.sequences[0].masks, "training/foregroundSegmentation/stream{camera:03}.mkv");
  EXPECT_EQ(capture.sequences[0].motion, "meta_data/Subject/skeletoolToGTPose/poseAngles.motion");
  EXPECT_EQ(capture.sequences[1].motion, "meta_data/Subject/skeletoolToGTPoseTest/poseAngles.motion");
  EXPECT_EQ(capture.sequences[0].cuts, (std::vector<long>{2, 4}));
  EXPECT_EQ(capture.sequences[1].split, Split::test);
  EXPECT_EQ(capture.fps, 25.0);
  fs::remove(folder / "training/videos/stream000.mp4");
  VideoFile video(folder / "training/videos/stream000.mp4", {64, 48}, 50.0);
  video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(90)));
  video.close();
  EXPECT_EQ(recognise_capture(folder.path()).value().capture.fps, 50.0);
}

TEST(LayoutReference, EmptyStudioInAFolderPerCamera) {
  const support::TemporaryFolder folder;
  touch_calibration(folder / "cameras.calibration", 2);
  touch(folder / "actor.character");
  touch(folder / "training/skeletoolToGTPose/poseAngles.motion");
  for (const std::string number : {"00", "01"}) {
    touch(folder / ("training/img/c_" + number + ".avi"));
    touch(folder / ("training/fg/c_" + number + ".avi"));
    touch(folder / ("background/" + number + "/empty_2.jpg"));
    touch(folder / ("background/" + number + "/notes.txt"));
  }
  touch(folder / "background/00/empty_1.jpg");  // the other camera has no such image
  EXPECT_EQ(recognise_capture(folder.path()).value().capture.background, "background/{camera:02}/empty_2.jpg");
  std::filesystem::remove(folder / "background/01/empty_2.jpg");
  EXPECT_EQ(recognise_capture(folder.path()).value().capture.background, "");
}

TEST(LayoutReference, RecognisesDynaCapWithAndWithoutPadding) {
  for (const bool pad : {true, false}) {
    const support::TemporaryFolder folder;
    touch_calibration(folder / "cameras.calibration", 12);
    touch(folder / "actor.character");
    touch(folder / "training/skeletoolToGTPose/poseAngles.motion");
    for (int camera = 0; camera < 11; ++camera) {  // camera 11 has no video
      const std::string number = pad ? test_capture::padded(camera, 2) : std::to_string(camera);
      touch(folder / ("training/img/c_" + number + ".avi"));
      touch(folder / ("training/fg/c_" + number + ".avi"));
    }
    const auto found = recognise_capture(folder.path());
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->layout, "DynaCap");
    EXPECT_EQ(found->capture.sequences[0].videos,
              pad ? "training/img/c_{camera:02}.avi" : "training/img/c_{camera}.avi");
    ASSERT_EQ(found->capture.cameras.size(), 11u);
    EXPECT_EQ(found->capture.cameras.back(), "10");
  }
}

TEST(LayoutRejects, SaysWhatIsMissing) {
  const support::TemporaryFolder folder;
  EXPECT_FALSE(recognise_capture(folder.path()).has_value());
  const auto error = [&] { return message_of<Error>([&] { find_capture(folder.path()); }); };
  EXPECT_THAT(error(), HasSubstr("capture.yaml"));
  touch(folder / "training/videos/stream000.mp4");
  touch(folder / "training/foregroundSegmentation/stream000.mp4");
  EXPECT_THAT(error(), HasSubstr("calibration"));
  touch_calibration(folder / "a.calibration", 1);
  touch_calibration(folder / "b.calibration", 1);
  EXPECT_THAT(error(), HasSubstr("several"));
  fs::remove(folder / "b.calibration");
  EXPECT_THAT(error(), HasSubstr("character"));
  touch(folder / "x/y/z.character");
  EXPECT_EQ(error(), "nothing was thrown");
  EXPECT_EQ(find_capture(folder.path()).sequences[0].motion, "") << "poses may still have to be tracked";
  touch(folder / "training/a/poseAngles.motion");
  touch(folder / "training/b/poseAngles.motion");
  EXPECT_THAT(error(), HasSubstr("several poses"));
  fs::remove_all(folder / "training/a");
  EXPECT_EQ(error(), "nothing was thrown");
  EXPECT_EQ(find_capture(folder.path()).sequences[0].motion, "training/b/poseAngles.motion");
  touch(folder / "training/frames.csv", "frame,segment\n0,0\n5,0\n");
  EXPECT_THAT(error(), HasSubstr("frames.csv:3"));
}

}  // namespace
}  // namespace doppel::capture_test
