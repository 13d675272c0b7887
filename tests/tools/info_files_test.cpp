// What `doppel info` says of the files that Doppel reads, and of those that it does not.
#include "info_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "doppel/core/npy.h"
#include "run_program.h"
#include "support/gltf_writer.h"
#include "support/hostile_files.h"
#include "support/scan_files.h"
#include "support/temporary_folder.h"

namespace doppel::info_files_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tools::Outcome;
using tools::run;
using Json = nlohmann::json;

class InfoFiles : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void write(const std::string& name, const std::string& content) { support::write_bytes(folder_ / name, content); }
  Json info(const std::string& name) {
    const Outcome found = run("info '" + path(name) + "' --json");
    EXPECT_EQ(found.code, 0) << name << ": " << found.err;
    if (found.code != 0) return Json::object();
    // For people, without --json, there are the same lines.
    EXPECT_THAT(run("info '" + path(name) + "'").out, HasSubstr("kind: "));
    return Json::parse(found.out);
  }
  support::TemporaryFolder folder_;
};

TEST_F(InfoFiles, AScanAndAFigure) {
  write("scan.ply", support::PlyWriter(support::coloured_box({0, 0, 0}, {1, 2, 3}), support::PlyForm::text).file());
  Json scan = info("scan.ply");
  EXPECT_EQ(scan["kind"], "scan");
  EXPECT_EQ(scan["triangles"], 12);
  EXPECT_EQ(scan["size_in_file"], Json({1.0, 2.0, 3.0}));
  EXPECT_EQ(scan["joints"], 0);
  EXPECT_THAT(scan["read_by"].get<std::string>(), HasSubstr("character create"));
  support::bending_arm().write(folder_ / "figure.glb");
  const Json figure = info("figure.glb");
  EXPECT_EQ(figure["kind"], "rigged figure");
  EXPECT_EQ(figure["joint_names"], Json({"upper", "lower"}));
  EXPECT_EQ(figure["metres_per_unit"], 1.0);
  EXPECT_EQ(figure["up"], "y");
  EXPECT_TRUE(figure["animations"].contains("bend"));
  EXPECT_THAT(figure["read_by"].get<std::string>(), AllOf(HasSubstr("character import"), HasSubstr("--motion")));
}

TEST_F(InfoFiles, AnObjWithSeveralTexturesIsAScan) {
  cv::imwrite(path("a.png"), cv::Mat(4, 4, CV_8UC3, cv::Scalar(0, 0, 255)));
  cv::imwrite(path("b.png"), cv::Mat(4, 4, CV_8UC3, cv::Scalar(255, 0, 0)));
  write("scan.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\n");
  write("scan.obj",
        "mtllib scan.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nusemtl a\n"
        "f 1/1 2/2 3/3\nusemtl b\nf 2/2 4/4 3/3\n");
  const Json scan = info("scan.obj");
  EXPECT_EQ(scan["kind"], "scan");
  EXPECT_EQ(scan["materials"], Json({{"a", "texture 4x4"}, {"b", "texture 4x4"}}));
}

TEST_F(InfoFiles, AMotionAndMarkers) {
  write("dance.bvh",
        "HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation "
        "Yrotation\n  JOINT Chest\n  {\n    OFFSET 0 100 0\n    CHANNELS 3 Zrotation Xrotation Yrotation\n    End "
        "Site\n    {\n      OFFSET 0 50 0\n    }\n  }\n}\nMOTION\nFrames: 2\nFrame Time: 0.02\n0 0 0 0 0 0 0 0 0\n"
        "0 0 0 0 0 0 0 0 0\n");
  const Json motion = info("dance.bvh");
  EXPECT_EQ(motion["kind"], "motion");
  EXPECT_EQ(motion["frames"], 2);
  EXPECT_EQ(motion["frames_per_second"], 50.0);
  EXPECT_EQ(motion["joint_names"], Json({"Hips", "Chest"}));
  write("take.trc",
        "PathFileType\t4\t(X/Y/Z)\ttake.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
        "OrigDataStartFrame\tOrigNumFrames\n60\t60\t2\t2\tm\t60\t1\t2\nFrame#\tTime\tHip\t\t\tKnee\t\t\n"
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0\t0\t1\t0\t0\t0.5\t0\n2\t0.016\t0\t1\t0\t\t\t\n");
  const Json markers = info("take.trc");
  EXPECT_EQ(markers["format"], "trc");
  EXPECT_EQ(markers["point_names"], Json({"Hip", "Knee"}));
  EXPECT_EQ(markers["frames"], 2);
  EXPECT_EQ(markers["seen_percent"], 75.0);
}

TEST_F(InfoFiles, AVideoAndImages) {
  cv::VideoWriter video(path("cam0.avi"), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {64, 48});
  for (int i = 0; i < 5; ++i) video.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(40 * i)));
  video.release();
  const Json clip = info("cam0.avi");
  EXPECT_EQ(clip["kind"], "video");
  EXPECT_EQ(clip["width"], 64);
  EXPECT_EQ(clip["frames"], 5);
  EXPECT_EQ(clip["frames_per_second"], 25.0);
  cv::Mat mask(8, 8, CV_8UC1, cv::Scalar(0));
  mask.rowRange(0, 4).setTo(255);
  cv::imwrite(path("mask.png"), mask);
  const Json image = info("mask.png");
  EXPECT_EQ(image["kind"], "image");
  EXPECT_EQ(image["channels"], "grey");
  EXPECT_EQ(image["values"], Json({0, 255}));
}

