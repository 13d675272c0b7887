// The examples of docs/character.md are files that Doppel reads, and mean what the page says.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/character/skinning_weights.h"
#include "support/temporary_folder.h"

namespace doppel::manual_test {
namespace {

/// The block of the page that begins with the line `header`.
std::string example_of(const std::string& header) {
  std::ostringstream page;
  page << std::ifstream(DOPPEL_SOURCE_DIR "/docs/character.md").rdbuf();
  const std::string text = page.str(), fence = "```text\n";
  const std::size_t begin = text.find(fence + header);
  if (begin == std::string::npos) throw std::runtime_error("docs/character.md has no example of " + header);
  const std::size_t first = begin + fence.size();
  return text.substr(first, text.find("```", first) - first);
}

class Manual : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& name, const std::string& header) const {
    std::ofstream(folder_ / name) << example_of(header);
    return folder_ / name;
  }

 private:
  support::TemporaryFolder folder_;
};

TEST_F(Manual, SkeletonAndMotion) {
  const Skeleton skeleton = read_skeleton(file("a.skeleton", "Skeletool Skeleton Definition V1.0"));
  ASSERT_EQ(skeleton.num_joints(), 2);
  ASSERT_EQ(skeleton.num_dofs(), 2);
  ASSERT_EQ(skeleton.markers.size(), 1u);
  EXPECT_EQ(skeleton.joints[skeleton.markers[0].joint].name, "Spine_rx");
  const Motion motion = read_motion(file("a.motion", "Skeletool Motion File V1.0"), skeleton.num_dofs());
  ASSERT_EQ(motion.num_frames(), 2);
  const std::vector<Eigen::Affine3d> pose = skeleton.pose(motion.frames[0]);
  EXPECT_NEAR(pose[0].translation().y(), 0.9, 1e-12) << "a Root_ty of 0.9 lifts the body by 900 mm";
  EXPECT_NEAR(pose[1].translation().y(), 1.025, 1e-12);
  EXPECT_NEAR(pose[1].linear()(2, 1), std::sin(0.1), 1e-12);
}

TEST_F(Manual, Skin) {
  const SkinningWeights skin = read_skin(file("a.skin", "Skeletool character skinning file V1.0"));
  EXPECT_EQ(skin.bones, (std::vector<std::string>{"Root", "Spine"}));
  ASSERT_EQ(skin.num_vertices(), 2);
  EXPECT_EQ(skin.weights, (std::vector<double>{0.56, 0.44, 1.0}));
}

}  // namespace
}  // namespace doppel::manual_test
