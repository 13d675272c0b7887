#include "doppel/detect/keypoints/person_anchors.h"

#include <gmock/gmock.h>

#include <functional>
#include <random>

#include "detect/keypoints/camera_ring.h"
#include "detect/keypoints/standing_person.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "support/message_of.h"

namespace doppel::person_anchors_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using support::message_of;
using test_keypoints::camera_ring;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Somebody on the floor: where at a row, and whom the detector sees.
struct Actor {
  std::function<Vector3d(double row)> position;
  std::function<bool(double row, int camera)> is_detected = [](double, int) { return true; };

  Vector3d hips(double row) const { return position(row) + Vector3d(0, 0.95, 0); }
};

/// Walks along x at 1.4 m/s, 25 rows each second. @param direction 1 or -1
Actor walker(double direction, double z) {
  return {[=](double row) { return Vector3d(direction * (0.056 * row - 1.7), 0, z); }};
}
Actor stander(const Vector3d& position) {
  return {[=](double) { return position; }};
}

Person detection(const Camera& camera, const Vector3d& position, const PointLayout& layout, std::mt19937& random) {
  std::normal_distribution<double> noise(0.0, 3.0);
  Person person;
  for (const auto& point : test_keypoints::standing_body(layout)) {
    person.emplace_back();
    if (!point) continue;
    const Vector2d pixel = camera.project(position + *point) + Vector2d(noise(random), noise(random));
    person.back() = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 0.8f};
  }
  return person;
}

bool in_image(const Camera& camera, const Vector3d& point) {
  const Vector2d pixel = camera.project(point);
  return camera.camera_from_world(point).z() > 0 && (pixel.array() > 0).all() && pixel.x() < camera.width &&
         pixel.y() < camera.height;
}

/// The people of a detector, whose order changes from image to image. @param cameras those that really film
SeenPeople seen_by(const std::vector<Camera>& cameras, const std::vector<Actor>& actors, int moments, long step = 15) {
  SeenPeople seen{cameras, {}, read_keypoint_map("mediapipe33").layout, step};
  std::mt19937 random(5);
  for (int f = 0; f < moments; ++f) {
    const double row = static_cast<double>(f * step);
    seen.people.emplace_back(cameras.size());
    for (std::size_t c = 0; c < cameras.size(); ++c)
      for (std::size_t i = 0; i < actors.size(); ++i) {
        const Actor& actor = actors[(i + static_cast<std::size_t>(f) + c) % actors.size()];
        if (actor.is_detected(row, static_cast<int>(c)) && in_image(cameras[c], actor.hips(row)))
          seen.people.back()[c].push_back(detection(cameras[c], actor.position(row), seen.layout, random));
      }
  }
  return seen;
}

/// Checks that visible anchors are at the hips of an actor, and hidden ones where the actor cannot be seen.
void expect_anchors(const AnchoredPerson& found, const SeenPeople& seen, const Actor& actor) {
  for (std::size_t c = 0; c < seen.cameras.size(); ++c)
    for (std::size_t f = 0; f < seen.people.size(); ++f) {
      const std::string where = "camera " + std::to_string(c) + ", moment " + std::to_string(f);
      const Vector3d hips = actor.hips(static_cast<double>(static_cast<long>(f) * seen.step));
      const auto& anchor = found.anchors[c][f];
      ASSERT_TRUE(anchor) << where;
      if (!in_image(seen.cameras[c], hips)) {
        EXPECT_FALSE(anchor->visible) << where;
      } else if (anchor->visible) {
        EXPECT_LT((anchor->hips - seen.cameras[c].project(hips)).norm(), 12) << where;
        const double depth = seen.cameras[c].camera_from_world(hips).z();
        EXPECT_LT(anchor->radius, 0.36 * 900 / depth) << where;
        EXPECT_GT(anchor->radius, 0.14 * 900 / depth) << where;
      }
    }
}

PersonChoiceOptions near(const Vector3d& position) {
  PersonChoiceOptions options;
  options.near = position;
  return options;
}

TEST(PersonAnchors, OnePersonNeedsNoChoice) {
  const Actor man = walker(1, 0);
  const SeenPeople seen = seen_by(camera_ring(4), {man}, 5);
  const AnchoredPerson found = anchor_person(seen, {});
  EXPECT_TRUE(found.alone);
  EXPECT_EQ(found.people.size(), 1u);
  EXPECT_EQ(found.person, 0);
  EXPECT_FALSE(found.ambiguous);
  expect_anchors(found, seen, man);
}

TEST(PersonAnchors, PeopleWhoCrossAreNotExchanged) {
  const Actor right = walker(1, 0.3), left = walker(-1, -0.3);
  const SeenPeople seen = seen_by(camera_ring(4), {right, left}, 5);
  for (const Actor& actor : {right, left}) {
    const PersonAtPixel first{2, seen.cameras[2].project(actor.hips(0)) + Vector2d(20, -10)};
    const AnchoredPerson found = anchor_person(seen, {}, first);
    EXPECT_EQ(found.people.size(), 2u);
    EXPECT_FALSE(found.alone);
    EXPECT_TRUE(found.doubtful.empty());
    expect_anchors(found, seen, actor);
  }
}

