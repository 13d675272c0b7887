#include "doppel/data/capture/layouts/guess_capture.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/layouts/file_streams.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/shared_folder.h"

namespace doppel::capture_guess_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;
using ::testing::HasSubstr;

FoundCalibration calibration_of(const std::vector<std::string>& names, const std::string& path = "calibration.toml") {
  FoundCalibration found{path, {}};
  found.calibration.format = "toml";
  found.calibration.unit = "m";
  found.calibration.up = "+z";
  for (std::size_t i = 0; i < names.size(); ++i) {
    Camera camera = test_capture::ring_camera(static_cast<int>(i), static_cast<int>(names.size()));
    camera.name = names[i];
    found.calibration.cameras.push_back(camera);
  }
  return found;
}

/// A folder with these files; videos have `fps` and the size of the cameras.
FolderContent folder_of(std::vector<std::string> files, std::vector<FoundCalibration> calibrations, double fps = 60.0) {
  FolderContent content;
  content.root = "/captures/anna";
  content.files = std::move(files);
  content.calibrations = std::move(calibrations);
  for (const FileStream& stream : group_streams(content.files))
    if (stream.kind == FileKind::video)
      content.footage[stream.first_file] = {test_capture::kWidth, test_capture::kHeight, fps, 100};
    else if (stream.kind == FileKind::image)
      content.footage[stream.first_file] = {test_capture::kWidth, test_capture::kHeight, 0.0, 1};
    else if (stream.kind == FileKind::json)
      content.keypoint_maps[stream.first_file] = {"body25"};
  return content;
}

std::string all_of(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += sentence + "\n";
  return text;
}

TEST(CaptureGuess, OneFolderOfVideos) {
  const CaptureGuess guess =
      guess_capture(folder_of({"videos/cam01.mp4", "videos/cam02.mp4"}, {calibration_of({"cam_01", "cam_02"})}));
  ASSERT_TRUE(guess.complete);
  const Capture& capture = guess.capture;
  EXPECT_EQ(capture.name, "anna");
  EXPECT_EQ(capture.calibration, "calibration.toml");
  EXPECT_TRUE(capture.cameras.empty());
  EXPECT_EQ(capture.fps, 60.0);
  ASSERT_EQ(capture.sequences.size(), 1u);
  EXPECT_EQ(capture.sequences[0].name, "anna");
  EXPECT_EQ(capture.sequences[0].videos, CameraPaths({{"cam_01", "videos/cam01.mp4"}, {"cam_02", "videos/cam02.mp4"}}));
  EXPECT_FALSE(capture.sequences[0].has_masks());
  const std::string missing = all_of(guess.missing);
  for (const char* part : {"no masks", "no keypoints", "no character", "doppel character create"})
    EXPECT_THAT(missing, HasSubstr(part));
}

TEST(CaptureGuess, MasksKeypointsMotionAndCharacter) {
  std::vector<std::string> files{"anna.character", "anna.motion", "motions/poses.motion", "landmarks.csv"};
  for (const std::string camera : {"c0", "c1"}) {
    files.push_back("videos/" + camera + ".mp4");
    files.push_back("masks/" + camera + ".mkv");
    for (const char* frame : {"000", "001"})
      files.push_back("openpose/" + camera + "/" + camera + "_" + frame + "_keypoints.json");
  }
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"c0", "c1"})}));
  const SequenceEntry& entry = guess.capture.sequences.at(0);
  EXPECT_EQ(entry.videos, "videos/{name}.mp4");
  EXPECT_EQ(entry.masks, "masks/{name}.mkv");
  EXPECT_EQ(entry.keypoints, "openpose/{name}/{name}_{frame:03}_keypoints.json");
  EXPECT_EQ(entry.motion, "motions/poses.motion") << "the motion beside the character is its rest pose";
  EXPECT_EQ(guess.capture.character, "anna.character");
  EXPECT_EQ(guess.capture.landmarks, "landmarks.csv");
  EXPECT_EQ(guess.capture.keypoint_map, "body25");
  EXPECT_TRUE(guess.missing.empty()) << all_of(guess.missing);
}

