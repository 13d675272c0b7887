// Folders whose files were named by cameras and programs: by counters, by numbers from 1, and by times.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/layouts/guess_capture.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "support/hostile_files.h"
#include "support/shared_folder.h"

namespace doppel::guess_names_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kFrames = 12;

std::string all_of(const std::vector<std::string>& sentences) { return fmt::format("{}", fmt::join(sentences, "\n")); }

std::vector<Camera> ring(int count) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    cameras.push_back(test_capture::ring_camera(i, count));
    cameras.back().name = fmt::format("cam{}", i);
  }
  return cameras;
}

/// COCO's 17 points, and where each of them is in a frame.
const std::vector<std::string>& coco17() {
  static const std::vector<std::string> names{
      "nose",           "left_eye",   "right_eye",   "left_ear",   "right_ear",   "left_shoulder",
      "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip",
      "right_hip",      "left_knee",  "right_knee",  "left_ankle", "right_ankle"};
  return names;
}
cv::Point2d at(int point, int frame) {
  static const std::vector<cv::Point2d> standing{{50, 10}, {52, 8},  {48, 8},  {55, 10},  {45, 10}, {60, 25},
                                                 {40, 25}, {65, 45}, {35, 45}, {66, 60},  {34, 60}, {56, 65},
                                                 {44, 65}, {57, 90}, {43, 90}, {57, 115}, {43, 115}};
  return standing[static_cast<std::size_t>(point)] + cv::Point2d(frame, 0.5);
}

std::string openpose_file(int frame) {
  std::string points;
  for (int k = 0; k < 17; ++k) points += fmt::format("{}{},{},0.9", k > 0 ? "," : "", at(k, frame).x, at(k, frame).y);
  return "{\"people\":[{\"pose_keypoints_2d\":[" + points + "]}]}";
}

/// AlphaPose's list of people, one for each image.
std::string alphapose_file(const std::vector<std::string>& images) {
  std::string text;
  for (std::size_t f = 0; f < images.size(); ++f) {
    std::string points;
    for (int k = 0; k < 17; ++k)
      points +=
          fmt::format("{}{},{},0.9", k > 0 ? "," : "", at(k, static_cast<int>(f)).x, at(k, static_cast<int>(f)).y);
    text += fmt::format("{}{{\"image_id\":\"{}\",\"category_id\":1,\"keypoints\":[{}],\"score\":3.0}}",
                        f > 0 ? "," : "", images[f], points);
  }
  return "[" + text + "]";
}

class GuessedNames : public ::testing::Test {
 protected:
  GuessedNames() { write_calibration(folder_ / "cameras.yml", ring(2)); }

  void video(const std::string& path, int frames = kFrames, double rate = 25.0) {
    fs::create_directories((folder_ / path).parent_path());
    VideoFile file(folder_ / path, {test_capture::kWidth, test_capture::kHeight}, rate);
    for (int f = 0; f < frames; ++f)
      file.write(cv::Mat(test_capture::kHeight, test_capture::kWidth, CV_8UC3, cv::Scalar::all(10 * f)));
    file.close();
  }
  /// A grey image; its brightness tells which one it is.
  void image(const std::string& path, int brightness = 0) {
    fs::create_directories((folder_ / path).parent_path());
    cv::imwrite((folder_ / path).string(),
                cv::Mat(test_capture::kHeight, test_capture::kWidth, CV_8UC3, cv::Scalar::all(brightness)));
  }
  void text(const std::string& path, const std::string& content) { write_atomically(folder_ / path, content); }

