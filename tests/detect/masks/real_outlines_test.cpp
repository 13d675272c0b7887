/// The masks of `doppel detect --masks` against outlines that were drawn for people who were filmed. The files
/// `outlines_*.json` beside this one say how they were drawn.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/videoio.hpp>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/detect/blazepose/body_detector.h"
#include "doppel/detect/blazepose/mask_agreement.h"
#include "doppel/detect/blazepose/mask_sharpening.h"
#include "doppel/detect/blazepose/possible_parts.h"
#include "support/blazepose_weights.h"

namespace doppel::real_outlines_test {
namespace {

using Json = nlohmann::json;
using Ring = std::vector<cv::Point2d>;  // pixels, continuous

constexpr double kUnitsPerPixel = 4.0;  // of the files
constexpr long kFramesBefore = 2;       // that the tracker sees before the frame

/// The outline of the person in one frame of a camera.
struct Outline {
  std::string camera;
  long frame = 0;
  std::vector<Ring> rings;
  cv::Rect hidden;  ///< not counted
};

Ring ring_of(const Json& numbers) {
  Ring ring;
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2)
    ring.emplace_back(numbers[i].get<double>() / kUnitsPerPixel, numbers[i + 1].get<double>() / kUnitsPerPixel);
  return ring;
}

std::vector<Outline> read_outlines(const std::string& capture) {
  std::ifstream file(fmt::format("{}/tests/detect/masks/outlines_{}.json", DOPPEL_SOURCE_DIR, capture));
  const Json document = Json::parse(file);
  std::vector<Outline> outlines;
  for (const Json& entry : document.at("outlines")) {
    Outline outline{entry.at("camera").get<std::string>(), entry.at("frame").get<long>(), {}, {}};
    for (const Json& ring : entry.at("rings")) outline.rings.push_back(ring_of(ring));
    if (entry.contains("hidden")) {
      const auto box = entry["hidden"].get<std::array<int, 4>>();
      outline.hidden = {cv::Point(box[0], box[1]), cv::Point(box[2], box[3])};
    }
    outlines.push_back(outline);
  }
  return outlines;
}

/// Where the horizontal line at `y` crosses the rings, sorted.
std::vector<double> crossings(const std::vector<Ring>& rings, double y) {
  std::vector<double> found;
  for (const Ring& ring : rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const cv::Point2d &a = ring[i], &b = ring[(i + 1) % ring.size()];
      if ((a.y <= y) != (b.y <= y)) found.push_back(a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y));
    }
  std::sort(found.begin(), found.end());
  return found;
}

/// 255 on the pixels whose centres lie within an odd number of rings.
cv::Mat filled(const std::vector<Ring>& rings, cv::Size size) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8U);
  for (int row = 0; row < size.height; ++row) {
    const std::vector<double> x = crossings(rings, row + 0.5);
    for (std::size_t i = 0; i + 1 < x.size(); i += 2) {
      const int first = std::max(0, static_cast<int>(std::ceil(x[i] - 0.5)));
      const int end = std::min(size.width, static_cast<int>(std::ceil(x[i + 1] - 0.5)));
      if (first < end) mask.row(row).colRange(first, end).setTo(255);
    }
  }
  return mask;
}

TEST(FilledRings, CentresWithinOneRingAreFilled) {
  const std::vector<Ring> rings{{{1, 1}, {5, 1}, {5, 5}, {1, 5}}, {{2, 2}, {4, 2}, {4, 4}, {2, 4}}};
  EXPECT_EQ(cv::countNonZero(filled(rings, {8, 8})), 16 - 4);
  EXPECT_EQ(filled(rings, {8, 8}).at<std::uint8_t>(1, 1), 255);
  EXPECT_EQ(filled(rings, {8, 8}).at<std::uint8_t>(2, 2), 0);
}

/// Near to the middle of the hips: the tracker follows this person.
Eigen::Vector2d middle_of(const Outline& outline) {
  cv::Rect2d box;
  for (const Ring& ring : outline.rings)
    for (const cv::Point2d& point : ring)
      box = box.empty() ? cv::Rect2d(point, cv::Size2d(1, 1)) : box | cv::Rect2d(point, cv::Size2d(1, 1));
  return {box.x + 0.5 * box.width, box.y + 0.5 * box.height};
}

/// IoU outside of the hidden box.
double overlap(const cv::Mat& mask, const cv::Mat& expected, const cv::Rect& hidden) {
  cv::Mat counted(mask.size(), CV_8U, cv::Scalar(255));
  if (!hidden.empty()) counted(hidden).setTo(0);
  return static_cast<double>(cv::countNonZero(mask & expected & counted)) /
         cv::countNonZero((mask | expected) & counted);
}

/// The frames of a camera that are needed.
struct Footage {
  std::vector<long> background;      ///< numbers of the frames that the background is learnt from
  std::map<long, cv::Mat> frames{};  ///< by number
};

Footage read_footage(const std::filesystem::path& file, const std::vector<Outline>& outlines) {
  cv::VideoCapture video(file.string());
  std::vector<long> all(static_cast<std::size_t>(video.get(cv::CAP_PROP_FRAME_COUNT)));
  std::iota(all.begin(), all.end(), 0L);
  const cv::Size size(static_cast<int>(video.get(cv::CAP_PROP_FRAME_WIDTH)),
                      static_cast<int>(video.get(cv::CAP_PROP_FRAME_HEIGHT)));
  Footage footage{background_frames(all, size)};
  std::set<long> needed(footage.background.begin(), footage.background.end());
  for (const Outline& outline : outlines)
    for (long before = 0; before <= kFramesBefore; ++before) needed.insert(outline.frame - before);
  cv::Mat image;
  for (long frame = 0; video.read(image); ++frame)
    if (needed.contains(frame)) footage.frames[frame] = image.clone();
  return footage;
}