TEST_F(InfoFiles, KeypointsAndJoints) {
  write("cam0.csv", "frame,name,x,y,confidence\n0,nose,10,20,0.9\n0,left_knee,12,80,0.8\n1,nose,11,20,0.9\n");
  const Json table = info("cam0.csv");
  EXPECT_EQ(table["kind"], "keypoints");
  EXPECT_EQ(table["images"], 2);
  EXPECT_EQ(table["point_names"].size(), 2u);
  std::string numbers;
  for (int i = 0; i < 75; ++i) numbers += fmt::format("{}{}", i > 0 ? "," : "", i % 3 == 2 ? 1 : 100 + i);
  write("f_000000000000_keypoints.json", "{\"version\":1.3,\"people\":[{\"pose_keypoints_2d\":[" + numbers + "]}]}");
  const Json people = info("f_000000000000_keypoints.json");
  EXPECT_EQ(people["kind"], "keypoints");
  EXPECT_EQ(people["format"], "openpose");
  EXPECT_EQ(people["points"], 25);
  write("joints.csv", "frame,index,name,x_mm,y_mm,z_mm\n0,0,nose,1,2,3\n");
  EXPECT_EQ(info("joints.csv")["kind"], "joints in space");
  const std::vector<double> values(2 * 3 * 4 * 3, 1.0);
  write("freemocap.npy", npy_bytes(values.data(), "<f8", {2, 3, 4, 3}));
  EXPECT_EQ(info("freemocap.npy")["format"], "freemocap");
}

TEST_F(InfoFiles, OtherFilesAreToldWhatIsDescribed) {
  write("notes.docx", "words");
  write("any.json", "{\"a\": 1}");
  write("any.yml", "a: 1\n");
  for (const char* name : {"notes.docx", "any.yml"}) {
    const Outcome refused = run("info '" + path(name) + "'");
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err,
                AllOf(HasSubstr(name), HasSubstr("scans and rigged figures (.glb"), HasSubstr("docs/calibration.md")));
  }
  const Outcome table = run("info '" + path("any.json") + "'");
  EXPECT_EQ(table.code, 1);
  EXPECT_THAT(table.err,
              AllOf(HasSubstr("docs/calibration.md"), HasSubstr("As keypoints: "), HasSubstr("As points in space: ")));
  // A file of a known kind that cannot be read says why.
  write("broken.glb", "glTF....");
  EXPECT_THAT(run("info '" + path("broken.glb") + "'").err, HasSubstr("JSON"));
}

TEST_F(InfoFiles, AFolderNamesItsFiles) {
  write("take.trc", "");
  write("notes.docx", "");
  const Outcome refused = run("info '" + folder_.path().string() + "'");
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("such as take.trc"), ::testing::Not(HasSubstr("notes.docx"))));
}

TEST(Commands, AMisspeltOneNamesTheNearest) {
  const Outcome command = run("chraracter import a.glb");
  EXPECT_EQ(command.code, 2);
  EXPECT_THAT(command.err, AllOf(HasSubstr("`doppel chraracter`"), HasSubstr("did you mean character?")));
  EXPECT_THAT(run("character imprt a.glb --out b").err,
              AllOf(HasSubstr("`doppel character imprt`"), HasSubstr("did you mean import?")));
  EXPECT_THAT(run("xyzzy").err, AllOf(HasSubstr("there is no such command"), HasSubstr("doppel --help")));
  EXPECT_EQ(run("--help").code, 0);
  EXPECT_EQ(run("").code, 2);
}

TEST(CaptureInit, AnEmptyFolderMissesVideosToo) {
  const support::TemporaryFolder folder;
  const Outcome empty = run("capture init '" + folder.path().string() + "'");
  EXPECT_EQ(empty.code, 1);
  EXPECT_THAT(empty.out, AllOf(HasSubstr("missing: no calibration"), HasSubstr("missing: no videos and no images")));
  cv::imwrite((folder / "cam0.png").string(), cv::Mat(4, 4, CV_8UC3));
  EXPECT_THAT(run("capture init '" + folder.path().string() + "'").out,
              ::testing::Not(HasSubstr("no videos and no images")));
}

}  // namespace
}  // namespace doppel::info_files_test
