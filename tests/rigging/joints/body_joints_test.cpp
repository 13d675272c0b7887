#include "doppel/rigging/joints/body_joints.h"

#include <gmock/gmock.h>

#include "rigging/plain_body.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::body_joints_test {
namespace {

using Eigen::Vector3d;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(BodyJoints, NamesAreTheContract) {
  EXPECT_EQ(body_joint_names().size(), 21u);
  EXPECT_EQ(limb_joint_names().size(), 12u);
  EXPECT_EQ(other_side("left_knee"), "right_knee");
  EXPECT_EQ(other_side("right_knee"), "left_knee");
  EXPECT_EQ(other_side("pelvis"), "pelvis");
}

TEST(BodyJoints, MissingJointsAreAddedAndGivenOnesStay) {
  BodyJoints joints = support::plain_body(), all = joints;
  complete_joints(all);
  for (const auto& [name, position] : joints.positions) EXPECT_EQ(all.at(name), position) << name;
  for (const std::string& name : body_joint_names()) ASSERT_TRUE(all.has(name)) << name;
  EXPECT_THAT(examine_joints(all), IsEmpty());
  // The body looks along +z.
  EXPECT_GT(all.at("left_toe").z(), all.at("left_ankle").z() + 0.1);
  EXPECT_GT(all.at("left_clavicle").x(), 0.0);
  EXPECT_LT(all.at("right_clavicle").x(), 0.0);
  joints.positions.erase("left_knee");
  EXPECT_THAT(support::message_of([&] { complete_joints(joints); }), HasSubstr("left_knee"));
}

TEST(BodyJoints, FramesFollowTheBody) {
  const BodyJoints joints = support::plain_body();
  const Eigen::AngleAxisd turn(1.1, Vector3d::UnitY());
  BodyJoints turned = joints;
  for (auto& entry : turned.positions) entry.second = turn * entry.second;
  EXPECT_LT((pelvis_frame(joints).forward - Vector3d::UnitZ()).norm(), 0.02);
  EXPECT_LT((pelvis_frame(turned).forward - turn * pelvis_frame(joints).forward).norm(), 1e-12);
  EXPECT_LT((chest_frame(turned).left - turn * chest_frame(joints).left).norm(), 1e-12);
}

TEST(BodyJoints, SwappedSidesAreFound) {
  const BodyJoints good = support::plain_body();
  BodyJoints arms = good;
  std::swap(arms.positions["left_elbow"], arms.positions["right_elbow"]);
  EXPECT_THAT(examine_joints(arms), Contains(HasSubstr("elbow are swapped")));
  BodyJoints shoulders = good;
  for (const char* part : {"shoulder", "elbow", "wrist"})
    std::swap(shoulders.positions[std::string("left_") + part], shoulders.positions[std::string("right_") + part]);
  EXPECT_THAT(examine_joints(shoulders), Contains(HasSubstr("shoulders face against the hips")));
  BodyJoints all = good;
  complete_joints(all);
  for (const std::string& name : body_joint_names())
    if (name.starts_with("left_")) std::swap(all.positions[name], all.positions[other_side(name)]);
  EXPECT_THAT(examine_joints(all), Contains(HasSubstr("feet point backwards")));
}

TEST(BodyJoints, WrongLengthsAreFound) {
  BodyJoints joints = support::plain_body();
  joints.positions["left_wrist"] += Vector3d(0.6, 0, 0);
  EXPECT_THAT(examine_joints(joints), Contains(HasSubstr("left_elbow to left_wrist")));
  joints = support::plain_body();
  joints.positions["left_wrist"].x() = std::nan("");
  EXPECT_THAT(examine_joints(joints), Contains(HasSubstr("left_wrist has no finite position")));
}

class JointsFiles : public ::testing::Test {
 protected:
  std::string refusal(const std::string& text) {
    support::write_bytes(path_, text);
    return support::message_of([&] { read_joints(path_); });
  }
  support::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "joints.json";
};

TEST_F(JointsFiles, AreWrittenInTheUnitOfTheScan) {
  JointsFile file;
  file.joints = support::plain_body();
  file.file_from_character =
      Eigen::Translation3d(12, -30, 0) * Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitX()) * Eigen::Scaling(100.0);
  write_joints(path_, file);
  const JointsFile read = read_joints(path_);
  EXPECT_TRUE(read.file_from_character.isApprox(file.file_from_character, 1e-12));
  ASSERT_EQ(read.joints.positions.size(), file.joints.positions.size());
  for (const auto& [name, position] : file.joints.positions)
    EXPECT_LT((read.joints.at(name) - position).norm(), 1e-6) << name;
}

TEST_F(JointsFiles, HoldFingers) {
  JointsFile file;
  file.joints = support::plain_body();
  for (const char* side : {"left_", "right_"})
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k)
        file.joints.positions[finger_point(side, finger, k)] = {0.1 * k, side[0] == 'l' ? 1.0 : 2.0, 0.3};
  write_joints(path_, file);
  EXPECT_EQ(read_joints(path_).joints.positions, file.joints.positions);
}

TEST_F(JointsFiles, UnderstandShortNamesNullAndTheScansOwnMatrix) {
  support::write_bytes(path_, R"({"joints": {"l_knee": [100, 200, 300], "r_toe": null}})");
  const JointsFile read = read_joints(path_, Eigen::Affine3d(Eigen::Scaling(1000.0)));
  EXPECT_LT((read.joints.at("left_knee") - Vector3d(0.1, 0.2, 0.3)).norm(), 1e-12);
  EXPECT_FALSE(read.joints.has("right_toe"));
}

TEST_F(JointsFiles, RefuseWhatTheyCannotMean) {
  const std::string unit = R"("file_from_character": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";
  EXPECT_THAT(refusal("{"), HasSubstr("not a JSON file"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("\"joints\""));
  EXPECT_THAT(refusal(R"({"joints": {"pelvis": [0, 1, 0]}})"), HasSubstr("'file_from_character' is missing"));
  EXPECT_THAT(refusal("{" + unit + R"(, "joints": {"left_elbw": [0, 1, 0]}})"), HasSubstr("did you mean left_elbow"));
  EXPECT_THAT(refusal("{" + unit + R"(, "joints": {"pelvis": [0, 1]}})"), HasSubstr("3 finite numbers"));
  EXPECT_THAT(refusal("{" + unit + R"(, "joints": {"l_hip": [0, 1, 0], "left_hip": [0, 1, 0]}})"),
              HasSubstr("stands twice"));
  EXPECT_THAT(refusal(R"({"file_from_character": [[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]], "joints": {}})"),
              HasSubstr("without a mirror"));
  EXPECT_THAT(refusal(R"({"file_from_character": [[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]], "joints": {}})"),
              HasSubstr("one scale"));
}

}  // namespace
}  // namespace doppel::body_joints_test