  CaptureGuess guess() const { return guess_folder(folder_.path()); }
  /// The points of a camera in a video frame, as the guessed capture says.
  std::optional<People> people(const CaptureGuess& guess, const std::string& camera, long frame) const {
    const SequenceEntry& entry = guess.capture.sequences.at(0);
    const int index = camera.back() - '0';
    const KeypointSource source(
        guess.capture.source(entry.keypoints, index, camera), read_keypoint_map("coco17").layout,
        {camera, index, test_capture::kWidth, test_capture::kHeight}, entry.keypoint_offset_of(camera));
    return source.people(frame);
  }
  void expect_points_of_frame(const CaptureGuess& guess, long frame, int shown) const {
    for (const std::string camera : {"cam0", "cam1"}) {
      const auto found = people(guess, camera, frame);
      ASSERT_TRUE(found.has_value() && found->size() == 1u) << camera << " " << frame << "\n" << all_of(guess.found);
      EXPECT_NEAR((*found)[0][0].x, at(0, shown).x, 1e-3) << camera << " " << frame;
    }
  }

  TemporaryFolder folder_;
};

// ---- names of cameras ----

TEST_F(GuessedNames, KeypointsOfEachTakeInAFileForEachCamera) {
  std::vector<std::string> images;
  for (int f = 0; f < kFrames; ++f) images.push_back(fmt::format("{:06}.jpg", f));
  for (int take = 1; take <= 3; ++take)
    for (int camera = 0; camera < 2; ++camera) {
      video(fmt::format("take{}_cam{}.mp4", take, camera));
      text(fmt::format("keypoints/take{}_cam{}.json", take, camera), alphapose_file(images));
    }
  const CaptureGuess found = guess();
  ASSERT_EQ(found.capture.sequences.size(), 3u) << all_of(found.found);
  for (int take = 1; take <= 3; ++take)
    EXPECT_EQ(found.capture.sequences[static_cast<std::size_t>(take - 1)].keypoints,
              fmt::format("keypoints/take{}_{{name}}.json", take))
        << all_of(found.found) << all_of(found.missing);
  expect_points_of_frame(found, 5, 5);
}

TEST_F(GuessedNames, OneFolderPerCameraAndNamesByTheCamera) {
  video("cam0/GX010500.MP4");
  video("cam1/GX010507.MP4");
  const CaptureGuess found = guess();
  ASSERT_TRUE(found.complete) << all_of(found.missing);
  ASSERT_EQ(found.capture.sequences.size(), 1u) << all_of(found.found);
  EXPECT_TRUE(found.capture.cameras.empty()) << "all are used";
  EXPECT_EQ(found.capture.sequences[0].videos,
            CameraPaths({{"cam0", "cam0/GX010500.MP4"}, {"cam1", "cam1/GX010507.MP4"}}));
}

TEST_F(GuessedNames, CamerasOfDifferentMakersAndFoldersInside) {
  video("videos/cam0/100GOPRO/GX010500.MP4");
  video("videos/cam1/DCIM/DSC_0007.MP4");
  for (int c = 0; c < 2; ++c)
    for (int f = 0; f < 3; ++f) image(fmt::format("masks/cam{}/GX01050{}/{:04}.png", c, 7 * c, f), 255);
  const CaptureGuess found = guess();
  ASSERT_EQ(found.capture.sequences.size(), 1u) << all_of(found.found);
  EXPECT_EQ(found.capture.sequences[0].masks, CameraPaths({{"cam0", "masks/cam0/GX010500/{frame:04}.png"},
                                                           {"cam1", "masks/cam1/GX010507/{frame:04}.png"}}));
}

TEST_F(GuessedNames, SeveralTakesAreInTheirOrder) {
  for (const char* path : {"cam0/GX010009.MP4", "cam0/GX010010.MP4", "cam1/GX010120.MP4", "cam1/GX010121.MP4"})
    video(path);
  const CaptureGuess found = guess();
  ASSERT_EQ(found.capture.sequences.size(), 2u) << all_of(found.found);
  EXPECT_EQ(found.capture.sequences[0].videos,
            CameraPaths({{"cam0", "cam0/GX010009.MP4"}, {"cam1", "cam1/GX010120.MP4"}}));
  EXPECT_EQ(found.capture.sequences[1].videos,
            CameraPaths({{"cam0", "cam0/GX010010.MP4"}, {"cam1", "cam1/GX010121.MP4"}}));
}

