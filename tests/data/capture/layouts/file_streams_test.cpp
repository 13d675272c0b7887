#include "doppel/data/capture/layouts/file_streams.h"

#include <gtest/gtest.h>

namespace doppel::file_streams_test {
namespace {

std::vector<std::string> paths_of(const std::vector<FileStream>& streams) {
  std::vector<std::string> paths;
  for (const FileStream& stream : streams) paths.push_back(stream.path);
  return paths;
}

using Paths = std::vector<std::string>;

TEST(FileStreamsReference, ImagesOfAFolderAreFrames) {
  const auto streams =
      group_streams({"a/000007.jpg", "a/000008.jpg", "a/000009.jpg", "b/1.png", "b/2.png", "b/10.png"});
  EXPECT_EQ(paths_of(streams), (Paths{"a/{frame:06}.jpg", "b/{frame}.png"}));
  EXPECT_EQ(streams[0].first_frame, 7);
  EXPECT_EQ(streams[0].files, 3);
  EXPECT_EQ(streams[0].first_file, "a/000007.jpg");
  EXPECT_TRUE(streams[0].per_frame);
  EXPECT_EQ(streams[0].stem(), "a/.");
}

TEST(FileStreamsReference, TheNumberWithMostValuesCountsTheFrames) {
  Paths files;
  for (const char* camera : {"0", "1"})
    for (const char* frame : {"3", "4", "5"})
      files.push_back(std::string("image_c_") + camera + "_f_" + frame + ".jpg");
  EXPECT_EQ(paths_of(group_streams(files)), (Paths{"image_c_0_f_{frame:01}.jpg", "image_c_1_f_{frame:01}.jpg"}));
  files.clear();
  for (const char* frame : {"0001", "0002", "0003"})
    for (const char* camera : {"1", "2"}) files.push_back(std::string("frame_") + frame + "_cam" + camera + ".jpg");
  EXPECT_EQ(paths_of(group_streams(files)), (Paths{"frame_{frame:04}_cam1.jpg", "frame_{frame:04}_cam2.jpg"}));
  // More cameras than frames: the word before the number tells.
  files.clear();
  for (const char* camera : {"01", "02", "03"})
    for (const char* frame : {"0000", "0001"}) files.push_back(std::string("a/cam") + camera + "_" + frame + ".png");
  EXPECT_EQ(paths_of(group_streams(files)),
            (Paths{"a/cam01_{frame:04}.png", "a/cam02_{frame:04}.png", "a/cam03_{frame:04}.png"}));
  EXPECT_EQ(paths_of(group_streams({"a/cam_0001.png", "a/cam_0002.png"})), (Paths{"a/cam_{frame:04}.png"}));
}

TEST(FileStreamsReference, VideosAndTablesStandAlone) {
  EXPECT_EQ(paths_of(group_streams({"v/cam10.MP4", "v/cam2.MP4", "k.csv", "readme.txt", "a.b/c"})),
            (Paths{"k.csv", "v/cam2.MP4", "v/cam10.MP4"}));
  EXPECT_EQ(paths_of(group_streams({"cam01.0000.json", "cam01.0001.json"})), (Paths{"cam01.{frame:04}.json"}));
  EXPECT_EQ(paths_of(group_streams({"cam01.json", "cam02.json"}, false)), (Paths{"cam01.json", "cam02.json"}));
  EXPECT_EQ(paths_of(group_streams({"0001_2d.png", "0002_2d.png"})), (Paths{"{frame:04}_2d.png"}));
}

TEST(FileStreamsReference, FoldersOfTimesAreOneStream) {
  const Paths times{"a/2024-05-06T07_08_09.960.png", "a/2024-05-06T07_08_10.000.png", "a/2024-05-06T07_08_10.040.png"};
  const auto streams = group_streams(times);
  EXPECT_EQ(paths_of(streams), Paths{"a"});
  EXPECT_TRUE(streams[0].per_frame && streams[0].by_position);
  EXPECT_EQ(streams[0].files, 3);
  EXPECT_EQ(streams[0].first_frame, 0);
  EXPECT_EQ(streams[0].last_frame, 2);
  EXPECT_EQ(streams[0].first_file, times[0]);
  EXPECT_EQ(streams[0].stem(), "a/.");
  EXPECT_EQ(paths_of(group_streams({"a/1714979289083.jpg", "a/1714979289123.jpg"})), Paths{"a"});
  const Paths whole{"a/2024-05-06T07_08_09.960000.png", "a/2024-05-06T07_08_10.040000.png",
                    "a/2024-05-06T07_08_10.png"};
  EXPECT_EQ(paths_of(group_streams(whole)), Paths{"a"}) << "Python leaves out a fraction of 0";
  Paths with_others = times;
  with_others.emplace_back("a/other.png");
  EXPECT_GT(group_streams(with_others).size(), 1u) << "the folder has other images";
}

TEST(FileStreamsReference, NumbersInSteps) {
  auto streams =
      group_streams({"a/0010.png", "a/0015.png", "a/0020.png", "b/0.png", "b/6.png", "b/12.png", "b/t.json"});
  EXPECT_EQ(paths_of(streams), (Paths{"a/{frame:04}.png", "b/{frame}.png", "b/t.json"}));
  EXPECT_EQ(streams[0].step, 5);
  EXPECT_EQ(streams[1].step, 6);
  EXPECT_TRUE(streams[0].alone && streams[1].alone);
  streams[0].count_positions();
  EXPECT_EQ(streams[0].path, "a");
  EXPECT_TRUE(streams[0].by_position);
  EXPECT_EQ(streams[0].first_frame, 0);
  EXPECT_EQ(streams[0].last_frame, 2);
  const auto lost = group_streams({"a/10.png", "a/15.png", "a/25.png", "a/other.png"});
  EXPECT_EQ(lost[0].step, 1) << "no common step";
  EXPECT_FALSE(lost[0].alone);
}

TEST(FileStreamsReference, SomeFramesOfTwoCamerasAreNoTimes) {
  EXPECT_EQ(paths_of(group_streams({"cam0_0010.png", "cam0_0020.png", "cam1_0010.png", "cam1_0020.png"})),
            (Paths{"cam0_{frame:04}.png", "cam1_{frame:04}.png"}));
}

/// A path for each folder and name.
Paths in_folders(const Paths& folders, const Paths& names) {
  Paths paths;
  for (const std::string& folder : folders)
    for (const std::string& name : names) paths.push_back(folder + "/" + name);
  return paths;
}

TEST(FileStreamsReference, AFolderPerFrame) {
  const auto streams = group_streams(in_folders({"frames/0007", "frames/0008", "frames/0009", "frames/0010"},
                                                {"50_01.jpg", "50_02.jpg", "50_03.jpg"}));
  EXPECT_EQ(paths_of(streams),
            (Paths{"frames/{frame:04}/50_01.jpg", "frames/{frame:04}/50_02.jpg", "frames/{frame:04}/50_03.jpg"}));
  EXPECT_EQ(streams[0].first_frame, 7);
  EXPECT_EQ(streams[0].last_frame, 10);
  EXPECT_EQ(streams[0].files, 4);
  EXPECT_EQ(streams[0].first_file, "frames/0007/50_01.jpg");
  EXPECT_EQ(streams[0].stem(), "frames//50_01.");
  EXPECT_EQ(paths_of(group_streams(in_folders({"t/9", "t/10"}, {"cam1.png", "cam2.png"}))),
            (Paths{"t/{frame}/cam1.png", "t/{frame}/cam2.png"}))
      << "the files number cameras";
  EXPECT_EQ(paths_of(group_streams(in_folders({"frame_1", "frame_2"}, {"1.png", "2.png"}))),
            (Paths{"frame_{frame:01}/1.png", "frame_{frame:01}/2.png"}))
      << "the folders have the word frame";
  EXPECT_EQ(paths_of(group_streams(in_folders({"a/1", "a/2"}, {"left.png", "right.png"}))),
            (Paths{"a/{frame:01}/left.png", "a/{frame:01}/right.png"}))
      << "nothing else counts";
  EXPECT_EQ(paths_of(group_streams({"frames/01/c1_01.json", "frames/01/c2_01.json", "frames/02/c1_02.json",
                                    "frames/02/c2_02.json", "frames/03/c1_03.json", "frames/03/c2_03.json"})),
            (Paths{"frames/{frame:02}/c1_{frame:02}.json", "frames/{frame:02}/c2_{frame:02}.json"}))
      << "the files repeat the number";
}

TEST(FileStreamsReference, FoldersOfCamerasAreNoFrames) {
  const Paths folders{"1", "2", "3"}, frames{"000.png", "001.png"};
  EXPECT_EQ(paths_of(group_streams(in_folders(folders, frames))),
            (Paths{"1/{frame:03}.png", "2/{frame:03}.png", "3/{frame:03}.png"}));
  EXPECT_EQ(paths_of(group_streams(in_folders({"Camera_B1", "Camera_B2", "Camera_B3"}, frames))).front(),
            "Camera_B1/{frame:03}.png");
  EXPECT_EQ(paths_of(group_streams(in_folders(folders, {"000_keypoints.json", "001_keypoints.json"}))).front(),
            "1/{frame:03}_keypoints.json");
  EXPECT_EQ(paths_of(group_streams({"c0/c0_00.json", "c0/c0_01.json", "c1/c1_00.json", "c1/c1_01.json"})),
            (Paths{"c0/c0_{frame:02}.json", "c1/c1_{frame:02}.json"}));
  EXPECT_EQ(paths_of(group_streams(in_folders({"frames/0", "frames/1"}, {"000.png", "001.png", "002.png"}))),
            (Paths{"frames/0/{frame:03}.png", "frames/1/{frame:03}.png"}));
  EXPECT_EQ(paths_of(group_streams(in_folders({"frames/01", "frames/02"}, {"frame_1.png", "frame_2.png"}))).front(),
            "frames/01/frame_{frame:01}.png");
  EXPECT_EQ(paths_of(group_streams(in_folders({"take1", "take2"}, {"cam1.png", "cam2.png"}))).front(),
            "take1/cam{frame:01}.png");
}

TEST(FileStreamsReference, BracesCannotBeNamed) { EXPECT_TRUE(group_streams({"a{b}.mp4"}).empty()); }

TEST(FileStreamsReference, AnyPathsAreTaken) {
  const std::string long_number(400, '9');
  const auto streams =
      group_streams({"", "/", ".jpg", "a/.jpg", long_number + ".jpg", "8" + long_number + ".jpg", "a.jpg/b"});
  for (const FileStream& stream : streams) EXPECT_FALSE(stream.per_frame) << stream.path;
}

}  // namespace
}  // namespace doppel::file_streams_test
