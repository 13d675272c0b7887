#include "doppel/character/landmarks.h"

#include <gmock/gmock.h>

#include "doppel/core/atomic_file.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::landmarks_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

std::vector<double> some_pose(const Character& character) {
  std::vector<double> dofs = character.rest_dofs;
  for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += 0.1 * std::sin(1.0 + static_cast<double>(d));
  return dofs;
}

class Landmarks : public ::testing::Test {
 protected:
  std::vector<Marker> read(const std::string& text) const {
    support::write_bytes(file_, text);
    return read_landmarks(file_, character_);
  }
  std::string refusal(const std::string& text) const {
    return message_of<FileError>([&] { read(text); });
  }

  Character character_ = make_test_character();
  support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "landmarks.csv";
  std::string header_ = "index,name,joint,x_mm,y_mm,z_mm\n";
};

TEST_F(Landmarks, RideOnTheirJointFromTheRestPose) {
  const std::vector<Marker> landmarks = read(header_ + "0,nose,Seg4_rx,100,1500.5,-20\n1, heel ,Root_tx,0,0,0\n");
  ASSERT_EQ(landmarks.size(), 2u);
  EXPECT_EQ(landmarks[1].name, "heel");
  const Skeleton& skeleton = character_.skeleton;
  EXPECT_EQ(landmarks[0].joint, *skeleton.find_joint("Seg4_rx"));
  const Eigen::Vector3d at_rest(0.1, 1.5005, -0.02);
  const auto rest = skeleton.pose(character_.rest_dofs), posed = skeleton.pose(some_pose(character_));
  const Eigen::Vector3d expected =
      posed[landmarks[0].joint] * rest[landmarks[0].joint].inverse(Eigen::Isometry) * at_rest;
  EXPECT_LT((landmark_positions(skeleton, landmarks, character_.rest_dofs)[0] - at_rest).norm(), 1e-12);
  EXPECT_LT((landmark_positions(skeleton, landmarks, some_pose(character_))[0] - expected).norm(), 1e-12);
}

TEST_F(Landmarks, WrittenAndReadTheyAreTheSame) {
  const std::vector<Marker>& written = character_.skeleton.markers;
  write_landmarks(file_, character_, written);
  const std::vector<Marker> read_back = read_landmarks(file_, character_);
  ASSERT_EQ(read_back.size(), written.size());
  for (std::size_t m = 0; m < written.size(); ++m) {
    EXPECT_EQ(read_back[m].name, written[m].name);
    EXPECT_EQ(read_back[m].joint, written[m].joint);
    EXPECT_LT((read_back[m].position - written[m].position).norm(), 1e-9);
  }
}

TEST_F(Landmarks, KnowTheirNearestNode) {
  const std::vector<Marker>& markers = character_.skeleton.markers;
  const std::vector<int> nodes = nearest_nodes(character_, markers);
  const auto positions = landmark_positions(character_.skeleton, markers, character_.rest_dofs);
  ASSERT_EQ(nodes.size(), markers.size());
  for (std::size_t m = 0; m < markers.size(); ++m) {
    const auto distance = [&](int node) {
      return (character_.mesh.vertices[character_.graph.node_vertex[node]] - positions[m]).norm();
    };
    for (int k = 0; k < character_.num_nodes(); ++k) EXPECT_LE(distance(nodes[m]), distance(k));
  }
  EXPECT_NE(nodes.front(), nodes.back());
}

TEST_F(Landmarks, RefusedWithTheLineAndTheReason) {
  EXPECT_THAT(refusal("index,name\n"), HasSubstr("index,name,joint,x_mm,y_mm,z_mm"));
  EXPECT_THAT(refusal(header_), HasSubstr("no landmarks"));
  EXPECT_THAT(refusal(header_ + "0,nose,Seg4_rz,1,2,3\n1,ear,Seg4_rw,1,2,3\n"),
              AllOf(HasSubstr("landmarks.csv:3"), HasSubstr("did you mean Seg4_r")));
  EXPECT_THAT(refusal(header_ + "0,nose,Seg4_rz,1,2,3\n1,nose,Seg4_rz,1,2,3\n"), HasSubstr("stands twice"));
  EXPECT_THAT(refusal(header_ + "1,nose,Seg4_rz,1,2,3\n"), HasSubstr("index 1, expected 0"));
  EXPECT_THAT(refusal(header_ + "0,nose,Seg4_rz,1,2\n"), HasSubstr("5 columns"));
  EXPECT_THAT(refusal(header_ + "0,nose,Seg4_rz,1,2,nan\n"), HasSubstr("finite"));
  EXPECT_THAT(refusal(header_ + "0,,Seg4_rz,1,2,3\n"), HasSubstr("needs a name"));
  character_.graph = {};
  EXPECT_THAT(message_of<Error>([&] { nearest_nodes(character_, {}); }), HasSubstr("no graph"));
  EXPECT_THAT(message_of<Error>([&] {
                landmark_positions(character_.skeleton, {{"toe", 999, Eigen::Vector3d::Zero()}}, character_.rest_dofs);
              }),
              AllOf(HasSubstr("toe"), HasSubstr("999")));
}

TEST_F(Landmarks, SurviveHostileFiles) {
  write_landmarks(file_, character_, character_.skeleton.markers);
  support::expect_survives_hostile_files(file_, read_file(file_), [&](const std::filesystem::path& path) {
    for (const Marker& landmark : read_landmarks(path, character_)) EXPECT_TRUE(landmark.position.allFinite());
  });
}

class RealLandmarks : public support::SharedFolderTest {};

TEST_F(RealLandmarks, ThoseOfThePublishedCapture) {
  const Character character = load_character(character_file());
  const std::vector<Marker> landmarks = read_landmarks(capture_folder() / "landmarks.csv", character);
  ASSERT_EQ(landmarks.size(), 25u);
  EXPECT_EQ(landmarks[0].name, "Nose");
  EXPECT_EQ(character.skeleton.joints[landmarks[24].joint].name, "RightFoot_rz");
  const auto positions = landmark_positions(character.skeleton, landmarks, character.rest_dofs);
  EXPECT_LT((positions[0] - Eigen::Vector3d(0.44759, 1.62042, 0.36540)).norm(), 1e-12);
  // On the body: every landmark has a node within the length of a hand.
  const std::vector<int> nodes = nearest_nodes(character, landmarks);
  for (std::size_t m = 0; m < landmarks.size(); ++m)
    EXPECT_LT((character.mesh.vertices[character.graph.node_vertex[nodes[m]]] - positions[m]).norm(), 0.2)
        << landmarks[m].name;
}

}  // namespace
}  // namespace doppel::landmarks_test
