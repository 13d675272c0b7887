#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/character.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/template_check.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/data/prepare/prepare.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

/// A small capture written to disk: the test character filmed by a ring of cameras, its own silhouette as mask.
namespace doppel::test_capture {

constexpr int kWidth = 112, kHeight = 128;

/// Camera `i` of `count`, 3 m from the y axis at height 1, looking at it.
inline Camera ring_camera(int i, int count) {
  const double angle = 2.0 * M_PI * i / count + 0.3;
  const Eigen::Vector3d centre(0.2 + 3.0 * std::sin(angle), 1.2, 0.1 + 3.0 * std::cos(angle));
  const Eigen::Vector3d forward = (Eigen::Vector3d(0.2, 1.4, 0.1) - centre).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY()).normalized();
  Camera camera;
  camera.name = std::to_string(i);
  camera.width = kWidth;
  camera.height = kHeight;
  camera.K << 130.0, 0.0, 56.5, 0.0, 131.0, 63.25, 0.0, 0.0, 1.0;
  camera.R.row(0) = right;
  camera.R.row(1) = forward.cross(right);
  camera.R.row(2) = forward;
  camera.t = -camera.R * centre;
  return camera;
}

/// Rows of poses that sway and turn a little.
inline Motion swaying_motion(const Character& character, int frames, double phase) {
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 3; d < dofs.size(); ++d)
      dofs[d] += 0.08 * std::sin(phase + 0.7 * f + 1.3 * static_cast<double>(d));
    dofs[0] += 0.01 * f;
    motion.frames.push_back(dofs);
    motion.ids.push_back(f);
  }
  return motion;
}

struct Options {
  int cameras = 3;
  int train_frames = 12, test_frames = 5;
  bool videos = true;  ///< video files; otherwise an image per frame
};

inline std::string padded(int number, int digits) {
  std::string text = std::to_string(number);
  return std::string(digits - std::min<std::size_t>(digits, text.size()), '0') + text;
}

inline void write_video(const std::filesystem::path& path, const char* fourcc, const std::vector<cv::Mat>& frames) {
  std::filesystem::create_directories(path.parent_path());
  const bool colour = frames[0].channels() == 3;
  cv::VideoWriter writer(path.string(), cv::VideoWriter::fourcc(fourcc[0], fourcc[1], fourcc[2], fourcc[3]), 25.0,
                         frames[0].size(), colour);
  if (!writer.isOpened()) throw std::runtime_error("OpenCV cannot write " + path.string());
  for (const cv::Mat& frame : frames) writer.write(frame);
}

inline void write_images(const std::filesystem::path& folder, const std::vector<cv::Mat>& frames) {
  std::filesystem::create_directories(folder);
  for (std::size_t f = 0; f < frames.size(); ++f)
    cv::imwrite((folder / (padded(static_cast<int>(f), 4) + ".png")).string(), frames[f]);
}

/// The masks of one camera, and green images with the person in a frame-dependent colour.
inline void draw(TemplateChecker& checker, const Motion& motion, const Camera& camera, std::vector<cv::Mat>& images,
                 std::vector<cv::Mat>& masks) {
  for (int f = 0; f < motion.num_frames(); ++f) {
    masks.push_back(checker.silhouette(checker.skin(motion.frames[f]), camera));
    cv::Mat image(masks.back().size(), CV_8UC3, cv::Scalar(60, 180, 30));
    image.setTo(cv::Scalar(90 + 5 * f, 60, 160), masks.back());
    images.push_back(image);
  }
}

/// How well a mask cut out of lossy video fits: all of the person, and hardly anything beside the person. The person is
/// 20 pixels wide, so the blur of the video beyond the dilated mask is up to 18 of 392 pixels.
inline void expect_cut_out(const cv::Mat& found, const cv::Mat& ground_truth) {
  cv::Mat near;
  cv::dilate(ground_truth, near, cv::Mat::ones(9, 9, CV_8U));
  const double area = cv::countNonZero(ground_truth);
  EXPECT_LT(cv::countNonZero(ground_truth & ~found), 0.005 * area);
  EXPECT_LT(cv::countNonZero(found & ~near), 0.06 * area);
}

/// Folder with `capture.yaml`, `calibration/`, `character/`, and `training|testing/{videos,masks}`.
class CaptureFixture {
 public:
  explicit CaptureFixture(const Options& options = {}) : character(make_test_character()), options_(options) {
    for (int i = 0; i < options.cameras; ++i) cameras.push_back(ring_camera(i, options.cameras));
    write_character(root() / "character", character);
    std::filesystem::create_directories(root() / "calibration");
    write_calibration(root() / "calibration/cameras.calibration", cameras);
    write_sequence("training", options.train_frames, 0.0);
    write_sequence("testing", options.test_frames, 2.0);
    write_yaml(options.train_frames > 5 ? yaml() : yaml(""));
  }

  std::filesystem::path root() const { return folder_ / "capture"; }
  std::filesystem::path out() const { return folder_ / "prepared"; }
  std::filesystem::path path(const std::string& name) const { return folder_ / name; }

  std::string yaml(const std::string& training_extra = "    cuts: [5]\n") const {
    const std::string video = options_.videos ? "videos/{camera:02}.avi" : "videos/{name}/{frame:04}.png";
    const std::string mask = options_.videos ? "masks/{camera:02}.mkv" : "masks/{name}/{frame:04}.png";
    const auto sequence = [&](const std::string& name, const std::string& split) {
      return "  - name: " + name + "\n    split: " + split + "\n    videos: " + name + "/" + video +
             "\n    masks: " + name + "/" + mask + "\n    motion: " + name + "/poses.motion\n";
    };
    return "doppel_capture: 1\nname: tube\ncharacter: character/tube.character\n"
           "calibration: calibration/cameras.calibration\nfps: 25\nsequences:\n" +
           sequence("training", "train") + training_extra + sequence("testing", "test");
  }

  void write_yaml(const std::string& text) const { std::ofstream(root() / "capture.yaml") << text; }

  Capture capture() const { return read_capture(root()); }
  PrepareOptions prepare_options() const {
    PrepareOptions options;
    options.out = out();
    options.mask_size = 64;
    options.image_size = 48;
    options.chunk_frames = 4;
    return options;
  }
  PrepareReport prepare() const { return prepare_capture(capture(), prepare_options()); }

  Motion motion(const std::string& name) const {
    return read_motion(root() / name / "poses.motion", character.num_dofs());
  }

  void write_sequence(const std::string& name, int frames, double phase) {
    std::filesystem::create_directories(root() / name);
    const Motion poses = swaying_motion(character, frames, phase);
    write_motion(root() / name / "poses.motion", poses, true);
    TemplateChecker checker(character);
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      std::vector<cv::Mat> images, masks;
      draw(checker, poses, cameras[c], images, masks);
      if (options_.videos) {
        write_video(root() / name / "videos" / (padded(static_cast<int>(c), 2) + ".avi"), "MJPG", images);
        write_video(root() / name / "masks" / (padded(static_cast<int>(c), 2) + ".mkv"), "FFV1", masks);
      } else {
        write_images(root() / name / "videos" / cameras[c].name, images);
        write_images(root() / name / "masks" / cameras[c].name, masks);
      }
    }
  }

  Character character;
  std::vector<Camera> cameras;

 private:
  support::TemporaryFolder folder_;
  Options options_;
};

}  // namespace doppel::test_capture