MaskValues masks_of(const std::vector<int>& values) {
  MaskValues masks;
  for (const int value : values) ++masks.pixels[static_cast<std::size_t>(value)];
  return masks;
}

TEST(CaptureGuess, MasksOfLabelsGetALowerThreshold) {
  FolderContent content =
      folder_of({"videos/a.mp4", "videos/b.mp4", "masks/a.mkv", "masks/b.mkv"}, {calibration_of({"a", "b"})});
  const auto guess_with = [&](const std::vector<int>& a, const std::vector<int>& b) {
    content.masks = {{"masks/a.mkv", masks_of(a)}, {"masks/b.mkv", masks_of(b)}};
    return guess_capture(content);
  };
  const CaptureGuess usual = guess_with({0, 255}, {0});
  EXPECT_EQ(usual.capture.sequences.at(0).mask_threshold, 128);
  EXPECT_THAT(all_of(usual.found), testing::Not(HasSubstr("mask_threshold")));
  for (const auto& [a, b] : {std::pair(std::vector{0, 255}, std::vector{0, 38}), {{0, 38}, {0, 255}}, {{0, 1}, {0, 1}}})
    EXPECT_EQ(guess_with(a, b).capture.sequences.at(0).mask_threshold, 1) << "the lowest of all cameras";
  EXPECT_THAT(all_of(guess_with({0, 255}, {0, 38}).found),
              HasSubstr("mask_threshold: 1, because the masks masks/b.mkv have the values 0, 38"));
  const CaptureGuess doubt = guess_with({0, 38, 38, 147}, {0, 255});
  EXPECT_EQ(doubt.capture.sequences.at(0).mask_threshold, 128);
  EXPECT_THAT(all_of(doubt.found), HasSubstr("the masks masks/a.mkv have the values 0, 38, 147; those below"));
}

TEST(CaptureGuess, SeveralSequences) {
  std::vector<std::string> files;
  for (const std::string sequence : {"walk", "test_run"})
    for (const std::string camera : {"0", "1", "2"}) {
      files.push_back(sequence + "/stream00" + camera + ".mp4");
      files.push_back("fg/" + sequence + "/" + camera + ".mkv");
    }
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"0", "1", "2"})}));
  ASSERT_EQ(guess.capture.sequences.size(), 2u);
  EXPECT_EQ(guess.capture.sequences[1].name, "walk");
  EXPECT_EQ(guess.capture.sequences[1].videos, "walk/stream{camera:03}.mp4");
  EXPECT_EQ(guess.capture.sequences[1].masks, "fg/walk/{name}.mkv");
  EXPECT_EQ(guess.capture.sequences[0].name, "test_run");
  EXPECT_EQ(guess.capture.sequences[0].split, Split::test);
  EXPECT_EQ(guess.capture.sequences[0].masks, "fg/test_run/{name}.mkv");
}

TEST(CaptureGuess, FoldersOfImages) {
  std::vector<std::string> files;
  for (const std::string camera : {"A", "B"})
    for (const char* frame : {"0001", "0002", "0003"}) files.push_back("images/" + camera + "/" + frame + ".jpg");
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"a", "b"})}));
  const SequenceEntry& entry = guess.capture.sequences.at(0);
  EXPECT_EQ(entry.videos, CameraPaths({{"a", "images/A/{frame:04}.jpg"}, {"b", "images/B/{frame:04}.jpg"}}));
  EXPECT_EQ(entry.frame_offset, (std::map<std::string, double>{{"a", 1.0}, {"b", 1.0}}));
  EXPECT_THAT(all_of(guess.missing), HasSubstr("no frame rate"));
}

