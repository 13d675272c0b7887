#include "doppel/detect/keypoints/person_choice.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "detect/keypoints/camera_ring.h"
#include "detect/keypoints/standing_person.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "support/message_of.h"

namespace doppel::person_choice_test {
namespace {

using Eigen::Vector3d;
using support::message_of;
using test_keypoints::camera_ring;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A person of the scene: where in a frame, and in which cameras.
struct Actor {
  std::function<Vector3d(int frame)> position;
  std::function<bool(int frame, int camera)> is_detected = [](int, int) { return true; };
  std::function<bool(int frame, int camera)> is_swapped = [](int, int) { return false; };
};

/// Detections of a scene, and which of them show which actor.
class Scene {
 public:
  Scene(std::vector<Camera> cameras, const std::vector<Actor>& actors, int frames, const char* layout = "body25")
      : cameras_(std::move(cameras)), layout_(read_keypoint_map(layout).layout) {
    for (int f = 0; f < frames; ++f) {
      frames_.emplace_back(cameras_.size());
      index_.emplace_back(actors.size(), std::vector<int>(cameras_.size(), -1));
      for (std::size_t c = 0; c < cameras_.size(); ++c)
        for (std::size_t i = 0; i < actors.size(); ++i) {
          const std::size_t a = (i + static_cast<std::size_t>(f) + c) % actors.size();  // the order means nothing
          const int camera = static_cast<int>(c);
          if (!actors[a].is_detected(f, camera)) continue;
          index_.back()[a][c] = static_cast<int>(frames_.back()[c].size());
          frames_.back()[c].push_back(
              detected(cameras_[c], actors[a].position(f), 0.4 * f, actors[a].is_swapped(f, camera)));
        }
    }
  }

  PersonChoice follow(const PersonChoiceOptions& options = {}) const {
    return follow_people(frames_, cameras_, layout_, options);
  }
  /// Detections chosen of another person, and views in which the actor was detected and not chosen.
  struct Faults {
    int wrong = 0, missed = 0;
  };
  Faults faults(const PersonChoice& choice, std::size_t actor, int except_camera = -1) const {
    Faults faults;
    for (std::size_t f = 0; f < frames_.size(); ++f)
      for (std::size_t c = 0; c < cameras_.size(); ++c) {
        if (static_cast<int>(c) == except_camera) continue;
        const int found = choice.chosen.at(f).at(c), ground_truth = index_[f][actor][c];
        faults.wrong += found >= 0 && found != ground_truth;
        faults.missed += ground_truth >= 0 && found != ground_truth;
      }
    return faults;
  }
  std::vector<std::vector<People>>& frames() { return frames_; }
  std::vector<Camera>& cameras() { return cameras_; }

 private:
  Person detected(const Camera& camera, const Vector3d& position, double heading, bool swapped) {
    const Eigen::AngleAxisd turn(heading, Vector3d::UnitY());
    const auto body = test_keypoints::standing_body(layout_);
    const std::vector<int> mirrored = mirrored_indices(layout_.points);
    Person person(body.size());
    std::normal_distribution<double> noise(0.0, 2.0);
    for (std::size_t i = 0; i < body.size(); ++i) {
      const auto& point = body[swapped ? static_cast<std::size_t>(mirrored[i]) : i];
      if (!point) continue;
      const Eigen::Vector2d pixel = camera.project(position + turn * *point);
      const bool inside = pixel.x() > 0 && pixel.x() < camera.width && pixel.y() > 0 && pixel.y() < camera.height;
      if (inside)
        person[i] = {static_cast<float>(pixel.x() + noise(random_)), static_cast<float>(pixel.y() + noise(random_)),
                     0.8f};
    }
    return person;
  }