TEST_F(GuessedNames, NamesByPersonsAreNotJoined) {
  video("cam0/walk.mp4");
  video("cam1/run.mp4");
  const CaptureGuess found = guess();
  EXPECT_FALSE(found.complete);
  EXPECT_THAT(all_of(found.missing), AllOf(HasSubstr("cam0/walk.mp4"), HasSubstr("under `videos`")));
}

TEST_F(GuessedNames, CamerasThatNumberTheirImages) {
  for (int f = 0; f < 5; ++f) {
    image(fmt::format("cam0/DSC_{:04}.jpg", 123 + f));
    image(fmt::format("cam1/DSC_{:04}.jpg", 456 + f));
  }
  const CaptureGuess found = guess();
  ASSERT_EQ(found.capture.sequences.size(), 1u) << all_of(found.found);
  EXPECT_EQ(found.capture.sequences[0].frame_offset, (std::map<std::string, double>{{"cam0", 123.0}, {"cam1", 456.0}}));
}

// ---- tables ----

class GuessedTables : public GuessedNames {
 protected:
  GuessedTables() {
    video("videos/cam0.mp4");
    video("videos/cam1.mp4");
  }
  /// One row per frame. @param cell how a number is written
  static std::string wide(char separator, const std::function<std::string(double)>& cell, int first = 0) {
    std::string table = cell(NAN).empty() ? "\"frame\"" : "frame";
    for (const std::string& name : coco17())
      for (const char* part : {"x", "y", "visibility"}) table += fmt::format("{}{}_{}", separator, name, part);
    for (int f = 0; f < kFrames; ++f) {
      table += "\n" + cell(f + first);
      for (int k = 0; k < 17; ++k)
        table += fmt::format("{0}{1}{0}{2}{0}{3}", separator, cell(at(k, f).x), cell(at(k, f).y), cell(0.9));
    }
    return table + "\n";
  }
  void expect_found(const std::string& tables) {
    for (int c = 0; c < 2; ++c) text(fmt::format("keypoints/cam{}.csv", c), tables);
    const CaptureGuess found = guess();
    ASSERT_EQ(found.capture.sequences.size(), 1u);
    EXPECT_EQ(found.capture.sequences[0].keypoints, "keypoints/{name}.csv") << all_of(found.missing);
    expect_points_of_frame(found, 3, 3);
    EXPECT_TRUE(found.capture.sequences[0].keypoint_offset.empty()) << all_of(found.found);
  }
};

TEST_F(GuessedTables, OneRowPerFrameInEverySpelling) {
  const auto plain = [](double value) { return fmt::format("{}", value); };
  const auto with_comma = [](double value) {
    std::string text = fmt::format("{}", value);
    std::replace(text.begin(), text.end(), '.', ',');
    return text;
  };
  const auto quoted = [](double value) { return std::isnan(value) ? "" : fmt::format("\"{}\"", value); };
  expect_found(wide(',', plain));
  expect_found(wide(',', quoted));
  expect_found(wide(';', with_comma));
  expect_found(wide(';', plain));
  expect_found(wide('\t', with_comma));
  expect_found("\xEF\xBB\xBFsep=;\r\n" + support::with_crlf(wide(';', with_comma)));
}

