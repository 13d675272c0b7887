#include "doppel/actor/export/film.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "doppel/core/error.h"
#include "doppel/layers/surface.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::film_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;

const Character& actor() {
  static const Character character = [] {
    Character made = make_test_character();
    made.mesh.texture = cv::Mat(32, 32, CV_8UC3, cv::Scalar(20, 60, 200));  // BGR: orange
    return made;
  }();
  return character;
}

std::vector<float> rest_vertices() {
  std::vector<float> values;
  for (const Eigen::Vector3d& v : actor().mesh.vertices)
    for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(v[i]));
  return values;
}

Eigen::Vector3d middle() {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : actor().mesh.vertices) sum += v / actor().num_vertices();
  return sum;
}

/// Looks along -z at the actor's middle, from `distance` in front.
Camera front_camera(double distance = 4.0, int width = 60, int height = 80) {
  Camera camera;
  camera.name = "front";
  camera.width = width;
  camera.height = height;
  camera.K << 1.2 * height, 0, 0.5 * width, 0, 1.2 * height, 0.5 * height, 0, 0, 1;
  camera.R = Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.t = -camera.R * (middle() + Eigen::Vector3d(0, 0, distance));
  return camera;
}

cv::Mat film(std::unique_ptr<CameraPath> path, FilmOptions options) {
  const TemporaryFolder folder;
  options.video = false;
  options.images = true;
  const std::string name = path->name();
  const auto writer = make_film_writer(folder.path(), actor(), std::move(path), options);
  writer->write({rest_vertices(), torch::zeros({1, actor().num_dofs()})});
  writer->close();
  return cv::imread((folder / (name + "_000000.png")).string());
}

TEST(FilmReference, FlatLightShowsTheTextureOverTheBackdropPixelByPixel) {
  FilmOptions options;
  options.light = Light::flat;
  options.backdrop.image = cv::Mat(160, 120, CV_8UC3);
  for (int y = 0; y < 160; ++y)
    for (int x = 0; x < 120; ++x) options.backdrop.image.at<cv::Vec3b>(y, x) = cv::Vec3b(uchar(x), uchar(y), 7);
  const cv::Mat image = film(make_calibrated_path({front_camera()}, "front", 0), options);
  ASSERT_EQ(image.size(), cv::Size(60, 80));
  const Eigen::Vector2d at = front_camera().project(middle());
  const cv::Vec3b centre = image.at<cv::Vec3b>(static_cast<int>(at.y()), static_cast<int>(at.x()));
  EXPECT_LE(std::abs(centre[0] - 20) + std::abs(centre[1] - 60) + std::abs(centre[2] - 200), 3);
  const cv::Vec3b corner = image.at<cv::Vec3b>(70, 3);  // the mean of pixels 140, 141 and 6, 7 of the backdrop
  EXPECT_LE(std::abs(corner[0] - 6.5) + std::abs(corner[1] - 140.5) + std::abs(corner[2] - 7), 2.5);
}

TEST(FilmReference, ADynamicTextureIsMadeForTheFramesPoseAndCamera) {
  // Its red tells the camera's focal length, its green the first DoF.
  const TemporaryFolder folder;
  CharacterSurface surface(actor());
  ActorDescription description;
  description.past_frames = 0;
  for (const Dof& dof : actor().skeleton.dofs) description.dof_names.push_back(dof.name);
  description.num_vertices = actor().num_vertices();
  description.texture_size = 16;
  const auto texture = [](const torch::Tensor& window, const torch::Tensor& projection, const torch::Tensor&) {
    const torch::Tensor red = projection.select(1, 0).select(1, 0).abs() / 1000;
    const torch::Tensor green = 0.5 + window.select(1, 0).select(1, 0);
    return torch::stack({red, green, 0 * red}, 1).view({-1, 1, 1, 3}).expand({-1, 16, 16, 3});
  };
  write_actor(folder / "actor.pt", actor(), description,
              {[&](const torch::Tensor& window) { return surface->skinned(window.select(1, 0)); }, texture}, {});
  const ActorFile file = ActorFile::load(folder / "actor.pt");
  FilmOptions options;
  options.texture = [&](const auto& window, const auto& projection, const auto& vertices) {
    return file.texture(window, projection, vertices);
  };
  options.light = Light::soft;  // of no effect on it
  const cv::Mat image = film(make_calibrated_path({front_camera()}, "front", 0), options);
  const Eigen::Vector2d at = front_camera().project(middle());
  const cv::Vec3b centre = image.at<cv::Vec3b>(static_cast<int>(at.y()), static_cast<int>(at.x()));
  EXPECT_NEAR(centre[2], 255 * 1.2 * 80 / 1000, 1);
  EXPECT_NEAR(centre[1], 127.5, 1);
  EXPECT_EQ(centre[0], 0);
}

