#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cmath>

#include "doppel/character/character.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "support/hostile_files.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::hostile_test {
namespace {

namespace fs = std::filesystem;

/// Every reader of this module on spoilt versions of a good file: an Error that names the file or a valid result,
/// nothing else.
class HostileRejects : public ::testing::Test {
 protected:
  void SetUp() override {
    spdlog::set_level(spdlog::level::off);  // warnings are expected here by the hundred
    character_ = make_test_character(3, 4, 6);
    character_file_ = write_character(folder_.path(), character_);
  }
  void TearDown() override { spdlog::set_level(spdlog::level::info); }

  void expect_survives(const std::string& name, const std::function<void(const fs::path&)>& read) {
    support::expect_survives_hostile_files(folder_.path() / name, read_file(folder_.path() / name), read);
  }

  Character character_;
  support::TemporaryFolder folder_;
  fs::path character_file_;
};

TEST_F(HostileRejects, Skeletons) {
  expect_survives("tube.skeleton", [](const fs::path& path) {
    const Skeleton skeleton = read_skeleton(path);
    for (int j = 0; j < skeleton.num_joints(); ++j) {
      EXPECT_LT(skeleton.joints[j].parent, j);
      EXPECT_TRUE(skeleton.joints[j].offset.allFinite() && skeleton.joints[j].axis.allFinite());
    }
    for (const auto& transform : skeleton.pose(std::vector<double>(skeleton.num_dofs(), 0.01)))
      EXPECT_FALSE(transform.matrix().hasNaN());
  });
}

TEST_F(HostileRejects, Skins) {
  expect_survives("tube.skin", [](const fs::path& path) {
    const SkinningWeights skin = read_skin(path);
    for (int v = 0; v < skin.num_vertices(); ++v) {
      double sum = 0.0;
      for (int i = skin.vertex_bones.offsets[v]; i < skin.vertex_bones.offsets[v + 1]; ++i) {
        EXPECT_LT(skin.vertex_bones.items[i], skin.num_bones());
        sum += skin.weights[i];
      }
      EXPECT_NEAR(sum, 1.0, 1e-9);
    }
  });
}

TEST_F(HostileRejects, Motions) {
  const int num_dofs = character_.num_dofs();
  expect_survives("tube.motion", [&](const fs::path& path) {
    for (const auto& frame : read_motion(path, num_dofs).frames) {
      EXPECT_EQ(static_cast<int>(frame.size()), num_dofs);
      for (const double value : frame) EXPECT_TRUE(std::isfinite(value));
    }
  });
}

TEST_F(HostileRejects, Segmentations) {
  const int n = character_.num_vertices();
  expect_survives("segmentation.txt", [&](const fs::path& path) {
    const auto labels = read_segmentation(path, n);
    EXPECT_EQ(static_cast<int>(labels.size()), n);
  });
}

TEST_F(HostileRejects, Characters) {
  expect_survives("tube.character", [&](const fs::path& path) {
    EXPECT_EQ(load_character(path).num_vertices(), character_.num_vertices());
  });
}

}  // namespace
}  // namespace doppel::hostile_test