TEST_F(GuessedTables, OneRowPerPointInAnyOrderOfColumns) {
  using Columns = std::vector<std::string>;
  for (const Columns& columns :
       {Columns{"frame", "name", "x", "y", "confidence"}, Columns{"x", "y", "confidence", "frame", "joint"},
        Columns{"frame", "joint", "x", "y", "score"}, Columns{"name", "frame", "x", "y", "confidence"},
        Columns{"Frame", "BodyPart", "X", "Y", "Likelihood"}, Columns{"y", "x", "landmark", "frame_id"}}) {
    std::string table = fmt::format("{}", fmt::join(columns, ","));
    SCOPED_TRACE(table);
    for (int f = 0; f < kFrames; ++f)
      for (int k = 0; k < 17; ++k) {
        Columns cells;
        for (const std::string& column : columns) {
          const char first = static_cast<char>(std::tolower(static_cast<unsigned char>(column[0])));
          cells.push_back(first == 'f'   ? std::to_string(f)
                          : first == 'x' ? fmt::format("{}", at(k, f).x)
                          : first == 'y' ? fmt::format("{}", at(k, f).y)
                          : column == "confidence" || column == "score" || column == "Likelihood"
                              ? "0.9"
                              : coco17()[static_cast<std::size_t>(k)]);
        }
        table += fmt::format("\n{}", fmt::join(cells, ","));
      }
    expect_found(table + "\n");
  }
}

TEST_F(GuessedTables, OtherTablesAreNone) {
  text("keypoints/cam0.csv", "time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z\n0,1,2,3,4,5,6\n");
  text("keypoints/cam1.csv", "frame,joint,x,y,z\n0,nose,0.1,1.2,0.3\n");
  text("frames.csv", "frame,segment\n0,0\n");
  EXPECT_TRUE(guess().capture.sequences.at(0).keypoints.empty());
}

// ---- numbers ----

TEST_F(GuessedTables, FilesNumberedFromOneAreOfTheFrameBefore) {
  for (const int first : {0, 1, 100}) {
    fs::remove_all(folder_ / "keypoints");
    for (int c = 0; c < 2; ++c)
      for (int f = 0; f < kFrames; ++f)
        text(fmt::format("keypoints/cam{0}/cam{0}_{1:06}.json", c, f + first), openpose_file(f));
    const CaptureGuess found = guess();
    expect_points_of_frame(found, 4, 4);
    expect_points_of_frame(found, 0, 0);
    EXPECT_EQ(found.capture.sequences[0].keypoint_offset.count("cam0"), first > 0 ? 1u : 0u) << all_of(found.found);
    write_capture(folder_ / "out.yaml", found.capture);
    EXPECT_EQ(read_capture(folder_ / "out.yaml").sequences[0].keypoint_offset,
              found.capture.sequences[0].keypoint_offset);
    fs::remove(folder_ / "out.yaml");
  }
}

TEST_F(GuessedTables, FilesOfAllFramesNumberedFromOne) {
  std::vector<std::string> names;
  for (int f = 0; f < kFrames; ++f) names.push_back(fmt::format("img_{:06}.png", f + 1));
  for (int c = 0; c < 2; ++c) text(fmt::format("keypoints/cam{}.json", c), alphapose_file(names));
  const CaptureGuess found = guess();
  expect_points_of_frame(found, 4, 4);
  for (int c = 0; c < 2; ++c) fs::remove(folder_ / fmt::format("keypoints/cam{}.json", c));
  const auto plain = [](double value) { return fmt::format("{}", value); };
  for (int c = 0; c < 2; ++c) text(fmt::format("keypoints/cam{}.csv", c), wide(',', plain, 1));
  expect_points_of_frame(guess(), 4, 4);
}

TEST_F(GuessedTables, TheFirstImagesMayShowNobody) {
  const auto write = [&](int first, int last, int offset) {
    fs::remove_all(folder_ / "keypoints");
    for (int c = 0; c < 2; ++c)
      for (int f = first; f <= last; ++f)
        text(fmt::format("keypoints/cam{0}/{1:06}.json", c, f + offset), openpose_file(f));
  };
  write(3, kFrames - 1, 1);
  expect_points_of_frame(guess(), 4, 4);
  write(3, kFrames - 1, 0);
  expect_points_of_frame(guess(), 4, 4);
  write(1, kFrames - 3, 0);
  const CaptureGuess within = guess();
  expect_points_of_frame(within, 4, 4);
  EXPECT_THAT(all_of(within.found), HasSubstr("begin with number 1"));
  write(0, kFrames - 2, 5);
  EXPECT_THAT(all_of(guess().missing), AllOf(HasSubstr("numbers 5 to 15"), HasSubstr("`keypoint_offset`")));
}

