#pragma once

#include <functional>
#include <thread>

#include "doppel/track/live/live_run.h"
#include "doppel/track/method_trackers.h"
#include "track/tube_capture.h"

namespace doppel {

/// A source that does as it is told.
class FakeSource : public FrameSource {
 public:
  /// @param wait seconds before an image, by its number
  FakeSource(std::vector<cv::Mat> images, bool live, std::function<double(long)> wait = {})
      : images_(std::move(images)), live_(live), wait_(std::move(wait)) {}

  std::optional<SourceImage> next() override {
    if (next_ == static_cast<long>(images_.size())) return std::nullopt;
    if (wait_) std::this_thread::sleep_for(std::chrono::duration<double>(wait_(next_)));
    const long number = next_++;
    return SourceImage{number, number, images_[number], Clock::now()};
  }
  bool live() const override { return live_; }
  cv::Size size() const override { return images_.front().size(); }
  double frames_per_second() const override { return 25.0; }
  const std::string& name() const override { return name_; }

 private:
  std::vector<cv::Mat> images_;
  bool live_;
  std::function<double(long)> wait_;
  long next_ = 0;
  std::string name_ = "a fake camera";
};

/// The tube before one camera, in images: it is orange, and stands before a wall that a mask can be cut from.
class LiveCapture : public TrackCapture {
 protected:
  LiveCapture() {
    std::filesystem::create_directories(root() / "film");
    cv::imwrite((root() / "empty.png").string(), wall());
    for (int frame = 0; frame < kFrames; ++frame)
      cv::imwrite((root() / fmt::format("film/{:03}.png", frame)).string(), image(frame));
    write_yaml("live.yaml", "background_subtraction: {empty: empty.png, refine: false}");
  }

  /// @param masks how they are found: a key of a sequence and its value
  void write_yaml(const std::string& name, const std::string& masks) const {
    std::ofstream(root() / name) << "doppel_capture: 1\nname: tube\ncharacter: "
                                 << std::filesystem::relative(character_file_, root()).string()
                                 << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nsequences:\n"
                                 << "  - {name: walk, split: test, videos: 'film/{frame:03}.png', " << masks
                                 << ", keypoints: points.csv, joints3d: 'joints_{name}.csv'}\n";
  }
  static cv::Mat wall() {
    cv::Mat image(192, 192, CV_8UC3);
    for (int row = 0; row < image.rows; ++row)
      for (int column = 0; column < image.cols; ++column)
        image.at<cv::Vec3b>(row, column) =
            cv::Vec3b(static_cast<uchar>(90 + (7 * row) % 40), static_cast<uchar>(110 + (5 * column) % 30), 80);
    return image;
  }
  cv::Mat image(int frame) const {
    cv::Mat image = wall();
    image.setTo(cv::Scalar(40, 130, 240), mask_of(model_, cameras_[1], ground_truth(frame)));
    return image;
  }
  std::vector<cv::Mat> images() const {
    std::vector<cv::Mat> all;
    for (int frame = 0; frame < kFrames; ++frame) all.push_back(image(frame));
    return all;
  }
  LiveView view(const std::string& yaml = "live.yaml") const {
    LiveViewOptions options;
    options.camera = "c1";
    return LiveView(root() / yaml, {192, 192}, options);
  }
  static LivecapConfig config() {
    LivecapConfig config;
    config.fit.min_keypoints = 6;  // of eight
    return config;
  }
  LiveRunOptions options(const std::string& out) const {
    LiveRunOptions options;
    options.out = root() / out;
    options.vertices = true;
    return options;
  }
};

inline std::unique_ptr<FrameTracker> livecap_tracker(const LiveView& view, const LivecapConfig& config) {
  return make_livecap_tracker(view.character(), view.landmarks(), view.camera(), config);
}

/// A tracker that takes its time and counts its pauses.
class SlowTracker : public FrameTracker {
 public:
  SlowTracker(const LiveView& view, double seconds)
      : tracker_(livecap_tracker(view,
                                 [] {
                                   LivecapConfig config;
                                   config.fit.min_keypoints = 6;
                                   config.fit.surface = false;
                                   return config;
                                 }())),
        seconds_(seconds) {}

  FrameResult track(const FootageFrame& seen) override {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds_));
    return tracker_->track(seen);
  }
  void cut() override { tracker_->cut(); }
  void pause() override {
    ++pauses;
    tracker_->pause();
  }
  ImageUse image_use() const override { return tracker_->image_use(); }
  const PoseModel& model() const override { return tracker_->model(); }
  int pauses = 0;

 private:
  std::unique_ptr<FrameTracker> tracker_;
  double seconds_;
};

}  // namespace doppel
