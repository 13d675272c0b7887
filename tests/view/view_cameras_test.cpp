#include "doppel/view/view_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "doppel/core/error.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/view/view_server.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::view_cameras_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

/// A capture of two cameras with images and masks of four test frames.
class ViewCamerasTest : public testing::Test {
 protected:
  ViewCamerasTest() {
    SmallCaptureOptions options;
    options.cameras = 2;
    options.train_frames = 2;
    options.test_frames = 4;
    make_small_capture(folder_.path(), options);
    capture_ = read_capture(folder_.path());
  }
  static cv::Mat decoded(const std::string& jpeg) {
    return cv::imdecode(std::vector<char>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR);
  }
  cv::Mat filmed(int camera, long frame) const {
    return cv::imread((folder_ / "dance" / fmt::format("image_c{}_{}.png", camera, frame)).string());
  }

  support::TemporaryFolder folder_;
  Capture capture_;
};

TEST_F(ViewCamerasTest, ImagesAreThoseOfTheFrame) {
  ViewCameras cameras(capture_, capture_.sequences[1]);
  ASSERT_EQ(cameras.size(), 2U);
  for (const long frame : {0L, 3L, 1L}) {  // also backwards
    const cv::Mat expected = filmed(1, frame), found = decoded(cameras.image(1, frame, false));
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_LT(cv::norm(found, expected, cv::NORM_L1) / (3.0 * static_cast<double>(expected.total())), 3.0) << frame;
  }
  EXPECT_GT(cv::norm(filmed(1, 0), filmed(1, 3), cv::NORM_L1), 0.0);
}

TEST_F(ViewCamerasTest, TheMaskIsPaintedGreen) {
  ViewCameras cameras(capture_, capture_.sequences[1]);
  const cv::Mat plain = decoded(cameras.image(0, 2, false)), painted = decoded(cameras.image(0, 2, true));
  const cv::Mat mask = cv::imread((folder_ / "dance" / "mask_c0_2.png").string(), cv::IMREAD_GRAYSCALE);
  cv::Mat core, outside;
  cv::erode(mask, core, {}, {-1, -1}, 4);
  cv::dilate(mask, outside, {}, {-1, -1}, 4);
  EXPECT_GT(cv::mean(painted, core)[1] - cv::mean(plain, core)[1], 15.0);
  EXPECT_NEAR(cv::mean(painted, ~outside)[1], cv::mean(plain, ~outside)[1], 2.0);
}

TEST_F(ViewCamerasTest, AFilmedCameraSaysWhereItStands) {
  const auto json = nlohmann::json::parse(ViewCameras(capture_, capture_.sequences[1]).description());
  EXPECT_TRUE(json["masks"].get<bool>());
  ASSERT_EQ(json["cameras"].size(), 2U);
  const CaptureCameras expected = choose_cameras(capture_);
  for (int k = 0; k < 3; ++k) {
    EXPECT_DOUBLE_EQ(json["cameras"][1]["t"][k].get<double>(), expected.cameras[1].t[k]);
    EXPECT_DOUBLE_EQ(json["cameras"][1]["R"][0][k].get<double>(), expected.cameras[1].R(0, k));
  }
}

TEST_F(ViewCamerasTest, RefusesWhatDoesNotExist) {
  ViewCameras cameras(capture_, capture_.sequences[1]);
  EXPECT_THAT(message_of<UsageError>([&] { cameras.image(2, 0, false); }), HasSubstr("there are 2"));
  EXPECT_THAT(message_of<UsageError>([&] { cameras.image(-1, 0, false); }), HasSubstr("no camera -1"));
  EXPECT_THAT(message_of([&] { cameras.image(0, 99, false); }), HasSubstr("99"));
  capture_.sequences[1].masks = CameraPaths();
  ViewCameras without(capture_, capture_.sequences[1]);
  EXPECT_FALSE(without.has_masks());
  EXPECT_THAT(message_of<UsageError>([&] { without.image(0, 0, true); }), HasSubstr("no masks"));
}

TEST_F(ViewCamerasTest, ACaptureIsShownWithItsCamerasWhereItsImagesAreThere) {
  EXPECT_EQ(open_view_subject(folder_.path()).cameras->size(), 2U);
  EXPECT_EQ(open_view_subject(folder_ / "prepared").cameras->size(), 2U);
  ViewOptions options;
  options.motion = folder_ / "walk" / "poses.motion";
  EXPECT_FALSE(open_view_subject(folder_.path(), options).cameras) << "they filmed another motion";
  for (int camera : {0, 1})
    for (int frame = 0; frame < 4; ++frame)
      std::filesystem::remove(folder_ / "dance" / fmt::format("image_c{}_{}.png", camera, frame));
  EXPECT_FALSE(open_view_subject(folder_.path()).cameras);
}

TEST_F(ViewCamerasTest, TheServerNamesCamerasAndFramesByNumber) {
  ViewServer server(open_view_subject(folder_.path()), 0);
  std::thread serving([&] { server.serve(); });
  const std::string url = server.url(), token = "&" + url.substr(url.find("token="));
  const std::size_t colon = url.rfind(':');
  httplib::Client client("127.0.0.1", std::stoi(url.substr(colon + 1)));
  const auto answer = [&](const std::string& path) { return client.Get(path + token); };
  while (!client.Get("/")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(decoded(answer("/api/picture?camera=1&frame=2&mask=0")->body).size(), filmed(1, 2).size());
  EXPECT_EQ(nlohmann::json::parse(answer("/api/cameras?")->body)["cameras"].size(), 2U);
  for (const char* wrong :
       {"/api/picture?camera=2&frame=0&mask=0", "/api/picture?camera=0&frame=4&mask=0", "/api/picture?camera=../x",
        "/api/picture?camera=0&frame=-1&mask=0", "/api/picture?camera=0&frame=0&mask=/etc/passwd", "/api/training?",
        "/api/training_image?stage=0&image=0"})
    EXPECT_EQ(answer(wrong)->status, 400) << wrong;
  EXPECT_EQ(client.Get("/api/picture?camera=0&frame=0&mask=0")->status, 403);
  server.stop();
  serving.join();
}

}  // namespace
}  // namespace doppel::view_cameras_test