TEST_F(GuessedNames, MasksNumberedFromOneAreOfTheFrameBefore) {
  for (int c = 0; c < 2; ++c) video(fmt::format("videos/cam{}.mp4", c));
  for (const int first : {0, 1}) {
    fs::remove_all(folder_ / "masks");
    for (int c = 0; c < 2; ++c)
      for (int f = 0; f < kFrames; ++f) image(fmt::format("masks/cam{}/{:06}.png", c, f + first), 10 * f);
    const CaptureGuess found = guess();
    const SequenceEntry& entry = found.capture.sequences.at(0);
    EXPECT_EQ(entry.mask_offset_of("cam1"), first) << all_of(found.found);
    const auto masks = open_masks(found.capture, entry, "cam1", 1);
    EXPECT_EQ(masks->num_frames(-1), kFrames);
    EXPECT_EQ(masks->read(4).at<std::uint8_t>(0, 0), 40);
  }
}

TEST_F(GuessedTables, OneTableOfAllCamerasIsNumberedToo) {
  std::string table = "frame,camera,joint,x,y,confidence\n";
  for (int f = 1; f <= kFrames; ++f)
    for (const char* camera : {"cam0", "cam1"})
      for (std::size_t k = 0; k < coco17().size(); ++k)
        table += fmt::format("{},{},{},{},{},0.9\n", f, camera, coco17()[k], at(static_cast<int>(k), f - 1).x,
                             at(static_cast<int>(k), f - 1).y);
  text("kp.csv", table);
  EXPECT_EQ(guess().capture.sequences.at(0).keypoint_offset_of("cam1"), 1) << all_of(guess().found);
}

TEST_F(GuessedNames, MasksOfAnotherTakeAreNotTaken) {
  for (const char* take : {"walk", "walk_fast", "s1_t2", "s2_t1"})
    for (int c = 0; c < 2; ++c) video(fmt::format("{}/cam{}.mp4", take, c));
  for (const char* take : {"walk_fast", "s1_t2"})
    for (int c = 0; c < 2; ++c) video(fmt::format("masks/{}/cam{}.mp4", take, c));
  const CaptureGuess found = guess();
  ASSERT_EQ(found.capture.sequences.size(), 4u) << all_of(found.found);
  for (const SequenceEntry& entry : found.capture.sequences)
    EXPECT_EQ(entry.has_masks(), entry.name == "walk_fast" || entry.name == "s_1_t_2") << entry.name;
}

TEST_F(GuessedNames, AsManyImagesFromOtherNumbersAreOwnCounters) {
  for (int c = 0; c < 2; ++c)
    for (int f = 0; f < kFrames; ++f) image(fmt::format("images/cam{}/DSC{:05}.png", c, 10 + 3 * c + f), f);
  const SequenceEntry entry = guess().capture.sequences.at(0);
  EXPECT_EQ(entry.frame_offset.at("cam0"), 10.0);
  EXPECT_EQ(entry.frame_offset.at("cam1"), 13.0);
}

TEST_F(GuessedNames, SequencesOfAnotherRateAreNamed) {
  for (int c = 0; c < 2; ++c) {
    for (const char* take : {"run", "jump"}) video(fmt::format("{}/cam{}.mp4", take, c), 100, 50.0);
    video(fmt::format("walk/cam{}.mp4", c), 100);
  }
  const CaptureGuess found = guess();
  EXPECT_EQ(found.capture.fps, 50.0);
  EXPECT_TRUE(found.capture.camera_fps.empty());
  EXPECT_THAT(all_of(found.missing), HasSubstr("walk has 25 frames a second, others 50"));
}

