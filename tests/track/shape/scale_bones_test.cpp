#include "doppel/track/shape/scale_bones.h"

#include <gmock/gmock.h>

#include "doppel/character/bone_scales.h"
#include "doppel/core/error.h"
#include "doppel/track/track_capture.h"
#include "support/message_of.h"
#include "track/tube_capture.h"

namespace doppel::scale_bones_test {
namespace {

const int kPixels = TrackConfig().fit.outline_pixels;

/// The capture names a character with other bone lengths than the person that was filmed.
class StrangersCharacter : public TrackCapture {
 protected:
  StrangersCharacter() {
    Character person = character_;
    person.skeleton.markers = landmarks_;
    const Character stranger = BoneScales(person).character(kFactors);
    write_character(character_file_.parent_path(), stranger);
    write_landmarks(root() / "landmarks.csv", stranger, stranger.skeleton.markers);
  }
  const std::vector<double> kFactors{0.8, 1.25, 0.9};
};

TEST_F(StrangersCharacter, GetsTheLengthsOfThePerson) {
  const auto footage = Footage::open(root(), kPixels);
  const ScaledCharacter scaled = scale_bones(*footage, footage->sequences(), {}, 6);
  ASSERT_EQ(scaled.factors.size(), kFactors.size());
  for (std::size_t i = 0; i < kFactors.size(); ++i)
    EXPECT_NEAR(scaled.factors[i].second * kFactors[i], 1.0, i == 2 ? 0.02 : 0.1)
        << scaled.factors[i].first << "; a sliding joint lies between the first two";

  const auto with_lengths = Footage::open_for(scaled.character, root() / "scaled.character", root(), kPixels);
  EXPECT_EQ(with_lengths->landmarks().size(), landmarks_.size());
  EXPECT_EQ(with_lengths->capture().character, (root() / "scaled.character").string());
  TrackOptions options;
  options.out = root() / "out";
  const double before = track_capture(*footage, options).sequences[0].keypoint_error();
  const double after = track_capture(*with_lengths, options).sequences[0].keypoint_error();
  EXPECT_LT(after, 0.25 * before);
}

TEST_F(StrangersCharacter, APreparedFolderIsRefused) {
  std::filesystem::create_directories(root() / "prepared/store");
  const auto message = support::message_of<UsageError>(
      [&] { Footage::open_for(character_, "a.character", root() / "prepared", kPixels); });
  EXPECT_THAT(message, ::testing::HasSubstr("give the capture itself"));
}

}  // namespace
}  // namespace doppel::scale_bones_test