TEST(CaptureGuess, NamesOfCamerasAreNoRoles) {
  const CaptureGuess guess = guess_capture(
      folder_of({"alpha.mp4", "Depth_2.mp4", "masks/alpha.mp4", "masks/Depth_2.mp4", "bg/alpha.png", "bg/Depth_2.png"},
                {calibration_of({"alpha", "Depth_2"})}));
  ASSERT_EQ(guess.capture.sequences.size(), 1u) << all_of(guess.missing);
  EXPECT_EQ(guess.capture.sequences[0].videos, "{name}.mp4");
  EXPECT_EQ(guess.capture.sequences[0].masks, "masks/{name}.mp4");
}

TEST(CaptureGuess, AFolderPerFrame) {
  std::vector<std::string> files;
  for (const std::string frame : {"0001", "0002", "0003"})
    for (const std::string camera : {"a", "b"})
      for (const std::string kind : {"frames/", "masks/frames/"}) files.push_back(kind + frame + "/" + camera + ".png");
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"a", "b"})}));
  const SequenceEntry& entry = guess.capture.sequences.at(0);
  EXPECT_EQ(entry.videos, "frames/{frame:04}/{name}.png");
  EXPECT_EQ(entry.masks, "masks/frames/{frame:04}/{name}.png");
  EXPECT_EQ(entry.frame_offset, (std::map<std::string, double>{{"a", 1.0}, {"b", 1.0}}));
}

TEST(CaptureGuess, ImagesInSteps) {
  std::vector<std::string> files;
  for (const std::string camera : {"a", "b"})
    for (const char* frame : {"0005", "0010", "0015"})
      for (const std::string kind : {"images/", "masks/"}) files.push_back(kind + camera + "/" + frame + ".png");
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"a", "b"})}));
  const SequenceEntry& entry = guess.capture.sequences.at(0);
  EXPECT_EQ(entry.videos, "images/{name}");
  EXPECT_EQ(entry.masks, "masks/{name}");
  EXPECT_TRUE(entry.frame_offset.empty() && entry.mask_offset.empty()) << all_of(guess.found);
  EXPECT_THAT(all_of(guess.found), HasSubstr("in steps of 5"));
  for (std::string& file : files)
    if (file.ends_with("0015.png")) file.replace(file.size() - 8, 8, "0020.png");
  const CaptureGuess gaps = guess_capture(folder_of(files, {calibration_of({"a", "b"})}));
  EXPECT_THAT(all_of(gaps.missing), HasSubstr("has 3 for the numbers 5 to 20"));
}

TEST(CaptureGuess, TheEmptySceneMakesMasks) {
  const CaptureGuess images = guess_capture(
      folder_of({"v/0.mp4", "v/1.mp4", "background/000.png", "background/001.png"}, {calibration_of({"0", "1"})}));
  ASSERT_TRUE(images.capture.sequences.at(0).subtraction.has_value());
  EXPECT_EQ(images.capture.sequences[0].subtraction->empty, "background/{camera:03}.png");
  const CaptureGuess videos =
      guess_capture(folder_of({"v/0.mp4", "v/1.mp4", "v/empty_0.mp4", "v/empty_1.mp4"}, {calibration_of({"0", "1"})}));
  EXPECT_EQ(videos.capture.sequences.size(), 1u);
  EXPECT_EQ(videos.capture.sequences.at(0).subtraction->empty, "v/empty_{name}.mp4");
}

TEST(CaptureGuess, TheCalibrationWhoseCamerasWereFilmed) {
  const CaptureGuess guess =
      guess_capture(folder_of({"left.mp4", "right.mp4"}, {calibration_of({"p", "q", "r"}, "a.toml"),
                                                          calibration_of({"right", "left"}, "z/b.yml")}));
  EXPECT_EQ(guess.capture.calibration, "z/b.yml");
  EXPECT_EQ(guess.capture.sequences.at(0).videos, "{name}.mp4");
  EXPECT_THAT(all_of(guess.found), HasSubstr("a.toml (toml, 3 cameras) is not used"));
  const CaptureGuess named =
      guess_capture(folder_of({"cam1.mp4", "cam2.mp4"}, {calibration_of({"x26", "x27"}, "a.toml"),
                                                         calibration_of({"cam_1", "cam_2"}, "b.toml")}));
  EXPECT_EQ(named.capture.calibration, "b.toml") << "both have two cameras; a name says more than an order";
}

