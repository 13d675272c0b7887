#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/read_space_points.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::space_points_test {
namespace {

using support::message_of;
using support::replaced;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kTrc[] =
    "PathFileType\t4\t(X/Y/Z)\twalk.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t2\t2\tmm\t100\t1\t2\n"
    "Frame#\tTime\tRHip\t\t\tHead\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "\n"
    "1\t0.00\t100\t900.5\t-20\t1\t2\t3\n"
    "2\t0.01\t101\t900\t-21\t\t\t\n";
constexpr char kCaliscope[] =
    ",sync_index,point_id,x_coord,y_coord,z_coord\n"
    "0,3,0,0.25,0.5,1.0\n"
    "1,3,12,1,2,3\n"
    "2,4,0,0.5,0.5,1.0\n";
constexpr char kLifted[] = R"([{"frame_id":0,"instances":[{"keypoints":[[0.5,1,2],[3,4,5]],"keypoint_scores":[1,1]}]},)"
                           R"({"frame_id":1,"instances":[]}])";

class SpacePointFiles : public ::testing::Test {
 protected:
  SpacePoints read(const std::string& text) const {
    support::write_bytes(file_, text);
    return read_space_points(file_);
  }
  std::string refusal(const std::string& from, const std::string& to) const {
    return message_of<FileError>([&] { read(replaced(kTrc, from, to)); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "points.any";
};

TEST_F(SpacePointFiles, OfTrcBecomeMetres) {
  for (const std::string& text : {std::string(kTrc), support::with_crlf(kTrc), replaced(kTrc, "\t\t\t\n", "\n")}) {
    const SpacePoints points = read(text);
    EXPECT_EQ(points.format, "trc");
    EXPECT_EQ(points.unit, "mm");
    EXPECT_EQ(points.rate, 100.0);
    EXPECT_THAT(points.names, ElementsAre("RHip", "Head"));
    ASSERT_EQ(points.frames.size(), 2u);
    EXPECT_TRUE(points.frames.at(1)[0]->isApprox(Eigen::Vector3d(0.1, 0.9005, -0.02)));
    EXPECT_TRUE(points.frames.at(2)[0].has_value());
    EXPECT_FALSE(points.frames.at(2)[1].has_value());
  }
  EXPECT_TRUE(read(replaced(kTrc, "\tmm\t", "\tm\t")).frames.at(1)[1]->isApprox(Eigen::Vector3d(1, 2, 3)));
}

TEST_F(SpacePointFiles, OfCaliscopeAreMetres) {
  const SpacePoints points = read(kCaliscope);
  EXPECT_EQ(points.unit, "m");
  EXPECT_THAT(points.names, ElementsAre("0", "12"));
  EXPECT_TRUE(points.frames.at(3)[1]->isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_FALSE(points.frames.at(4)[1].has_value()) << "without a row";
  const SpacePoints newer =
      read("sync_index,object_id,keypoint_id,x_coord,y_coord,z_coord,frame_time\n35,0,7,1,2,3,\n");
  EXPECT_TRUE(newer.frames.at(35)[0]->isApprox(Eigen::Vector3d(1, 2, 3)));
  EXPECT_THAT(newer.names, ElementsAre("7"));
}

TEST_F(SpacePointFiles, OfALifterAreThoseOfTheFirstPerson) {
  const SpacePoints points = read(kLifted);
  EXPECT_EQ(points.format, "mmpose");
  EXPECT_TRUE(points.frames.at(0)[1]->isApprox(Eigen::Vector3d(3, 4, 5)));
  EXPECT_FALSE(points.frames.at(1)[1].has_value());
}

TEST_F(SpacePointFiles, ThatCannotBeAreRefused) {
  EXPECT_THAT(refusal("mm", "inches"), AllOf(HasSubstr("points.any:3"), HasSubstr("inches"), HasSubstr("cm")));
  EXPECT_THAT(refusal("Head", "RHip"), AllOf(HasSubstr("points.any:4"), HasSubstr("twice")));
  EXPECT_THAT(refusal("2\t0.01", "1\t0.01"), AllOf(HasSubstr("points.any:8"), HasSubstr("twice")));
  EXPECT_THAT(refusal("900.5", "9x"), AllOf(HasSubstr("points.any:7"), HasSubstr("9x")));
  EXPECT_THAT(refusal("900.5", "1e30"), HasSubstr("100 km"));
  EXPECT_THAT(refusal("1\t2\t3\n", "1\t2\t3\t4\n"), HasSubstr("columns"));
  EXPECT_THAT(message_of<FileError>([&] { read("words\n"); }), HasSubstr("TRC"));
  EXPECT_THROW(read(replaced(kCaliscope, "1,3,12", "1,3,0")), FileError);
  EXPECT_THROW(read(replaced(kCaliscope, "y_coord", "w_coord")), FileError);
  EXPECT_THROW(read("[]"), FileError);
}

TEST_F(SpacePointFiles, SurviveHostileFiles) {
  for (const char* valid : {kTrc, kCaliscope, kLifted})
    support::expect_survives_hostile_files(file_, valid, [](const std::filesystem::path& path) {
      const SpacePoints points = read_space_points(path);
      for (const auto& [frame, found] : points.frames) {
        EXPECT_EQ(found.size(), points.names.size());
        for (const auto& point : found) EXPECT_TRUE(!point || point->allFinite());
      }
    });
}

}  // namespace
}  // namespace doppel::space_points_test
