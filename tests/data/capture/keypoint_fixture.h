#pragma once

#include <nlohmann/json.hpp>

#include "data/capture/capture_fixture.h"
#include "doppel/character/landmarks.h"
#include "support/hostile_files.h"

/// Keypoints beside a small capture: landmarks named as BODY_25's points ride on the tube, and OpenPose files hold
/// their exact projections.
namespace doppel::test_capture {

/// Six landmarks spread over the character.
inline std::vector<Marker> some_landmarks(const Character& character) {
  std::vector<Marker> landmarks;
  const char* const names[] = {"Nose", "RWrist", "LWrist", "MidHip", "RAnkle", "LAnkle"};
  const int joints = character.skeleton.num_joints();
  for (int m = 0; m < 6; ++m)
    landmarks.push_back({names[m], (5 + 3 * m) % joints, Eigen::Vector3d(0.02 * m - 0.05, 0.1, 0.03)});
  return landmarks;
}

/// One person of BODY_25; landmark m is detected with confidence 0.9 - m / 100.
inline std::vector<float> body25_person(const Character& character, const Camera& camera,
                                        const std::vector<double>& dofs) {
  static const int indices[] = {0, 4, 7, 8, 11, 14};
  std::vector<float> values(75, 0.0f);
  const auto positions = landmark_positions(character.skeleton, some_landmarks(character), dofs);
  for (std::size_t m = 0; m < positions.size(); ++m) {
    const Eigen::Vector2d pixel = camera.project(positions[m]);
    values[3 * indices[m]] = static_cast<float>(pixel.x());
    values[3 * indices[m] + 1] = static_cast<float>(pixel.y());
    values[3 * indices[m] + 2] = 0.9f - 0.01f * static_cast<float>(m);
  }
  return values;
}

inline std::string openpose_text(const std::vector<std::vector<float>>& people) {
  nlohmann::json file{{"version", 1.3}, {"people", nlohmann::json::array()}};
  for (const auto& person : people) file["people"].push_back({{"pose_keypoints_2d", person}});
  return file.dump();
}

inline std::filesystem::path keypoint_path(const CaptureFixture& fixture, const std::string& sequence, int camera,
                                           int frame) {
  return fixture.root() / sequence / "keypoints" / (padded(camera, 2) + "_" + padded(frame, 4) + ".json");
}

/// Writes landmarks.csv, the keypoint files of both sequences, and a capture.yaml that names them.
/// @param extra further top-level lines
inline void add_keypoints(const CaptureFixture& fixture, const std::string& extra = "") {
  write_landmarks(fixture.root() / "landmarks.csv", fixture.character, some_landmarks(fixture.character));
  std::string yaml = fixture.yaml();
  for (const std::string name : {"training", "testing"}) {
    std::filesystem::create_directories(fixture.root() / name / "keypoints");
    const Motion motion = fixture.motion(name);
    for (std::size_t c = 0; c < fixture.cameras.size(); ++c)
      for (int f = 0; f < motion.num_frames(); ++f)
        support::write_bytes(keypoint_path(fixture, name, static_cast<int>(c), f),
                             openpose_text({body25_person(fixture.character, fixture.cameras[c], motion.frames[f])}));
    const std::string line = "    motion: " + name + "/poses.motion\n";
    yaml = support::replaced(yaml, line, line + "    keypoints: " + name + "/keypoints/{camera:02}_{frame:04}.json\n");
  }
  fixture.write_yaml(support::replaced(yaml, "sequences:", "landmarks: landmarks.csv\n" + extra + "sequences:"));
}

}  // namespace doppel::test_capture
