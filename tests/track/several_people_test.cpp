// Several people in the images: who is followed.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "doppel/track/track_capture.h"
#include "track/tube_capture.h"

namespace doppel::several_people_test {
namespace {

using Eigen::Vector3d;

/// The body of the fixture, and another one of the same pose beside it, which the detector finds more clearly. The
/// order of both changes from frame to frame.
class SeveralPeople : public TrackCapture {
 protected:
  static Vector3d beside() { return {0.9, 0.0, 0.2}; }

  SeveralPeople() {
    std::string names;
    for (const Marker& landmark : landmarks_) names += (names.empty() ? "" : ", ") + landmark.name;
    std::ofstream(root() / "map.yaml") << "points: [" << names << "]\nevery_point: true\n";
    for (std::size_t c = 0; c < cameras_.size(); ++c) write_people(c);
  }

  void write_people(std::size_t c) const {
    nlohmann::json frames = nlohmann::json::array();
    for (int frame = 0; frame < kFrames; ++frame) {
      nlohmann::json people = nlohmann::json::array({person(c, frame, Vector3d::Zero(), 0.8)});
      people.insert(frame % 2 ? people.begin() : people.end(), person(c, frame, beside(), 1.0));
      frames.push_back({{"frame_id", frame}, {"instances", people}});
    }
    std::ofstream(root() / ("people_" + cameras_[c].name + ".json")) << frames.dump();
  }

  nlohmann::json person(std::size_t c, int frame, const Vector3d& shift, double confidence) const {
    const PosedBody body = model_.pose(ground_truth(frame), false);
    nlohmann::json points = nlohmann::json::array(), scores = nlohmann::json::array();
    for (int m = 0; m < model_.num_landmarks(); ++m) {
      const Eigen::Vector2d pixel = cameras_[c].project(model_.landmark(body, m) + shift);
      points.push_back({pixel.x(), pixel.y()});
      scores.push_back(confidence);
    }
    return {{"keypoints", points}, {"keypoint_scores", scores}};
  }

  /// Tracks with further keys, of the capture and of the sequence. @return largest distance from this body, metres
  double distance(const std::string& keys, const std::string& keys_of_sequence) const {
    std::ofstream(root() / "capture.yaml")
        << "doppel_capture: 1\nname: tube\ncharacter: " << std::filesystem::relative(character_file_, root()).string()
        << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nkeypoint_map: map.yaml\n"
        << keys << "sequences:\n  - {name: walk, split: test, videos: 'mask_{name}_{frame}.png', "
        << "keypoints: 'people_{name}.json', cuts: [" << kCut << "]" << keys_of_sequence << "}\n";
    TrackOptions options;
    options.out = root() / "out";
    options.sheet_frames = 0;
    track_capture(*Footage::open(root(), options.config.fit.outline_pixels), options);
    const Motion motion = read_motion(options.out / "walk.motion", character_.num_dofs());
    double largest = 0.0;
    for (int frame = 0; frame < kFrames; ++frame) largest = std::max(largest, error(motion, frame));
    return largest;
  }
  std::string near(const Vector3d& shift) const {
    const Vector3d at = middle_of(character_) + shift;
    return fmt::format("person: {{near: [{}, {}, {}]}}", at.x(), at.y(), at.z());
  }
};

TEST_F(SeveralPeople, TheNamedOneIsTracked) {
  EXPECT_LT(distance(near(Vector3d::Zero()) + "\n", ""), 0.01);
  EXPECT_GT(distance(near(beside()) + "\n", ""), 0.8) << "the other one";
  EXPECT_LT(distance(near(beside()) + "\n", ", " + near(Vector3d::Zero())), 0.01) << "a sequence has its own";
}

TEST_F(SeveralPeople, TheMasksShowWhoIsTracked) { EXPECT_LT(distance("", ", masks: 'mask_{name}_{frame}.png'"), 0.01); }

}  // namespace
}  // namespace doppel::several_people_test