class RealOutlines : public support::BlazePoseTest {
 protected:
  /// The model of `doppel detect` for a capture of several cameras.
  void SetUp() override {
    BlazePoseTest::SetUp();
    if (!IsSkipped()) detector_.emplace(BodyDetectorOptions{.model = BlazePoseModel::heavy, .mirror = true});
  }

  StaticBackground learn(const Footage& footage) {
    std::vector<cv::Mat> shown, masks;
    for (const long frame : footage.background) {
      const cv::Mat& image = footage.frames.at(frame);
      cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
      for (const BodyPose& pose : detector_->detect_all(image)) cv::max(mask, pose.mask, mask);
      shown.push_back(image);
      masks.push_back(mask);
    }
    return learn_background(shown, masks);
  }

  cv::Mat sharp_mask(const std::map<long, cv::Mat>& frames, const Outline& outline,
                     const StaticBackground& background) {
    BodyTracker tracker(*detector_, middle_of(outline));
    std::optional<BodyPose> pose;
    for (long before = kFramesBefore; before >= 0; --before) pose = tracker.track(frames.at(outline.frame - before));
    const cv::Mat& image = frames.at(outline.frame);
    cv::Mat mask = sharpen_mask(image, pose ? pose->mask : cv::Mat::zeros(image.size(), CV_8U), background);
    mark_possible_parts(image, mask, background);
    return mask;
  }

  /// The masks of all frames with an outline, in order of the file.
  std::vector<cv::Mat> masks_of(const std::string& capture, const std::vector<Outline>& outlines) {
    std::map<std::string, std::vector<Outline>> cameras;
    for (const Outline& outline : outlines) cameras[outline.camera].push_back(outline);
    std::map<std::pair<std::string, long>, cv::Mat> masks;
    for (const auto& [camera, own] : cameras) {
      const Footage footage = read_footage(shared_ / "captures" / capture / "videos" / (camera + ".mp4"), own);
      const StaticBackground background = learn(footage);
      for (const Outline& outline : own)
        masks[{camera, outline.frame}] = sharp_mask(footage.frames, outline, background);
    }
    std::vector<cv::Mat> ordered;
    for (const Outline& outline : outlines) ordered.push_back(masks.at({outline.camera, outline.frame}));
    return ordered;
  }

  /// Records and checks the mean IoU of a capture.
  void expect_overlap(const std::string& capture, const std::vector<Camera>& cameras, double bound) {
    const std::vector<Outline> outlines = read_outlines(capture);
    ASSERT_EQ(outlines.size(), 20u);
    std::vector<cv::Mat> masks = masks_of(capture, outlines);
    compare_views(outlines, cameras, masks);
    double mean = 0, lowest = 1;
    for (std::size_t i = 0; i < outlines.size(); ++i) {
      const cv::Mat expected = filled(outlines[i].rings, masks[i].size());
      const double found = overlap(masks[i], expected, outlines[i].hidden);
      RecordProperty(fmt::format("camera_{}_frame_{}", outlines[i].camera, outlines[i].frame), std::to_string(found));
      mean += found / static_cast<double>(outlines.size());
      lowest = std::min(lowest, found);
    }
    RecordProperty("iou_mean", std::to_string(mean));
    RecordProperty("iou_lowest", std::to_string(lowest));
    std::cout << fmt::format("{}: IoU {:.4f}, lowest {:.4f}\n", capture, mean, lowest);
    EXPECT_GE(mean, bound);
  }

 private:
  /// The camera of a name, for images of this size.
  static Camera camera_of(const std::vector<Camera>& cameras, const std::string& name, cv::Size size) {
    const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& c) { return c.name == name; });
    if (found == cameras.end()) throw std::runtime_error("the calibration has no camera " + name);
    Camera camera = *found;
    if (camera.width == 0) camera.width = size.width;
    if (camera.height == 0) camera.height = size.height;
    return camera.scaled_to(size.width, size.height);
  }

  /// Compares the masks of each frame with those of the other cameras.
  static void compare_views(const std::vector<Outline>& outlines, const std::vector<Camera>& cameras,
                            std::vector<cv::Mat>& masks) {
    std::map<long, std::vector<std::size_t>> moments;
    for (std::size_t i = 0; i < outlines.size(); ++i) moments[outlines[i].frame].push_back(i);
    for (const auto& [frame, views] : moments) {
      std::vector<cv::Mat> seen;
      std::vector<Camera> seen_by;
      for (const std::size_t i : views) {
        seen.push_back(masks[i]);
        seen_by.push_back(camera_of(cameras, outlines[i].camera, masks[i].size()));
      }
      settle_masks(seen, seen_by);
      for (std::size_t k = 0; k < views.size(); ++k) masks[views[k]] = seen[k];
    }
  }

  std::optional<BodyDetector> detector_;
};

/// Dark hair and shoes before a dark stage. The goal is 0.97.
TEST_F(RealOutlines, MasksOfADarkStageAgree) {
  expect_overlap("zju4", read_posed_cameras(shared_ / "captures" / "zju4"), 0.98);
}

/// A room with other people, skin before wood, and motion blur. The goal is 0.97, and what is reached is just above it:
/// the outlines themselves are accurate to two or three pixels of 900, which is about 0.01.
TEST_F(RealOutlines, MasksOfARoomAgree) {
  auto cameras = read_posed_cameras(shared_ / "captures" / "p2s" / "calibration.toml");
  for (Camera& camera : cameras) std::erase(camera.name, '_');  // cam_01 of cam01.mp4
  expect_overlap("p2s", cameras, 0.97);
}

}  // namespace
}  // namespace doppel::real_outlines_test
