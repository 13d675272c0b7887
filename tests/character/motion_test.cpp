#include "doppel/character/motion.h"

#include <gmock/gmock.h>

#include <cmath>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::motion_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class MotionFile : public ::testing::Test {
 protected:
  Motion read(const std::string& text, int num_dofs) {
    support::write_bytes(path_, text);
    return read_motion(path_, num_dofs);
  }
  std::string refusal(const std::string& text, int num_dofs) {
    return support::message_of<FileError>([&] { read(text, num_dofs); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "walk.motion";
};
using MotionReads = MotionFile;
using MotionWrites = MotionFile;
using MotionRejects = MotionFile;

TEST_F(MotionReads, RowsInFileOrderWithTheirIds) {
  const Motion m = read("Skeletool Motion File V1.0\n 0 0.25 -0.1 4e-1\n\n 1 1 2 -0", 3);
  EXPECT_THAT(m.ids, ElementsAre(0, 1));
  EXPECT_THAT(m.frames[0], ElementsAre(0.25, -0.1, 0.4));
  EXPECT_THAT(m.frames[1], ElementsAre(1.0, 2.0, 0.0));
}

TEST_F(MotionReads, WindowsLineEnds) {
  const Motion m = read("Skeletool Motion File V1.0\r\n 0 1 2\r\n 1 3 4\r\n", 2);
  EXPECT_THAT(m.frames[1], ElementsAre(3.0, 4.0));
}

TEST_F(MotionReads, TheOldVersionTurnsSignsBehindTheTranslation) {
  const Motion m = read("Skeletool Motion File V0.1\n0 1 2 3 4 -5\n", 5);
  EXPECT_THAT(m.frames[0], ElementsAre(1.0, 2.0, 3.0, -4.0, 5.0));
}

TEST_F(MotionReads, IdsThatSkipOrRepeatDoNotMoveRows) {
  const Motion m = read("Skeletool Motion File V1.0\n0 1\n5 2\n5 3\n", 1);
  EXPECT_THAT(m.ids, ElementsAre(0, 5, 5));
  EXPECT_THAT(m.frames[2], ElementsAre(3.0));
}

TEST_F(MotionReads, SurplusColumnsAreIgnored) {
  const Motion m = read("Skeletool Motion File V1.0\n0 1 2 3\n", 2);
  EXPECT_THAT(m.frames[0], ElementsAre(1.0, 2.0));
}

TEST_F(MotionReads, ARowMayBeLong) {
  std::string row = "0";
  for (int d = 0; d < 2000; ++d) row += "          " + std::to_string(d);
  EXPECT_EQ(read("Skeletool Motion File V1.0\n" + row, 2000).frames[0][1999], 1999.0);
}

TEST_F(MotionWrites, ExactlyWhatIsReadBack) {
  const Motion written{{{1.0 / 3.0, -2e-17, 12345.678901234567}, {0.1, 0.2, 0.3}}, {3, 4}};
  write_motion(path_, written, true);
  const Motion m = read_motion(path_, 3);
  EXPECT_EQ(m.frames, written.frames);
  EXPECT_EQ(m.ids, written.ids);
}

TEST_F(MotionWrites, NineDigitsByDefaultAndIdsFromZero) {
  write_motion(path_, Motion{{{1.0 / 3.0}, {2.0}}, {}});
  EXPECT_EQ(read_file(path_), "Skeletool Motion File V1.0\n0 0.333333333\n1 2\n");
}

TEST_F(MotionWrites, NothingThatCouldNotBeReadBack) {
  EXPECT_THROW(write_motion(path_, Motion{{{std::nan("")}}, {0}}), Error);
  EXPECT_THROW(write_motion(path_, Motion{{{1.0}}, {0, 1}}), Error);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(MotionRejects, EachFaultWithItsLineAndReason) {
  const std::string header = "Skeletool Motion File V1.0\n";
  EXPECT_THAT(refusal(header, 2), HasSubstr("no frames"));
  EXPECT_THAT(refusal("Skeletool Motion File V2.0\n0 1 2\n", 2), HasSubstr("motion:1: unsupported version"));
  EXPECT_THAT(refusal("BVH\n0 1 2\n", 2), HasSubstr("motion:1: not a motion file"));
  EXPECT_THAT(refusal(header + "0 1 2\n1 3\n", 2), HasSubstr("motion:3: the row has 1 values"));
  EXPECT_THAT(refusal(header + "0 1 nan\n", 2), HasSubstr("motion:2:"));
  EXPECT_THAT(refusal(header + "0 1 inf\n", 2), HasSubstr("motion:2:"));
  EXPECT_THAT(refusal(header + "0 1 2x\n", 2), HasSubstr("motion:2:"));
  EXPECT_THAT(refusal(header + "-1 1 2\n", 2), HasSubstr("motion:2:"));
  EXPECT_THAT(refusal(header + "0.5 1 2\n", 2), HasSubstr("motion:2:"));
  EXPECT_THROW(read_motion(folder_.path() / "none.motion", 2), FileError);
}

}  // namespace
}  // namespace doppel::motion_test