TEST_F(GuessedNames, SomethingIsForTraining) {
  for (int c = 0; c < 2; ++c) video(fmt::format("test/cam{}.mp4", c));
  const CaptureGuess found = guess();
  EXPECT_EQ(found.capture.sequences.at(0).split, Split::train);
  EXPECT_THAT(all_of(found.found), HasSubstr("though its name says test"));
}

TEST_F(GuessedNames, OneCalibrationFilePerCameraIsNoneOfAll) {
  fs::remove(folder_ / "cameras.yml");
  for (int c = 0; c < 2; ++c) {
    write_calibration(folder_ / fmt::format("calib/cam{}.yml", c), {ring(2)[static_cast<std::size_t>(c)]});
    video(fmt::format("cam{}.mp4", c));
  }
  const CaptureGuess found = guess();
  EXPECT_FALSE(found.complete);
  EXPECT_THAT(all_of(found.missing), HasSubstr("hold one camera each"));
}

TEST_F(GuessedNames, ImagesAndKeypointsMayCountFromTheSameNumber) {
  for (int c = 0; c < 2; ++c)
    for (int f = 0; f < kFrames; ++f) {
      image(fmt::format("images/cam{}/{:06}.png", c, f + 1), f);
      text(fmt::format("same/cam{}/{:06}.json", c, f + 1), openpose_file(f));
    }
  EXPECT_TRUE(guess().capture.sequences.at(0).keypoint_offset.empty());
  expect_points_of_frame(guess(), 1, 0);
  fs::rename(folder_ / "same", folder_ / "hidden");
  fs::remove_all(folder_ / "hidden");
  for (int c = 0; c < 2; ++c)
    for (int f = 0; f < kFrames; ++f) text(fmt::format("from0/cam{}/{:06}.json", c, f), openpose_file(f));
  expect_points_of_frame(guess(), 1, 0);
}

// ---- times ----

/// Twelve times from a second to the next, in the form of the name of an image.
std::vector<std::string> times(const std::string& form) {
  std::vector<std::string> names;
  for (int f = 0; f < kFrames; ++f) {
    const int micros = 700000 + 55000 * f;
    if (form == "date")
      names.push_back(fmt::format("2024-05-06T07_08_{:02}.{:06}.png", 9 + micros / 1000000, micros % 1000000));
    else if (form == "milliseconds")
      names.push_back(fmt::format("{}.png", 1714979289000L + micros / 1000));
    else if (form == "nanoseconds")
      names.push_back(fmt::format("{}.png", 1714979289000000000L + 1000L * micros));
    else if (form == "compact")
      names.push_back(fmt::format("20240506_0708{:02}_{:03}.png", 9 + micros / 1000000, micros / 1000 % 1000));
    else  // as Python writes seconds: without zeros at the end
      names.push_back(fmt::format("{:.13g}.png", 1714979289.0 + micros / 1e6));
  }
  return names;
}

TEST_F(GuessedNames, ImagesNamedByTimesAreInTheirOrder) {
  for (const char* form : {"date", "milliseconds", "nanoseconds", "compact", "seconds"}) {
    SCOPED_TRACE(form);
    const std::vector<std::string> names = times(form);
    fs::remove_all(folder_ / "images");
    for (int c = 0; c < 2; ++c) {
      for (int f = 0; f < kFrames; ++f)
        image(fmt::format("images/cam{}/{}", c, names[static_cast<std::size_t>(f)]), 10 * f);
      text(fmt::format("keypoints/cam{}.json", c), alphapose_file(names));
    }
    const CaptureGuess found = guess();
    ASSERT_TRUE(found.complete) << all_of(found.missing);
    ASSERT_EQ(found.capture.sequences.size(), 1u) << all_of(found.found);
    const SequenceEntry& entry = found.capture.sequences[0];
    EXPECT_EQ(entry.videos, "images/{name}") << all_of(found.found);
    EXPECT_TRUE(entry.frame_offset.empty()) << all_of(found.found);
    EXPECT_TRUE(entry.keypoint_offset.empty()) << all_of(found.found);
    EXPECT_THAT(all_of(found.found), HasSubstr("times as names"));
    expect_points_of_frame(found, 9, 9);
    const auto frames = open_frames((folder_ / "images/cam1").string(), PixelFormat::grey);
    EXPECT_EQ(frames->num_frames(0), kFrames);
    EXPECT_NEAR(frames->read(9).at<unsigned char>(5, 5), 90, 2);
    EXPECT_EQ(frames->size(), cv::Size(test_capture::kWidth, test_capture::kHeight));
    EXPECT_THROW(frames->read(kFrames), FileError);
  }
}

