#include "doppel/detect/keypoints/joint_detections.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::joint_detections_test {
namespace {

using support::message_of;
using support::replaced;
using ::testing::AllOf;
using ::testing::HasSubstr;

const PointLayout kLayout{"four", {"Nose", "Neck", "RHip", "LHip"}};
constexpr char kTable[] =
    "frame,index,name,x_mm,y_mm,z_mm\n"
    "20,0,Nose,99.6,-765.2,-361.1\n"
    "20,2,RHip,-110,4,20.5\n"
    "20,3,LHip,130,6,-10.5\n"
    "23,2,RHip,-100,0,0\n";

std::map<long, std::vector<JointDetection>> read(const std::string& text) {
  const support::TemporaryFolder folder;
  support::write_bytes(folder / "joints.csv", text);
  return read_joint_detections(folder / "joints.csv", kLayout);
}

std::string refusal(const std::string& from, const std::string& to) {
  return message_of<FileError>([&] { read(replaced(kTable, from, to)); });
}

TEST(JointDetectionsReference, AreMetresByFrameAndPoint) {
  for (const std::string& text : {std::string(kTable), support::with_crlf(kTable)}) {
    const auto frames = read(text);
    ASSERT_EQ(frames.size(), 2u);
    const auto& joints = frames.at(20);
    ASSERT_EQ(joints.size(), 4u);
    EXPECT_TRUE(joints[0].position.isApprox(Eigen::Vector3d(0.0996, -0.7652, -0.3611)));
    EXPECT_TRUE(joints[0].seen && joints[2].seen && joints[3].seen);
    EXPECT_FALSE(joints[1].seen);
    EXPECT_EQ(joints[0].noise, kJointNoise);
    EXPECT_FALSE(frames.at(23)[0].seen);
  }
}

TEST(JointDetectionsReference, OfAnotherDetectorAreFoundByName) {
  // MediaPipe's points 0, 1, 23 and 24; the layout `four` has no eyes, and numbers the others in another way.
  const auto frames = read(
      "frame,index,name,x_mm,y_mm,z_mm\n"
      "20,0,nose,99.6,-765.2,-361.1\n"
      "20,1,left_eye_inner,90,-780,-350\n"
      "20,23,left_hip,130,6,-10.5\n"
      "20,24,right_hip,-110,4,20.5\n");
  const auto& joints = frames.at(20);
  ASSERT_EQ(joints.size(), 4u);
  EXPECT_TRUE(joints[0].position.isApprox(Eigen::Vector3d(0.0996, -0.7652, -0.3611)));
  EXPECT_FALSE(joints[1].seen);
  EXPECT_TRUE(joints[2].position.isApprox(Eigen::Vector3d(-0.11, 0.004, 0.0205)));
  EXPECT_TRUE(joints[3].position.isApprox(Eigen::Vector3d(0.13, 0.006, -0.0105)));
  EXPECT_EQ(joints[0].noise, kBlazePoseJointNoise);
}

TEST(JointDetectionsReference, GoOntoLandmarksLikeKeypoints) {
  KeypointMap map{kLayout, {{"Nose", {0}}, {"MidHip", {2, 3}}, {"Tail", {}}, {"Neck", {1}}}};
  const LandmarkPicker picker(map, {{"MidHip", 0, {}}, {"Tail", 0, {}}, {"Nose", 0, {}}, {"Neck", 0, {}}});
  auto frames = read(kTable);
  for (JointDetection& joint : frames.at(20)) joint.noise = 0.07;
  const std::vector<JointDetection> landmarks = picker.pick(frames.at(20));
  ASSERT_EQ(landmarks.size(), 4u);
  EXPECT_TRUE(landmarks[0].seen);
  EXPECT_TRUE(landmarks[0].position.isApprox(Eigen::Vector3d(0.01, 0.005, 0.005)));
  EXPECT_EQ(landmarks[0].noise, 0.07);
  EXPECT_FALSE(landmarks[1].seen);
  EXPECT_TRUE(landmarks[2].seen);
  EXPECT_FALSE(landmarks[3].seen);
  EXPECT_FALSE(picker.pick(frames.at(23))[0].seen) << "one of the two hips is missing";
}

TEST(JointDetectionsRejects, WhatCannotBe) {
  EXPECT_THAT(refusal("20,2,RHip", "20,2,LHip"), AllOf(HasSubstr("joints.csv:3"), HasSubstr("RHip")));
  EXPECT_THAT(refusal("20,3,LHip", "20,4,LHip"), HasSubstr("index"));
  EXPECT_THAT(refusal("20,3,LHip", "20,2,RHip"), HasSubstr("given twice"));
  EXPECT_THAT(refusal("-110,4", "-11000,4"), HasSubstr("millimetres"));
  EXPECT_THAT(refusal("x_mm", "x_m"), HasSubstr("x_mm"));
  EXPECT_TRUE(read("frame,index,name,x_mm,y_mm,z_mm\n").empty()) << "of a camera that saw nobody";
}

TEST(JointDetectionsRejects, HostileFiles) {
  const support::TemporaryFolder folder;
  support::expect_survives_hostile_files(folder / "joints.csv", kTable, [](const auto& path) {
    for (const auto& [frame, joints] : read_joint_detections(path, kLayout))
      for (const JointDetection& joint : joints) EXPECT_TRUE(joint.position.allFinite()) << frame;
  });
}

class RealJointDetections : public support::SharedFolderTest {};

TEST_F(RealJointDetections, OfTheWildClipHaveTheSizeOfAMan) {
  const PointLayout layout = read_keypoint_map("body25").layout;
  const auto frames = read_joint_detections(capture_folder() / "wild/joints3d.csv", layout);
  EXPECT_EQ(frames.size(), 60u);
  EXPECT_EQ(frames.begin()->first, 20);
  for (const auto& [frame, joints] : frames) {
    EXPECT_TRUE(joints[0].seen && joints[8].seen && joints[11].seen) << frame;
    EXPECT_EQ(joints[8].position.norm(), 0.0) << "MidHip is the root";
    const double height = (joints[0].position - 0.5 * (joints[11].position + joints[14].position)).norm();
    EXPECT_GT(height, 1.2) << frame;
    EXPECT_LT(height, 1.9) << frame;
  }
}

}  // namespace
}  // namespace doppel::joint_detections_test