TEST(CaptureGuess, CamerasWithoutVideoAreLeftOut) {
  const CaptureGuess guess = guess_capture(folder_of({"hdVideos/hd_00_01.mp4", "hdVideos/hd_00_10.mp4"},
                                                     {calibration_of({"00_01", "00_02", "00_10", "01_01"})}));
  EXPECT_EQ(guess.capture.cameras, (std::vector<std::string>{"00_01", "00_10"}));
  EXPECT_EQ(guess.capture.sequences.at(0).videos, "hdVideos/hd_{name}.mp4");
}

TEST(CaptureGuess, RatesThatDifferEnoughToMatter) {
  FolderContent content = folder_of({"a.mp4", "b.mp4", "c.mp4", "d.mp4"}, {calibration_of({"a", "b", "c", "d"})});
  content.footage["b.mp4"].fps = 30.0;
  content.footage["c.mp4"].fps = 60.01;  // 0.02 frames off at the end
  content.footage["d.mp4"].frames = 97;
  const CaptureGuess guess = guess_capture(content);
  EXPECT_EQ(guess.capture.fps, 60.0);
  EXPECT_EQ(guess.capture.camera_fps, (std::map<std::string, double>{{"b", 30.0}}));
  EXPECT_THAT(all_of(guess.found), HasSubstr("97 to 100 frames"));
}

TEST(CaptureGuess, SizesThatDiffer) {
  FolderContent content = folder_of({"a.mp4", "b.mp4"}, {calibration_of({"a", "b"})});
  content.footage["a.mp4"].width = test_capture::kWidth - 1;
  content.footage["b.mp4"] = {test_capture::kHeight, test_capture::kWidth, 60.0, 100};
  const CaptureGuess guess = guess_capture(content);
  EXPECT_THAT(all_of(guess.found), HasSubstr("111x128"));
  EXPECT_THAT(all_of(guess.missing), HasSubstr("cropped or turned"));
}

TEST(CaptureGuess, ShorterByThePaddingOfAnEncoder) {
  FolderContent content = folder_of({"a.mp4"}, {calibration_of({"a"})});
  Camera& camera = content.calibrations[0].calibration.cameras[0];
  camera.width = 1920;
  camera.height = 1088;
  content.footage["a.mp4"].width = 1920;
  content.footage["a.mp4"].height = 1080;
  EXPECT_THAT(all_of(guess_capture(content).found), HasSubstr("taken for padding of the encoder"));

  EXPECT_TRUE(is_without_padding(camera, {1920, 1080}));
  const Camera cut = fit_to_images(camera, {1920, 1080}, "a.mp4");
  EXPECT_EQ(cut.height, 1080);
  EXPECT_EQ(cut.K, camera.K) << "pixels keep their positions";
  EXPECT_FALSE(is_without_padding(camera, {1920, 1072})) << "a whole block is no padding";
  EXPECT_FALSE(is_without_padding(camera, {1906, 1080})) << "both sides are shorter: scaled";
  camera.height = 1084;
  EXPECT_FALSE(is_without_padding(camera, {1920, 1080})) << "no encoder pads to 1084";
}

TEST(CaptureGuess, SaysWhatIsMissing) {
  const CaptureGuess no_calibration = guess_capture(folder_of({"a.mp4"}, {}));
  EXPECT_FALSE(no_calibration.complete);
  EXPECT_THAT(all_of(no_calibration.missing), HasSubstr("docs/calibration.md"));
  const CaptureGuess no_footage = guess_capture(folder_of({"readme.txt"}, {calibration_of({"left", "right"})}));
  EXPECT_FALSE(no_footage.complete);
  EXPECT_THAT(all_of(no_footage.missing), HasSubstr("left, right"));
  const CaptureGuess no_match = guess_capture(folder_of({"x.mp4", "y.mp4"}, {calibration_of({"a", "b", "c"})}));
  EXPECT_FALSE(no_match.complete);
  EXPECT_THAT(all_of(no_match.found), HasSubstr("x.mp4, y.mp4"));
}

