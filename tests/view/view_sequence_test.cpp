#include "doppel/view/view_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/view/view_server.h"
#include "support/message_of.h"
#include "support/ring_of_cameras.h"
#include "support/temporary_folder.h"

namespace doppel::view_sequence_test {
namespace {

using Eigen::Vector3d;
using support::message_of;
using ::testing::HasSubstr;

constexpr int kCameras = 3, kRows = 8, kFirstRow = 2, kSize = 160;
const std::vector<std::string> kNames{"left_shoulder", "left_elbow", "left_wrist", "right_shoulder",
                                      "right_elbow",   "left_hip",   "right_hip",  "left_knee"};
const std::vector<Vector3d> kBody{{0.2, 1.4, 0.0},  {0.4, 1.2, 0.1}, {0.5, 1.0, 0.2},  {-0.2, 1.4, 0.0},
                                  {-0.4, 1.2, 0.1}, {0.1, 0.9, 0.0}, {-0.1, 0.9, 0.0}, {0.1, 0.5, 0.1}};
constexpr std::size_t kWrist = 2;

/// Points that move along a line.
Vector3d true_point(std::size_t k, int row) { return kBody[k] + Vector3d(0.0, 0.02 * row, 0.0); }
int brightness(int row) { return 20 + 25 * row; }

/// A capture without a character: images, masks and keypoints of three cameras. The wrist is seen by one of them.
class ViewSequenceTest : public testing::Test {
 protected:
  ViewSequenceTest() : cameras_(ring_of_cameras(kCameras, kSize, {0.0, 1.0, 0.0})) {
    write_calibration(folder_ / "cameras.yml", {cameras_.begin(), cameras_.end()});
    for (const PinholeCamera& camera : cameras_)
      for (int row = 0; row < kRows; ++row) {
        const std::string name = fmt::format("{}_{}.png", camera.name, row);
        cv::Mat mask(kSize, kSize, CV_8UC1, cv::Scalar(0));
        mask(cv::Rect(40, 40, 80, 80)) = 255;
        cv::imwrite((folder_ / ("mask_" + name)).string(), mask);
        cv::imwrite((folder_ / ("image_" + name)).string(),
                    cv::Mat(kSize, kSize, CV_8UC3, cv::Scalar::all(brightness(row))));
      }
    write_keypoints();
  }

  void write_keypoints() const {
    std::ofstream table(folder_ / "points.csv");
    table << "frame,camera,name,x,y,confidence\n";
    for (int row = 0; row < kRows; ++row)
      for (std::size_t c = 0; c < cameras_.size(); ++c)
        for (std::size_t k = 0; k < kNames.size(); ++k) {
          if (k == kWrist && c > 0) continue;
          const Eigen::Vector2d pixel = Camera(cameras_[c]).project(true_point(k, row));
          table << row << ',' << cameras_[c].name << ',' << kNames[k] << ',' << pixel.x() << ',' << pixel.y()
                << ",0.9\n";
        }
  }

  /// @param keys of the sequence that is shown; the first sequence has no file
  std::filesystem::path capture(const std::string& keys) const {
    write_atomically(folder_ / "capture.yaml",
                     "doppel_capture: 1\nname: anna\ncalibration: cameras.yml\nfps: 50\nsequences:\n"
                     "  - {name: lost, split: train, videos: 'none_{name}.mp4'}\n"
                     "  - {name: walk, split: train, videos: 'image_{name}_{frame}.png', first_frame: 2" +
                         keys + "}\n");
    return folder_.path();
  }
  std::filesystem::path whole_capture() const {
    return capture(", masks: 'mask_{name}_{frame}.png', keypoints: points.csv");
  }