TEST(FilmReference, SoftLightComesFromTheRightOfTheCamera) {
  FilmOptions options;
  options.backdrop.colour = {0, 0, 0};
  const Camera camera = front_camera(4.0, 240, 320);
  const cv::Mat image = film(make_calibrated_path({camera}, "front", 0), options);
  const int y = static_cast<int>(camera.project(middle()).y());
  int left = 0, right = image.cols - 1;
  while (image.at<cv::Vec3b>(y, left)[2] == 0) ++left;
  while (image.at<cv::Vec3b>(y, right)[2] == 0) --right;
  ASSERT_GT(right, left + 4);
  // Not the outermost pixels: they are half backdrop.
  EXPECT_GT(image.at<cv::Vec3b>(y, right - 1)[2], 1.1 * image.at<cv::Vec3b>(y, left + 1)[2]);
}

TEST(FilmReference, TheOrbitComesRoundAndKeepsTheActorInTheMiddle) {
  OrbitOptions options;
  options.turns_per_second = 0.25;
  const auto path = make_orbit(actor(), options);
  const std::vector<float> vertices = rest_vertices();
  const Camera first = path->at(0, vertices);
  EXPECT_TRUE(first.faults().empty());
  EXPECT_GT(first.centre().z(), middle().z() + 1.0);
  for (int frame = 1; frame <= 100; ++frame) {
    const Camera camera = path->at(frame, vertices);
    EXPECT_LT((camera.project(middle()) - Eigen::Vector2d(256, 256)).norm(), 1e-3);
    if (frame == 50) {
      EXPECT_LT(camera.centre().z(), middle().z() - 1.0);
    }
    if (frame == 100) {
      EXPECT_LT((camera.centre() - first.centre()).norm(), 1e-6);
    }
  }
}

TEST(FilmReference, AMovingCameraMovesAndThenStays) {
  Camera a = front_camera(), b = front_camera(5.0), other = front_camera(6.0);
  a.name = "crane@0";
  b.name = "crane@1";
  const auto path = make_calibrated_path({other, a, b}, "crane", 160);
  EXPECT_EQ(path->name(), "camera_crane");
  EXPECT_EQ(path->height(), 160);
  EXPECT_EQ(path->width(), 120);
  EXPECT_LT((path->at(0, {}).centre() - a.centre()).norm(), 1e-9);
  EXPECT_LT((path->at(1, {}).centre() - b.centre()).norm(), 1e-9);
  EXPECT_LT((path->at(9, {}).centre() - b.centre()).norm(), 1e-9);
  EXPECT_NEAR(path->at(0, {}).K(0, 0), 2 * a.K(0, 0), 1e-9);
  const auto slow = make_calibrated_path({a, b}, "crane", 160, 0.25);
  EXPECT_LT((slow->at(1, {}).centre() - a.centre()).norm(), 1e-9);
  EXPECT_LT((slow->at(3, {}).centre() - b.centre()).norm(), 1e-9);
}

TEST(FilmReference, AVideoIsWholeOrNotThere) {
  const TemporaryFolder folder;
  FilmOptions options;
  const auto start = [&] {
    return make_film_writer(folder.path(), actor(), make_calibrated_path({front_camera()}, "front", 0), options);
  };
  const auto video = folder / "camera_front.mp4";
  start()->write({rest_vertices(), {}});
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  const auto writer = start();
  for (int i = 0; i < 5; ++i) writer->write({rest_vertices(), {}});
  writer->close();
  cv::VideoCapture capture(video.string());
  int frames = 0;
  for (cv::Mat frame; capture.read(frame); ++frames) EXPECT_EQ(frame.size(), cv::Size(60, 80));
  EXPECT_EQ(frames, 5);
}