TEST(CaptureGuess, ImagesOfBoardsAreNoFootage) {
  std::vector<std::string> files{"videos/cam01.mp4", "videos/cam02.mp4"};
  for (const char* name : {"cam01_1.jpg", "cam01_2.jpg"}) files.push_back(std::string("board/int_cam01_img/") + name);
  const CaptureGuess guess = guess_capture(folder_of(files, {calibration_of({"cam_01", "cam_02"})}));
  EXPECT_EQ(guess.capture.sequences.size(), 1u);
}

TEST(CaptureGuess, AnyNamesOfFilesAreTaken) {
  const std::vector<std::string> odd{"",
                                     "/",
                                     "..mp4",
                                     ".mp4",
                                     "-/-.mp4",
                                     "{.mp4",
                                     "1/1/1/1.mp4",
                                     "\xff.png",
                                     "a\nb.mp4",
                                     "0000.json",
                                     "9999999999999999999999.jpg",
                                     "mask.mp4",
                                     "empty.png",
                                     "x.character",
                                     "x.motion"};
  for (std::size_t n = 0; n <= odd.size(); ++n)
    for (const auto& names :
         {std::vector<std::string>{"1"}, std::vector<std::string>{"", "-"}, std::vector<std::string>{"a", "b", "1"}})
      EXPECT_NO_THROW(guess_capture(
          folder_of({odd.begin(), odd.begin() + static_cast<std::ptrdiff_t>(n)}, {calibration_of(names)})))
          << n;
}

// ---- on disk ----

TEST(CaptureGuessOnDisk, WritesACaptureThatCanBePrepared) {
  const test_capture::CaptureFixture fixture;
  fs::remove(fixture.root() / "capture.yaml");
  const CaptureGuess guess = guess_capture(read_folder(FolderListing(fixture.root())));
  ASSERT_TRUE(guess.complete) << all_of(guess.missing);
  ASSERT_EQ(guess.capture.sequences.size(), 2u) << all_of(guess.found);
  write_capture(fixture.root() / "capture.yaml", guess.capture);
  const Capture capture = fixture.capture();
  EXPECT_EQ(capture.sequences[1].name, "training");
  EXPECT_EQ(capture.sequences[1].masks, "training/masks/{camera:02}.mkv");
  EXPECT_EQ(capture.sequences[0].motion, "testing/poses.motion");
  EXPECT_EQ(capture.fps, 25.0);
  EXPECT_TRUE(fixture.prepare().finished);
}

TEST(CaptureGuessOnDisk, LinksInCirclesAndCapturesInsideAreLeftOut) {
  const TemporaryFolder folder;
  for (const char* name : {"videos", "tracked", ".hidden"}) fs::create_directories(folder / name);
  fs::create_directory_symlink(folder.path(), folder / "videos/up");
  fs::create_symlink(folder / "nowhere", folder / "videos/broken.mp4");
  write_atomically(folder / "tracked/capture.yaml", "doppel_capture: 1\n");
  write_atomically(folder / "tracked/a.mp4", "x");
  write_atomically(folder / ".hidden/b.mp4", "x");
  write_atomically(folder / "videos/c.mp4", "no video");
  write_atomically(folder / "videos/cameras.calibration", "Skeletool Camera Calibration File V1.0\nname 0\n");
  const FolderContent content = read_folder(FolderListing(folder.path()));
  EXPECT_EQ(content.files, (std::vector<std::string>{"videos/c.mp4", "videos/cameras.calibration"}));
  EXPECT_TRUE(content.calibrations.empty());
  EXPECT_EQ(content.notes.size(), 2u) << all_of(content.notes);
  EXPECT_THAT(support::message_of([&] { read_folder(FolderListing(folder / "nowhere")); }), HasSubstr("not a folder"));
}

