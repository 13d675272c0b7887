#include "doppel/track/shape/place_landmarks.h"

#include <gmock/gmock.h>

#include "doppel/character/landmark_positions.h"
#include "doppel/core/error.h"
#include "doppel/track/track_capture.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::place_landmarks_test {
namespace {

const int kPixels = TrackConfig().fit.outline_pixels;

/// The placement file has the landmarks 3 cm from where the detector sees them.
class OtherDetector : public TrackCapture {
 protected:
  OtherDetector() {
    std::vector<Marker> others = landmarks_;
    for (std::size_t m = 0; m < others.size(); ++m)
      others[m].position +=
          0.03 * Eigen::Vector3d(std::sin(2.0 * m), std::cos(3.0 * m), std::sin(5.0 * m)).normalized();
    write_landmarks(root() / "landmarks.csv", character_, others);
  }

  double mean_distance(const std::vector<Marker>& landmarks) const {
    double sum = 0.0;
    for (std::size_t m = 0; m < landmarks.size(); ++m)
      sum += (landmarks[m].position - landmarks_[m].position).norm() / static_cast<double>(landmarks.size());
    return sum;
  }
};

TEST_F(OtherDetector, LandmarksMoveToWhereTheDetectorSeesThem) {
  const auto footage = Footage::open(root(), kPixels);
  EXPECT_NEAR(mean_distance(footage->landmarks()), 0.03, 1e-6);
  const std::vector<Marker> placed = place_landmarks(*footage, footage->sequences(), {}, 8);
  ASSERT_EQ(placed.size(), landmarks_.size());
  EXPECT_LT(mean_distance(placed), 0.015);
  for (std::size_t m = 0; m < placed.size(); ++m) EXPECT_EQ(placed[m].joint, landmarks_[m].joint);

  write_landmarks(root() / "placed.csv", character_, placed);
  const auto with_positions = Footage::open_with_landmarks(root() / "placed.csv", root(), kPixels);
  EXPECT_EQ(with_positions->capture().landmarks, (root() / "placed.csv").string());
  TrackOptions options;
  options.out = root() / "out";
  const double before = track_capture(*footage, options).sequences[0].keypoint_error();
  const double after = track_capture(*with_positions, options).sequences[0].keypoint_error();
  EXPECT_LT(after, 0.5 * before);
}

TEST_F(OtherDetector, APreparedFolderIsRefused) {
  std::filesystem::create_directories(root() / "prepared/store");
  const auto message = support::message_of<UsageError>(
      [&] { Footage::open_with_landmarks(root() / "landmarks.csv", root() / "prepared", kPixels); });
  EXPECT_THAT(message, ::testing::HasSubstr("give the capture itself"));
}

TEST_F(OtherDetector, AFamilyOfPositionsShiftsMarkers) {
  const LandmarkPositions family(with_markers(character_, landmarks_), {landmarks_[1].name});
  ASSERT_EQ(family.num_parameters(), 3);
  const Character same = family.character(family.mean());
  const Character moved = family.character(std::vector<double>{0.01, 0.0, -0.02});
  const auto at = [&](const Character& character) {
    return markers_named(character.skeleton, {landmarks_[1].name})[0].position;
  };
  EXPECT_EQ(at(same), landmarks_[1].position);
  EXPECT_LT((at(moved) - landmarks_[1].position - Eigen::Vector3d(0.01, 0.0, -0.02)).norm(), 1e-12);
  EXPECT_EQ(moved.mesh.vertices, character_.mesh.vertices);
  EXPECT_THROW(family.character(std::vector<double>{0.0}), UsageError);
  EXPECT_THAT(support::message_of<Error>([&] { LandmarkPositions(character_, {"tail"}); }),
              ::testing::HasSubstr("no marker tail"));
}

}  // namespace
}  // namespace doppel::place_landmarks_test
