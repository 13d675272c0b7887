#include <gmock/gmock.h>

#include "detect_camera.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "run_program.h"

namespace doppel::tools::detect_points_test {
namespace {

using ::testing::HasSubstr;

TEST(DetectedPoints, HaveTheLayoutsOfTheMaps) {
  for (const PersonPoints points : {PersonPoints::body, PersonPoints::body_hands, PersonPoints::body_face_hands}) {
    const PointLayout layout = mediapipe_layout(points);
    EXPECT_EQ(layout.points, read_keypoint_map(layout.name).layout.points);
  }
}

TEST(DetectedPoints, OfAPersonAreInTheOrderOfTheLayout) {
  BodyPose pose{};
  for (BodyLandmark& landmark : pose.landmarks) landmark = {1, 2, 0, 0.5, 1};
  FacePose face;
  for (std::size_t i = 0; i < face.points.size(); ++i) face.points[i] << static_cast<double>(i), 7, 0;
  face.score = 0.8;
  HandPair hands;
  hands[1].emplace();
  hands[1]->points.fill({3, 4, 0});
  hands[1]->score = 0.6;
  const PointLayout layout = mediapipe_layout(PersonPoints::body_face_hands);
  const auto point = [&](const Person& person, const char* name) {
    EXPECT_EQ(person.size(), layout.points.size());
    return person.at(static_cast<std::size_t>(layout.find(name).value()));
  };
  const Person person = person_of_pose(pose, face, hands);
  EXPECT_EQ(point(person, "right_foot_index").x, 1.0f);
  EXPECT_EQ(point(person, "face_mesh_0").x, 0.0f);
  EXPECT_EQ(point(person, "face_mesh_467").x, 467.0f);
  EXPECT_FLOAT_EQ(point(person, "face_mesh_467").confidence, 0.4f);
  EXPECT_EQ(point(person, "left_hand_root").confidence, 0.0f);
  EXPECT_EQ(point(person, "right_pinky_finger4").y, 4.0f);
  EXPECT_EQ(point(person_of_pose(pose, std::nullopt, hands), "face_mesh_4").confidence, 0.0f);
}

TEST(DetectedPoints, OfTheFaceNeedHandsAndBlazePose) {
  EXPECT_THAT(complaint_about("detect film.mp4 --out found --face --no-hands"), HasSubstr("leave out --no-hands"));
  EXPECT_THAT(complaint_about("detect film.mp4 --out found --face --network a.onnx"),
              HasSubstr("--hands and --face belong to BlazePose"));
}

}  // namespace
}  // namespace doppel::tools::detect_points_test