TEST(FilmReference, AnImageBesideTheFrameHasItsHeight) {
  FilmOptions options;
  options.light = Light::flat;
  options.beside = [](int frame) { return cv::Mat(40, 20, CV_8UC3, cv::Scalar(10 + frame, 90, 250)); };
  const cv::Mat both = film(make_calibrated_path({front_camera()}, "front", 0), options);
  FilmOptions nothing_beside = options;
  nothing_beside.beside = nullptr;
  const cv::Mat alone = film(make_calibrated_path({front_camera()}, "front", 0), nothing_beside);
  ASSERT_EQ(both.size(), cv::Size(60 + 40, 80));
  EXPECT_EQ(cv::norm(both.colRange(40, 100), alone, cv::NORM_INF), 0.0);
  EXPECT_EQ(both.at<cv::Vec3b>(40, 20), cv::Vec3b(10, 90, 250));

  const TemporaryFolder folder;
  const auto writer =
      make_film_writer(folder.path(), actor(), make_calibrated_path({front_camera()}, "front", 0), options);
  for (int i = 0; i < 3; ++i) writer->write({rest_vertices(), {}});
  writer->close();
  cv::VideoCapture video((folder / "camera_front.mp4").string());
  cv::Mat frame;
  ASSERT_TRUE(video.read(frame));
  EXPECT_EQ(frame.size(), cv::Size(100, 80));
}

TEST(WindingNumberReference, InsideAndOutside) {
  const std::vector<float> vertices = rest_vertices();
  const auto at = [&](const Eigen::Vector3d& p) { return winding_number(actor().mesh, vertices, p); };
  EXPECT_NEAR(at(middle() + Eigen::Vector3d(2, 0, 0)), 0.0, 1e-9);
  const Eigen::Vector3d joint =
      actor().skeleton.pose(actor().rest_dofs)[test_character::segment_joint(2)].translation();
  EXPECT_NEAR(std::abs(at(joint)), 1.0, 1e-9);
}

TEST(FilmRejects, ACameraInsideTheActor) {
  const TemporaryFolder folder;
  Camera camera = front_camera();
  const Eigen::Vector3d joint =
      actor().skeleton.pose(actor().rest_dofs)[test_character::segment_joint(2)].translation();
  camera.t = -camera.R * joint;
  const auto writer =
      make_film_writer(folder.path(), actor(), make_calibrated_path({camera}, "front", 0), FilmOptions{});
  EXPECT_THAT(message_of<Error>([&] {
                writer->write({rest_vertices(), {}});
              }),
              AllOf(HasSubstr("front"), HasSubstr("frame 0"), HasSubstr("inside the actor")));
}

TEST(FilmRejects, CamerasBackdropsAndColoursThatDoNotFit) {
  EXPECT_THAT(message_of<UsageError>([&] { make_calibrated_path({front_camera()}, "fromt", 0); }),
              AllOf(HasSubstr("'fromt'"), HasSubstr("did you mean front")));
  Backdrop backdrop;
  backdrop.image = cv::Mat(100, 100, CV_8UC3, cv::Scalar(1, 2, 3));
  backdrop.name = "wall.png";
  EXPECT_THAT(message_of<UsageError>([&] { fit_backdrop(backdrop, 60, 80, false); }),
              AllOf(HasSubstr("wall.png"), HasSubstr("100 x 100"), HasSubstr("60 x 80")));
  EXPECT_EQ(fit_backdrop(backdrop, 60, 80, true).size(), cv::Size(60, 80));
  EXPECT_EQ(parse_colour("#0a14ff"), cv::Vec3b(255, 20, 10));
  EXPECT_EQ(parse_colour("black"), cv::Vec3b(0, 0, 0));
  for (const char* text : {"", "#12345", "#12345g", "missing.png"})
    EXPECT_THAT(message_of<UsageError>([&] { parse_colour(text); }), HasSubstr("#rrggbb")) << text;
}

}  // namespace
}  // namespace doppel::film_test