TEST_F(GuessedTables, KeypointsOfImagesNamedByTimesBesideVideos) {
  for (const char* form : {"date", "milliseconds", "nanoseconds", "compact", "seconds"}) {
    SCOPED_TRACE(form);
    for (int c = 0; c < 2; ++c) text(fmt::format("keypoints/cam{}.json", c), alphapose_file(times(form)));
    const CaptureGuess found = guess();
    EXPECT_TRUE(found.capture.sequences.at(0).keypoint_offset.empty()) << all_of(found.found);
    expect_points_of_frame(found, 9, 9);
  }
  for (int c = 0; c < 2; ++c) {
    fs::remove(folder_ / fmt::format("keypoints/cam{}.json", c));
    const std::vector<std::string> names = times("date");
    for (int f = 0; f < kFrames; ++f)
      text(fmt::format("keypoints/cam{}/{}_keypoints.json", c,
                       fs::path(names[static_cast<std::size_t>(f)]).stem().string()),
           openpose_file(f));
  }
  const CaptureGuess found = guess();
  EXPECT_EQ(found.capture.sequences.at(0).keypoints, "keypoints/{name}") << all_of(found.missing);
  expect_points_of_frame(found, 9, 9);
}

// ---- published examples ----

class RealGuessedNames : public support::SharedFolderTest {
 protected:
  /// The guess of a case, and an empty text; or why there is none.
  CaptureGuess guess_of(const std::string& name) const { return guess_folder(shared_ / "cases" / name); }
};

TEST_F(RealGuessedNames, FilesNamedByGoPro) {
  const CaptureGuess found = guess_of("15-files-named-by-the-camera");
  ASSERT_EQ(found.capture.sequences.size(), 1u) << all_of(found.found);
  EXPECT_EQ(found.capture.sequences[0].videos.by_camera().size(), 4u);
}

TEST_F(RealGuessedNames, TablesThatWereOverlooked) {
  const std::string wide = "17-csv-tables-that-init-overlooks", narrow = "33-tables-with-one-row-per-point/";
  EXPECT_EQ(guess_of(wide).capture.sequences.at(0).keypoints, "keypoints/{name}.csv");
  for (const char* table : {"a", "d"})
    EXPECT_EQ(guess_of(narrow + table).capture.sequences.at(0).keypoints, "keypoints/cam0.csv") << table;
}

TEST_F(RealGuessedNames, ImagesNamedByTimes) {
  const CaptureGuess images = guess_of("29-pictures-named-by-time-stamps/pictures");
  ASSERT_EQ(images.capture.sequences.size(), 1u) << all_of(images.found);
  EXPECT_EQ(images.capture.sequences[0].videos, "images/{name}");
  EXPECT_TRUE(images.capture.sequences[0].frame_offset.empty());
  const CaptureGuess video = guess_of("29-pictures-named-by-time-stamps/video");
  EXPECT_EQ(video.capture.sequences.at(0).keypoints, "keypoints/{name}.json");
  EXPECT_TRUE(video.capture.sequences[0].keypoint_offset.empty());
}

}  // namespace
}  // namespace doppel::guess_names_test