  support::TemporaryFolder folder_;
  std::vector<PinholeCamera> cameras_;
};

/// A server in a thread of its own.
class Served {
 public:
  explicit Served(const std::filesystem::path& target)
      : server_(open_view_subject(target), 0), thread_([this] { server_.serve(); }) {
    const std::string url = server_.url();
    token_ = url.substr(url.find("token="));
    client_ = std::make_unique<httplib::Client>("127.0.0.1", std::stoi(url.substr(url.rfind(':') + 1)));
    while (!client_->Get("/")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ~Served() {
    server_.stop();
    thread_.join();
  }
  httplib::Result get(const std::string& path) { return client_->Get(with_token(path)); }
  httplib::Result post(const std::string& path, const std::string& body) {
    return client_->Post(with_token(path), body, "application/octet-stream");
  }
  nlohmann::json description() { return nlohmann::json::parse(get("/double/description.json")->body); }

 private:
  std::string with_token(const std::string& path) const {
    return path + (path.find('?') == std::string::npos ? "?" : "&") + token_;
  }

  ViewServer server_;
  std::thread thread_;
  std::string token_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(ViewSequenceTest, ThePageGetsTheSequenceAndItsPointsInSpace) {
  Served served(whole_capture());
  const auto about = served.description();
  EXPECT_EQ(about["name"], "anna, walk");
  EXPECT_EQ(about["frames"], kRows - kFirstRow);
  EXPECT_EQ(about["frames_per_second"], 50.0);
  EXPECT_TRUE(about["cameras"].get<bool>());
  for (const char* list : {"stages", "dofs", "joints", "rest"}) EXPECT_TRUE(about[list].empty()) << list;
  const auto names = about["points"].get<std::vector<std::string>>();
  ASSERT_EQ(names.size(), kNames.size());
  EXPECT_EQ(about["sticks"].size(), 8U) << "of the twelve limbs";
  const std::string bytes = served.get("/double/points.bin")->body;
  ASSERT_EQ(bytes.size(), 12 * names.size() * (kRows - kFirstRow));
  std::vector<float> found(bytes.size() / 4);
  std::memcpy(found.data(), bytes.data(), bytes.size());
  for (int frame = 0; frame < kRows - kFirstRow; ++frame)
    for (std::size_t k = 0; k < names.size(); ++k) {
      const std::size_t m = as_size(std::find(kNames.begin(), kNames.end(), names[k]) - kNames.begin());
      const Vector3d expected = true_point(m, kFirstRow + frame);
      const float* point = &found[3 * (as_size(frame) * names.size() + k)];
      if (m == kWrist)
        EXPECT_TRUE(std::isnan(point[0])) << "one camera saw it";
      else
        EXPECT_LT((Vector3d(point[0], point[1], point[2]) - expected).norm(), 2e-3) << names[k] << ' ' << frame;
    }
}

TEST_F(ViewSequenceTest, ImagesAndMasksAreThoseOfTheFrame) {
  Served served(whole_capture());
  EXPECT_EQ(nlohmann::json::parse(served.get("/api/cameras")->body)["cameras"].size(), as_size(kCameras));
  const auto image = [&](int frame, int mask) {
    const std::string jpeg = served.get(fmt::format("/api/picture?camera=1&frame={}&mask={}", frame, mask))->body;
    return cv::imdecode(std::vector<char>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR);
  };
  for (const int frame : {0, 5, 1}) EXPECT_NEAR(cv::mean(image(frame, 0))[0], brightness(kFirstRow + frame), 1.5);
  const cv::Mat painted = image(0, 1);
  EXPECT_GT(painted.at<cv::Vec3b>(80, 80)[1], brightness(kFirstRow) + 30);
  EXPECT_NEAR(painted.at<cv::Vec3b>(10, 10)[1], brightness(kFirstRow), 3);
  EXPECT_EQ(served.get("/api/picture?camera=1&frame=6&mask=0")->status, 400);
  EXPECT_EQ(served.get("/api/picture?camera=1&frame=-1&mask=0")->status, 400);
}

TEST_F(ViewSequenceTest, RequestsThatNeedACharacterSaySo) {
  Served served(whole_capture());
  const std::vector<httplib::Result> answers = [&] {
    std::vector<httplib::Result> all;
    all.push_back(served.get("/api/frame?i=0&stage=skinning"));
    all.push_back(served.get("/api/live?after=0&stage=skinning"));
    all.push_back(served.post("/api/pose?stage=skinning", "abcd"));
    all.push_back(served.post("/api/joints", "abcd"));
    all.push_back(served.post("/api/joints", ""));
    all.push_back(served.post("/api/live?tracked=1", "abcd"));
    all.push_back(served.post("/api/motion?name=walk.bvh", "no motion"));
    return all;
  }();
  for (std::size_t i = 0; i < answers.size(); ++i) {
    EXPECT_EQ(answers[i]->status, 400) << i;
    EXPECT_THAT(answers[i]->body, HasSubstr("anna, walk has no character")) << i;
  }
}

TEST_F(ViewSequenceTest, CamerasAreShownWithoutMasksAndKeypoints) {
  Served served(capture(""));
  EXPECT_EQ(served.description()["points"].size(), 0U);
  EXPECT_TRUE(served.get("/double/points.bin")->body.empty());
  EXPECT_FALSE(nlohmann::json::parse(served.get("/api/cameras")->body)["masks"].get<bool>());
  EXPECT_EQ(served.get("/api/picture?camera=0&frame=0&mask=0")->status, 200);
  EXPECT_EQ(served.get("/api/picture?camera=0&frame=0&mask=1")->status, 400);
}

TEST_F(ViewSequenceTest, PointsThatCannotBeFoundHideNoCamera) {
  write_atomically(folder_ / "points.csv", "frame,camera,name,x,y,confidence\n3,c0,left_wrist,80,80,0.9\n");
  const ViewSubject subject = open_view_subject(whole_capture());
  EXPECT_EQ(subject.cameras->size(), as_size(kCameras));
  EXPECT_TRUE(subject.sequence->points.frames.empty());
  EXPECT_EQ(subject.sequence->frames, kRows - kFirstRow);
}

TEST_F(ViewSequenceTest, AFolderOfAPublicLayoutIsShown) {
  write_atomically(folder_ / "a/calibration.csv",
                   "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py\nCam001,16,16,0,0,0,0,1,-3,1.2,1.2,0.5,0.5\n"
                   "Cam002,16,16,0,3.1,0,0,1,3,1.2,1.2,0.5,0.5\n");
  for (const char* camera : {"Cam001", "Cam002"})
    for (const auto& [kind, type] : {std::pair("rgb", ".jpg"), std::pair("mask", ".png")})
      for (int frame = 0; frame < 3; ++frame) {
        const std::filesystem::path images = folder_ / "a" / (kind + std::string("s")) / camera;
        std::filesystem::create_directories(images);
        cv::imwrite((images / fmt::format("{}_{}{:06}{}", camera, kind, frame, type)).string(),
                    cv::Mat(16, 16, CV_8UC1, cv::Scalar(255)));
      }
  const ViewSubject subject = open_view_subject(folder_ / "a");
  ASSERT_TRUE(subject.sequence.has_value());
  EXPECT_EQ(subject.sequence->frames, 3);
  EXPECT_EQ(subject.cameras->size(), 2U);
  EXPECT_TRUE(subject.cameras->has_masks());
}

TEST_F(ViewSequenceTest, SaysWhatIsMissing) {
  const auto target = whole_capture();
  ViewOptions with_motion;
  with_motion.motion = folder_ / "walk.motion";
  EXPECT_THAT(message_of([&] { open_view_subject(target, with_motion); }), HasSubstr("anna names no character"));
  EXPECT_THAT(message_of([&] { open_view_subject(capture(", last_frame: 20")); }), HasSubstr("frames 0 to 7"));
  write_atomically(folder_ / "capture.yaml",
                   "doppel_capture: 1\nname: anna\ncalibration: cameras.yml\nsequences:\n"
                   "  - {name: lost, split: test, videos: 'none_{name}.mp4'}\n");
  EXPECT_THAT(message_of([&] { open_view_subject(target); }), HasSubstr("neither a character nor a video"));
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_THAT(message_of<UsageError>([&] { open_view_subject(folder_ / "empty"); }), HasSubstr("capture init"));
}

}  // namespace
}  // namespace doppel::view_sequence_test
