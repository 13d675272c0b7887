#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "doppel/autorig/find_joints.h"
#include "doppel/rigging/place_inside.h"
#include "support/blazepose_weights.h"

namespace doppel::real_bodies_test {
namespace {

namespace fs = std::filesystem;

class RealBodies : public support::BlazePoseTest {
 protected:
  fs::path folder(const std::string& body) const { return shared_ / "bodies" / body; }

  /// Distances of the found from the true limb joints, millimetres.
  std::vector<double> errors(const std::string& body) const {
    const TriangleMesh mesh = read_obj(folder(body) / "body.obj", 1.0);
    FoundJoints found = find_joints(mesh);
    place_inside(found.joints, solid_grid(VoxelSolid(mesh)));
    const auto truth = nlohmann::json::parse(std::ifstream(folder(body) / "truth.json"))["landmarks"];
    std::vector<double> distances;
    for (const std::string& name : limb_joint_names()) {
      const std::string key = name.substr(0, 1) + name.substr(name.find('_'));
      if (truth[key].is_null()) continue;
      const Eigen::Vector3d expected(truth[key][0], truth[key][1], truth[key][2]);
      distances.push_back(1e3 * (found.joints.at(name) - expected).norm());
    }
    return distances;
  }
};

// The goal for bodies of realistic shape: the median within 25 mm, the worst joint within 60 mm.
TEST_F(RealBodies, JointsAreFoundInPictures) {
  for (const char* body :
       {"m2m_female", "m2m_male_apose", "mh_girl_dress", "mh_man_old_suit", "mh_man_workwear", "mh_woman_slim"}) {
    std::vector<double> found = errors(body);
    ASSERT_EQ(found.size(), 12u) << body;
    std::sort(found.begin(), found.end());
    RecordProperty(std::string(body) + "_median_mm", std::to_string(0.5 * (found[5] + found[6])));
    RecordProperty(std::string(body) + "_worst_mm", std::to_string(found.back()));
    EXPECT_LE(0.5 * (found[5] + found[6]), 25.0) << body;
    EXPECT_LE(found.back(), 60.0) << body;
  }
}

}  // namespace
}  // namespace doppel::real_bodies_test