// In one camera, the network likes another person best, and the person whom the others see is found there too.
TEST(PersonAnchors, TheOrderOfTheDetectionsMeansNothing) {
  const Actor woman = stander({-0.6, 0, 0}), man = stander({0.8, 0, 0.5});
  SeenPeople seen = seen_by(camera_ring(4), {woman, man}, 8);
  const AnchoredPerson hers = anchor_person(seen, near({-1, 1, 0})), his = anchor_person(seen, near({1, 1, 0}));
  EXPECT_NE(hers.person, his.person);
  EXPECT_FALSE(hers.ambiguous) << "she was named";
  expect_anchors(hers, seen, woman);
  expect_anchors(his, seen, man);
  EXPECT_TRUE(anchor_person(seen, {}).ambiguous);
  PersonChoiceOptions second;
  second.person = 5;
  EXPECT_THROW(anchor_person(seen, second), UsageError);
}

TEST(PersonAnchors, WhoIsNotDetectedIsWhereTheOthersSeeThem) {
  Actor woman = stander({-0.6, 0, 0});
  const Actor man = stander({0.8, 0, 0.5});
  woman.is_detected = [](double row, int camera) { return camera != 1 || row > 60; };
  const SeenPeople seen = seen_by(camera_ring(4), {woman, man}, 10);
  const AnchoredPerson found = anchor_person(seen, near({-1, 1, 0}));
  EXPECT_TRUE(found.anchors[1][0]->visible);
  expect_anchors(found, seen, woman);
}

TEST(PersonAnchors, NobodyIsFollowedBehindAnotherOrOutsideOfTheImage) {
  const std::vector<Camera> cameras = camera_ring(4);
  const Vector3d to_camera = (cameras[0].centre() - Vector3d(0, 1.2, 0)).normalized();
  Actor behind = stander({0, 0, 0});
  behind.is_detected = [](double row, int camera) { return camera != 0 || row < 70; };
  const Actor before = stander(1.2 * Vector3d(to_camera.x(), 0, to_camera.z()));
  const SeenPeople hidden = seen_by(cameras, {behind, before}, 10);
  const AnchoredPerson found = anchor_person(hidden, near({0, 1, 0}));
  EXPECT_TRUE(found.anchors[0][2]->visible);
  EXPECT_FALSE(found.anchors[0][8]->visible) << "the other one stands before the camera";
  EXPECT_TRUE(found.anchors[1][8]->visible);

  const Actor away{[](double row) { return Vector3d(0.04 * row, 0, 0); }};
  SeenPeople leaving = seen_by(cameras, {away, stander({-0.7, 0, 0.4})}, 6);
  const AnchoredPerson left = anchor_person(leaving, {}, PersonAtPixel{0, cameras[0].project(away.hips(0))});
  int outside = 0;
  for (const auto& anchors : left.anchors)
    for (const auto& anchor : anchors) outside += anchor && !anchor->visible;
  EXPECT_GT(outside, 0);
  expect_anchors(left, leaving, away);
}

TEST(PersonAnchors, ACameraThatNeverAgreesIsLeftAlone) {
  SeenPeople seen = seen_by(camera_ring(5), {stander({0.3, 0, 0}), stander({-0.8, 0, 0.4})}, 8);
  seen.cameras[3].t.y() += 1.2;
  const AnchoredPerson found = anchor_person(seen, near({0.3, 1, 0}));
  EXPECT_THAT(found.doubtful, ElementsAre(3u));
  for (const auto& anchor : found.anchors[3]) EXPECT_FALSE(anchor);
  EXPECT_TRUE(found.anchors[2][0]);
}

TEST(PersonAnchors, SomebodyInOneCameraAloneIsNotThePerson) {
  Actor passer_by = stander({0.9, 0, 0.9});
  passer_by.is_detected = [](double, int camera) { return camera == 2; };
  const Actor man = walker(1, 0);
  const SeenPeople seen = seen_by(camera_ring(4), {passer_by, man}, 5);
  const AnchoredPerson found = anchor_person(seen, {});
  EXPECT_EQ(found.people.size(), 1u);
  EXPECT_FALSE(found.alone) << "camera 2 must be told whom to follow";
  expect_anchors(found, seen, man);
}

TEST(PersonAnchors, NobodyIsFollowedWhereThePersonIsLostAndAnotherIsSeen) {
  Actor lost = stander({-0.6, 0, 0});
  lost.is_detected = [](double row, int) { return row < 50 || row > 110; };
  const SeenPeople seen = seen_by(camera_ring(4), {lost, stander({0.8, 0, 0.5})}, 12);
  const AnchoredPerson found = anchor_person(seen, near({-1, 1, 0}));
  for (const auto& anchors : found.anchors) {
    EXPECT_TRUE(anchors[2]->visible);
    ASSERT_TRUE(anchors[6]);
    EXPECT_FALSE(anchors[6]->visible);
    EXPECT_TRUE(anchors[10]->visible);
  }
}

TEST(PersonAnchors, SaysWhereNobodyIs) {
  const SeenPeople empty = seen_by(camera_ring(3), {}, 4);
  EXPECT_EQ(anchor_person(empty, {}).person, -1);
  EXPECT_TRUE(anchor_person(empty, {}).alone);
  EXPECT_THAT(message_of<UsageError>([&] { anchor_person(empty, {}, PersonAtPixel{1, {0, 0}}); }), HasSubstr("c1"));
  SeenPeople no_hips = empty;
  no_hips.layout.points = {"nose"};
  EXPECT_THAT(message_of<UsageError>([&] { anchor_person(no_hips, {}); }), HasSubstr("left_hip"));
}

}  // namespace
}  // namespace doppel::person_anchors_test