/// A person of 25 points, as OpenPose writes it.
std::string openpose_person() {
  std::string points;
  for (int i = 0; i < 25; ++i) points += (i > 0 ? ",30,40,0.5" : "30,40,0.5");
  return "{\"people\":[{\"pose_keypoints_2d\":[" + points + "]}]}";
}

constexpr char kOneCamera[] =
    "[cam_01]\nname = \"cam_01\"\nsize = [16.0, 16.0]\nmatrix = [[20.0, 0.0, 8.0], [0.0, 20.0, 8.0], [0.0, 0.0, "
    "1.0]]\ndistortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.1, 0.2, 0.3]\ntranslation = [0.0, 1.0, 3.0]\n";

TEST(CaptureGuessOnDisk, AClipThatBeginsWithTheEmptyScene) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "keypoints/000");
  for (int frame = 0; frame < 50; ++frame)
    support::write_bytes(folder / fmt::format("keypoints/000/stream000_{:012}_keypoints.json", frame),
                         frame < 30 ? "{\"people\":[]}" : openpose_person());
  support::write_bytes(folder / "joints3d.csv", "frame,index,name,x_mm,y_mm,z_mm\n30,8,MidHip,0,0,0\n");
  support::write_bytes(folder / "calibration.toml", kOneCamera);
  fs::create_directories(folder / "images");
  for (int frame = 0; frame < 2; ++frame)
    cv::imwrite((folder / fmt::format("images/{:04}.png", frame)).string(), cv::Mat::zeros(16, 16, CV_8UC3));
  const auto guess = [&] { return guess_capture(read_folder(FolderListing(folder.path()))); };
  const CaptureGuess first = guess();
  const SequenceEntry& entry = first.capture.sequences.at(0);
  EXPECT_EQ(entry.keypoints, "keypoints/000/stream000_{frame:012}_keypoints.json") << all_of(first.missing);
  EXPECT_EQ(first.capture.keypoint_map, "body25");
  EXPECT_EQ(entry.joints3d, "joints3d.csv");

  fs::copy_file(folder / "joints3d.csv", folder / "again.csv");
  const CaptureGuess second = guess();
  EXPECT_EQ(second.capture.sequences.at(0).joints3d, "") << "of two tables, none is certain";
  EXPECT_THAT(all_of(second.found), HasSubstr("again.csv, joints3d.csv; not used"));
}

TEST(CaptureGuessOnDisk, HostileFilesAreLeftOut) {
  const TemporaryFolder folder;
  const std::string people = openpose_person(), calibration = kOneCamera;
  const auto guess_with = [&](const std::string& keypoints, const std::string& cameras, const std::string& image) {
    support::write_bytes(folder / "cam01_0.json", keypoints);
    support::write_bytes(folder / "cam01_1.json", keypoints);
    support::write_bytes(folder / "calibration.toml", cameras);
    for (const char* name : {"cam01_0.png", "cam01_1.png", "cam01.mp4"}) support::write_bytes(folder / name, image);
    return guess_capture(read_folder(FolderListing(folder.path())));
  };
  EXPECT_EQ(guess_with(people, calibration, "").capture.keypoint_map, "body25");
  for (const auto& hostile : support::hostile_variants(people, 8))
    support::expect_rejects_or_reads(hostile.what, [&] { guess_with(hostile.content, calibration, hostile.content); });
  for (const auto& hostile : support::hostile_variants(calibration, 8))
    support::expect_rejects_or_reads(hostile.what, [&] { guess_with(people, hostile.content, ""); });
}