  std::vector<Camera> cameras_;
  PointLayout layout_;
  std::mt19937 random_{7};
  std::vector<std::vector<People>> frames_;
  std::vector<std::vector<std::vector<int>>> index_;  ///< [F][actors][C]
};

/// Walks on a circle in the middle of the ring.
Actor man() {
  Actor actor;
  actor.position = [](int f) { return Vector3d(0.5 * std::sin(0.1 * f), 0, 0.5 * std::cos(0.1 * f)); };
  return actor;
}
/// Walks past in the background, before the cameras `first` and `first + 1`.
Actor passer_by(int first, const Vector3d& from, const Vector3d& step) {
  Actor actor;
  actor.position = [=](int f) { return from + f * step; };
  actor.is_detected = [=](int, int camera) { return camera == first || camera == first + 1; };
  return actor;
}

TEST(PersonChoice, FollowsTheManAndNotPeopleInTheBackground) {
  const Scene scene(camera_ring(6),
                    {passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0}), man(), passer_by(3, {-2, 0, 1}, {0, 0, 0.03})}, 40);
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 1).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 1).missed, 0);
  ASSERT_EQ(choice.person, 0);
  EXPECT_FALSE(choice.ambiguous);
  EXPECT_EQ(choice.people[0].frames, 1.0);
  EXPECT_EQ(choice.people[0].views, 6.0);
  EXPECT_LT(choice.people[0].residual, 0.005);
  EXPECT_GT(choice.people[0].residual, 0.001) << "the noise of the points is 2 pixels of 1000";
  for (const double share : choice.cameras) EXPECT_EQ(share, 1.0);
  EXPECT_THAT(choice.doubts(camera_ring(6)), IsEmpty());
}

TEST(PersonChoice, SurvivesDropoutsAndACameraThatIsWrong) {
  Actor actor = man();
  actor.is_detected = [](int f, int c) { return (7 * f + 3 * c) % 5 != 0; };
  Scene scene(camera_ring(6),
              {actor, passer_by(1, {-1.5, 0, -2}, {0.05, 0, 0}), passer_by(4, {-2, 0, 1}, {0, 0, 0.03})}, 40);
  scene.cameras()[3].t.x() += 0.8;
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0, 3).missed, 0);
  EXPECT_LT(choice.cameras[3], 0.02);
  ASSERT_EQ(choice.doubts(scene.cameras()).size(), 1u);
  EXPECT_THAT(choice.doubts(scene.cameras())[0], AllOf(HasSubstr("camera c3"), HasSubstr("calibration")));
}

TEST(PersonChoice, KeepsDetectionsWhoseSidesAreSwapped) {
  Actor actor = man();
  actor.is_swapped = [](int f, int c) { return (c == 1 || c == 4) && f % 3 != 0; };
  const Scene scene(camera_ring(6), {actor, passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 30);
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0).missed, 0);
  EXPECT_LT(choice.people[0].residual, 0.005);
}

TEST(PersonChoice, ToleratesPointsThatAreWrong) {
  Scene scene(camera_ring(5), {man(), passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 20);
  std::mt19937 random(3);
  for (auto& cameras : scene.frames())
    for (People& people : cameras)
      for (Person& person : people)
        for (Keypoint& point : person)
          if (random() % 6 == 0)
            point = {static_cast<float>(random() % 1200), static_cast<float>(random() % 1000), 0.9f};
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0).missed, 0);
}

TEST(PersonChoice, GoesOnWhereOneCameraIsLeft) {
  Actor actor = man();
  actor.is_detected = [](int f, int c) { return f < 10 || f > 14 || c == 2; };
  const Scene scene(camera_ring(4), {actor, passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 25);
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0).missed, 0);
  EXPECT_NEAR(choice.people[0].frames, 20.0 / 25.0, 1e-9);
  PersonChoiceOptions options;
  options.longest_gap = 4;
  EXPECT_EQ(scene.faults(scene.follow(options), 0).missed, 5);
}

TEST(PersonChoice, FindsHimAgainAfterALongPause) {
  Actor actor = man();
  actor.position = [](int f) { return f < 20 ? Vector3d(-1.5, 0, 0) : Vector3d(1.5, 0, 0); };
  actor.is_detected = [](int f, int) { return f < 10 || f >= 40; };
  const Scene scene(camera_ring(4), {actor, passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 50);
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0).missed, 0);
}

