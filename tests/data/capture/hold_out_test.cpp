#include "doppel/data/capture/hold_out.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::hold_out_test {
namespace {

using ::testing::HasSubstr;

SequenceEntry sequence(const std::string& name, Split split, long first, long last) {
  SequenceEntry entry;
  entry.name = name;
  entry.split = split;
  entry.first_frame = first;
  entry.last_frame = last;
  return entry;
}

CaptureCameras two_cameras() {
  CaptureCameras cameras;
  cameras.cameras.resize(2);
  cameras.file_index = {0, 1};
  return cameras;
}

TEST(HoldOut, KeepsBackTheEndOfATrainingSequence) {
  Capture capture;
  capture.sequences = {sequence("walk", Split::train, 10, 109)};
  capture.sequences[0].cuts = {50, 95};
  const Capture divided = hold_out(capture, two_cameras());
  ASSERT_EQ(divided.sequences.size(), 3u);
  const SequenceEntry &train = divided.sequences[0], &validation = divided.sequences[1], &test = divided.sequences[2];
  EXPECT_EQ(train.name, "walk");
  EXPECT_EQ(validation.name, "walk_validation");
  EXPECT_EQ(test.name, "walk_test");
  EXPECT_EQ(train.first_frame, 10);
  EXPECT_EQ(train.last_frame, 79);
  EXPECT_EQ(validation.first_frame, 80);
  EXPECT_EQ(validation.last_frame, 89);
  EXPECT_EQ(test.first_frame, 90);
  EXPECT_EQ(test.last_frame, 109);
  EXPECT_EQ(train.cuts, std::vector<long>{50});
  EXPECT_EQ(test.cuts, std::vector<long>{95});
}

TEST(HoldOut, LeavesASplitThatExists) {
  Capture capture;
  capture.sequences = {sequence("walk", Split::train, 0, 99), sequence("dance", Split::test, 0, 9)};
  const Capture divided = hold_out(capture, two_cameras());
  ASSERT_EQ(divided.sequences.size(), 3u);
  EXPECT_EQ(divided.sequences[0].last_frame, 89);
  EXPECT_EQ(divided.sequences[1].name, "walk_validation");
  EXPECT_EQ(divided.sequences[2].name, "dance");
}

TEST(HoldOut, ShortSequencesStayWhole) {
  Capture capture;
  capture.sequences = {sequence("nod", Split::train, 0, kMinDividedRows - 2)};
  EXPECT_EQ(hold_out(capture, two_cameras()).sequences.size(), 1u);
}

TEST(HoldOut, RefusesSharesThatLeaveNothing) {
  Capture capture;
  capture.sequences = {sequence("walk", Split::train, 0, 99)};
  EXPECT_THAT(support::message_of<UsageError>([&] {
                hold_out(capture, two_cameras(), {0.5, 0.5});
              }),
              HasSubstr("allowed is 0 to less than 1"));
}

}  // namespace
}  // namespace doppel::hold_out_test