TEST(CaptureGuess, OfCalibrationsThatFitTheOneWithFewerAssumptions) {
  const std::vector<std::string> files{"videos/cam01.mp4", "videos/cam02.mp4"};
  FoundCalibration vague = calibration_of({"cam_01", "cam_02"}, "a.toml"), stated = vague;
  stated.path = "b/qualisys.txt";
  vague.calibration.notes = {"the file does not state its unit; metres was assumed"};
  const CaptureGuess same = guess_capture(folder_of(files, {vague, stated}));
  EXPECT_EQ(same.capture.calibration, "b/qualisys.txt");
  EXPECT_THAT(all_of(same.found), HasSubstr("a.toml (toml, 2 cameras) has the same cameras within 0.0 mm"));
  vague.calibration.cameras[1].t += Eigen::Vector3d(0.5, 0.0, 0.0);
  const CaptureGuess other = guess_capture(folder_of(files, {vague, stated}));
  EXPECT_EQ(other.capture.calibration, "b/qualisys.txt");
  EXPECT_THAT(all_of(other.found), HasSubstr("in other positions, up to 0.5 m apart"));
}

class RealCaptureGuess : public support::SharedFolderTest {
 protected:
  fs::path p2s(const std::string& name) const { return shared_ / "captures/p2s" / name; }
};

// A stranger's folder: calibration and videos alone, then keypoints of BODY_25B too.
TEST_F(RealCaptureGuess, AFolderOfVideosAndACalibration) {
  for (const bool keypoints : {false, true}) {
    const TemporaryFolder folder;
    fs::create_directory_symlink(p2s("videos"), folder / "videos");
    fs::create_symlink(p2s("calibration.toml"), folder / "calibration.toml");
    if (keypoints) fs::create_directory_symlink(p2s("openpose"), folder / "openpose");
    const CaptureGuess guess = guess_capture(read_folder(FolderListing(folder.path())));
    ASSERT_TRUE(guess.complete) << all_of(guess.missing);
    write_capture(folder / "capture.yaml", guess.capture);
    const Capture capture = read_capture(folder.path());
    EXPECT_NEAR(capture.fps, 60.0, 1e-6);
    EXPECT_TRUE(capture.camera_fps.empty());
    const CaptureCameras chosen = choose_cameras(capture);
    ASSERT_EQ(chosen.cameras.size(), 4u);
    const SequenceEntry& entry = capture.sequences.at(0);
    for (int c = 0; c < 4; ++c) {
      const std::string number = std::to_string(c + 1), name = "cam_0" + number;
      EXPECT_EQ(chosen.cameras[static_cast<std::size_t>(c)].name, name);
      EXPECT_EQ(capture.source(entry.videos, c, name), (capture.root / ("videos/cam0" + number + ".mp4")).string());
      if (!keypoints) continue;
      EXPECT_EQ(capture.source(entry.keypoints, c, name),
                (capture.root / ("openpose/cam0" + number + "/cam0" + number + ".{frame:04}.json")).string());
    }
    EXPECT_EQ(entry.keypoints.empty(), !keypoints);
    EXPECT_EQ(capture.keypoint_map, keypoints ? "body25b" : "");
    EXPECT_THAT(all_of(guess.found),
                HasSubstr("videos/cam01.mp4 is 1080x1920, the calibration of cam_01 is for 1088x1920"));
    const Camera fitted = fit_to_images(chosen.cameras[0], {1080, 1920}, "cam01");
    EXPECT_EQ(fitted.width, 1080);
    EXPECT_EQ(fitted.K, chosen.cameras[0].K) << "1088 was 1080 with the padding of the encoder";
  }
}

// The whole folder has two calibrations, of Qualisys and of Pose2Sim.
TEST_F(RealCaptureGuess, TwoCalibrationsOfTheSameCameras) {
  const CaptureGuess guess = guess_capture(read_folder(FolderListing(p2s(""))));
  ASSERT_TRUE(guess.complete) << all_of(guess.missing);
  EXPECT_EQ(guess.capture.calibration, "Calib.qca.txt");
  EXPECT_THAT(all_of(guess.found), HasSubstr("calibration.toml (toml, 4 cameras) has the same cameras within"));
  EXPECT_EQ(guess.capture.keypoint_map, "body25b");
  EXPECT_EQ(guess.missing.size(), 2u) << "masks and a character: " << all_of(guess.missing);
}

}  // namespace
}  // namespace doppel::capture_guess_test
