#pragma once

/// Faults that are planted into a copy of a healthy capture. Used for generated captures, and for small files of real
/// ones.

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/data/doctor/doctor.h"

namespace doppel::planted {

namespace fs = std::filesystem;

/// What was found, for messages.
inline std::string told(const Examination& examination) {
  std::string text = to_string(examination.verdict());
  for (const Finding& finding : examination.findings)
    text += "\n  " + finding.camera + " " + finding.fault + " (" + to_string(finding.severity) + "): " + finding.figure;
  return text;
}

/// A capture whose files may be changed.
struct Patient {
  fs::path folder;
  Capture capture;

  explicit Patient(const fs::path& of) : folder(of), capture(read_capture(of)) {}
  void save() const { write_capture(folder / "capture.yaml", capture); }
  std::vector<Camera> cameras() const { return choose_cameras(capture).cameras; }
};

/// Changes the cameras, and writes them as an OpenCV file, which the capture then names.
inline void change_cameras(Patient& patient, const std::function<void(std::vector<Camera>&)>& change) {
  std::vector<Camera> cameras = patient.cameras();
  change(cameras);
  patient.capture.calibration = "changed.yml";
  patient.capture.calibration_options = {};
  write_calibration(patient.folder / "changed.yml", cameras);
  patient.save();
}
inline void change_camera(Patient& patient, int camera, const std::function<void(Camera&)>& change) {
  change_cameras(patient, [&](std::vector<Camera>& cameras) { change(cameras[camera]); });
}

/// One person's points in a file of OpenPose: x, y, confidence.
using Numbers = std::vector<double>;
inline std::string keypoint_pattern(const Patient& patient, const SequenceEntry& sequence, int camera) {
  return patient.capture.source(sequence.keypoints, camera, patient.cameras()[camera].name);
}
inline nlohmann::json read_json(const fs::path& path) { return nlohmann::json::parse(std::ifstream(path)); }

/// Replaces the people of each file. A file that was changed is a new one, because the old one may be a link.
inline void change_people(Patient& patient, int camera,
                          const std::function<void(long frame, std::vector<Numbers>& people)>& change) {
  for (const SequenceEntry& sequence : patient.capture.sequences) {
    const std::string pattern = keypoint_pattern(patient, sequence, camera);
    for (long frame = 0; fs::exists(expand_pattern(pattern, 0, "", frame)); ++frame) {
      const fs::path path = expand_pattern(pattern, 0, "", frame);
      nlohmann::json file = read_json(path);
      std::vector<Numbers> people;
      for (const auto& person : file["people"])
        if (person.contains("pose_keypoints_2d")) people.push_back(person["pose_keypoints_2d"].get<Numbers>());
      change(frame, people);
      nlohmann::json list = nlohmann::json::array();
      for (const Numbers& numbers : people) list.push_back({{"pose_keypoints_2d", numbers}});
      file["people"] = list;
      fs::remove(path);
      std::ofstream(path) << file.dump();
    }
  }
}
/// Moves every point that is seen.
inline void move_points(Patient& patient, int camera,
                        const std::function<Eigen::Vector2d(long frame, const Eigen::Vector2d&)>& move) {
  change_people(patient, camera, [&](long frame, std::vector<Numbers>& people) {
    for (Numbers& numbers : people)
      for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
        if (numbers[i + 2] <= 0.0) continue;
        const Eigen::Vector2d moved = move(frame, {numbers[i], numbers[i + 1]});
        numbers[i] = moved.x();
        numbers[i + 1] = moved.y();
      }
  });
}
/// Exchanges left and right in BODY_25.
inline void exchange_sides(Numbers& numbers) {
  static const std::vector<std::pair<std::size_t, std::size_t>> kPairs{
      {2, 5}, {3, 6}, {4, 7}, {9, 12}, {10, 13}, {11, 14}, {15, 16}, {17, 18}, {19, 22}, {20, 23}, {21, 24}};
  for (const auto& [right, left] : kPairs)
    for (std::size_t i = 0; i < 3; ++i) std::swap(numbers[3 * right + i], numbers[3 * left + i]);
}

/// The files of one frame take the content of another frame's. @param source nothing below 0: as it was
inline void move_frames(Patient& patient, int camera, const std::function<long(long frame, long frames)>& source) {
  for (const SequenceEntry& sequence : patient.capture.sequences) {
    const std::string pattern = keypoint_pattern(patient, sequence, camera);
    std::vector<nlohmann::json> files;
    for (long frame = 0; fs::exists(expand_pattern(pattern, 0, "", frame)); ++frame)
      files.push_back(read_json(expand_pattern(pattern, 0, "", frame)));
    const auto count = static_cast<long>(files.size());
    for (long frame = 0; frame < count; ++frame) {
      const fs::path path = expand_pattern(pattern, 0, "", frame);
      const long from = std::clamp(source(frame, count), 0L, count - 1);
      fs::remove(path);
      std::ofstream(path) << files[from].dump();
    }
  }
}

/// Writes a camera's video of each sequence anew.
/// @param change what becomes of the images of a video
inline void change_video(Patient& patient, int camera, const std::function<void(std::vector<cv::Mat>&)>& change) {
  for (SequenceEntry& sequence : patient.capture.sequences) {
    const std::string path = patient.capture.source(sequence.videos, camera, patient.cameras()[camera].name);
    std::vector<cv::Mat> images;
    const auto reader = open_frames(path, PixelFormat::colour);
    const long frames = reader->num_frames(0);
    for (long frame = 0; frame < frames; ++frame) images.push_back(reader->read(frame).clone());
    change(images);
    fs::remove(path);
    VideoFile video(path, images.front().size(), patient.capture.fps);
    for (const cv::Mat& image : images) video.write(image);
    video.close();
  }
}
inline void change_images(Patient& patient, int camera, const std::function<void(cv::Mat&)>& change) {
  change_video(patient, camera, [&](std::vector<cv::Mat>& images) {
    for (cv::Mat& image : images) change(image);
  });
}
/// The same for masks, which are videos without loss.
inline void change_masks(Patient& patient, int camera, const std::function<void(long frame, cv::Mat&)>& change) {
  for (SequenceEntry& sequence : patient.capture.sequences) {
    const std::string path = patient.capture.source(sequence.masks, camera, patient.cameras()[camera].name);
    std::vector<cv::Mat> masks;
    const auto reader = open_frames(path, PixelFormat::grey);
    const long frames = reader->num_frames(0);
    for (long frame = 0; frame < frames; ++frame) masks.push_back(reader->read(frame).clone());
    fs::remove(path);
    cv::VideoWriter video(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('F', 'F', 'V', '1'), patient.capture.fps,
                          masks.front().size(), false);
    for (long frame = 0; frame < frames; ++frame) {
      change(frame, masks[frame]);
      video.write(masks[frame]);
    }
  }
}

inline Eigen::Matrix3d turned(double x, double y, double z) {
  const double degree = M_PI / 180.0;
  return (Eigen::AngleAxisd(x * degree, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(y * degree, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(z * degree, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

}  // namespace doppel::planted