TEST(PersonChoice, AsksWhichOfTwoThatAgreeEquallyWell) {
  Actor left, right;
  left.position = [](int) { return Vector3d(-0.8, 0, 0); };
  right.position = [](int f) { return Vector3d(0.8, 0, 0.01 * f); };
  const Scene scene(camera_ring(5), {left, right, passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 20);
  const PersonChoice choice = scene.follow();
  EXPECT_TRUE(choice.ambiguous);
  ASSERT_GE(choice.people.size(), 2u);
  EXPECT_NEAR(std::abs(choice.people[1].position.x()), 0.8, 0.1);
  ASSERT_EQ(choice.doubts(camera_ring(5)).size(), 1u);
  EXPECT_THAT(choice.doubts(camera_ring(5))[0], AllOf(HasSubstr("person 1 near"), HasSubstr("set `person`")));
  PersonChoiceOptions options;
  for (const std::size_t actor : {0u, 1u}) {
    options = {};
    options.near = Vector3d(actor == 0 ? -1 : 1, 1, 0);
    const PersonChoice near = scene.follow(options);
    EXPECT_EQ(scene.faults(near, actor).wrong, 0);
    EXPECT_EQ(scene.faults(near, actor).missed, 0);
    EXPECT_FALSE(near.ambiguous);
    options = {};
    options.person = near.person;
    EXPECT_EQ(scene.follow(options).chosen, near.chosen);
  }
  options.person = 9;
  EXPECT_THAT(message_of<UsageError>([&] { scene.follow(options); }),
              AllOf(HasSubstr("person 9"), HasSubstr("people")));
  options.near = Vector3d::Zero();
  EXPECT_THROW(scene.follow(options), UsageError);
}

TEST(PersonChoice, KeepsPeopleApartWhoCross) {
  Actor first, second;
  first.position = [](int f) { return Vector3d(-1.0 + 0.05 * f, 0, 0.25); };
  second.position = [](int f) { return Vector3d(1.0 - 0.05 * f, 0, -0.25); };
  const Scene scene(camera_ring(5), {first, second}, 40);
  PersonChoiceOptions options;
  std::vector<bool> is_first;
  for (const int person : {0, 1}) {
    options.person = person;
    const PersonChoice choice = scene.follow(options);
    const Scene::Faults one = scene.faults(choice, 0), other = scene.faults(choice, 1);
    EXPECT_EQ(std::min(one.wrong, other.wrong), 0);
    EXPECT_EQ(std::min(one.missed, other.missed), 0);
    is_first.push_back(one.wrong == 0);
  }
  EXPECT_NE(is_first[0], is_first[1]);
}

TEST(PersonChoice, FindsNobodyWhereNoCamerasAgree) {
  const PersonChoice none = follow_people({{{}, {}}, {{}, {}}}, camera_ring(2), read_keypoint_map("body25").layout);
  EXPECT_EQ(none.person, -1);
  EXPECT_EQ(none.chosen, std::vector<std::vector<int>>(2, {-1, -1}));
  ASSERT_EQ(none.doubts(camera_ring(2)).size(), 1u);
  EXPECT_THAT(none.doubts(camera_ring(2))[0], HasSubstr("no two cameras agree"));
  Actor alone = man();
  alone.is_detected = [](int, int camera) { return camera == 0; };
  EXPECT_EQ(Scene(camera_ring(3), {alone}, 5).follow().person, -1);
  EXPECT_TRUE(follow_people({}, camera_ring(2), read_keypoint_map("body25").layout).chosen.empty());
}

TEST(PersonChoice, WorksWithManyCameras) {
  const Scene scene(camera_ring(24), {man(), passer_by(0, {-1.5, 0, -2}, {0.05, 0, 0})}, 3, "coco17");
  const PersonChoice choice = scene.follow();
  EXPECT_EQ(scene.faults(choice, 0).wrong, 0);
  EXPECT_EQ(scene.faults(choice, 0).missed, 0);
}

TEST(PersonChoice, RefusesWhatCannotBe) {
  const PointLayout layout = read_keypoint_map("body25").layout;
  EXPECT_THROW(follow_people({{{}}}, camera_ring(2), layout), Error);
  EXPECT_THAT(message_of<Error>([&] {
                follow_people({{{Person(17)}, {}}}, camera_ring(2), layout);
              }),
              AllOf(HasSubstr("17 points"), HasSubstr("25")));
  std::vector<Camera> cameras = camera_ring(2);
  cameras[1].height = 0;
  EXPECT_THAT(message_of<Error>([&] { follow_people({}, cameras, layout); }), HasSubstr("c1"));
}

}  // namespace
}  // namespace doppel::person_choice_test
