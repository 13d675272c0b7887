#include <gtest/gtest.h>

#include <map>

#include "doppel/core/as_size.h"
#include "support/rig_reference.h"

namespace doppel::real_bodies_test {
namespace {

class RealRiggedBodies : public support::RigReferenceTest {
 protected:
  double largest_error(const std::vector<Eigen::Vector3d>& posed) const {
    double largest = 0.0;
    for (std::size_t row = 0; 3 * row < ground_truth_.size(); ++row)
      largest = std::max(
          largest,
          (posed.at(as_size(vertex_of(row))) - Eigen::Map<const Eigen::Vector3d>(&ground_truth_[3 * row])).norm());
    return largest;
  }
};

TEST_P(RealRiggedBodies, VerticesAreWhereTheFileTakesThem) {
  const double metre = 1 / scene_.metres_per_unit.value();
  const auto world = node_transforms(scene_, animation(), reference_["time_s"].get<double>());
  EXPECT_LT(largest_error(posed_vertices(scene_, world)), 5e-6 * metre);
}

TEST_P(RealRiggedBodies, JointsAreWhereTheFileTakesThem) {
  const double metre = 1 / scene_.metres_per_unit.value();
  const auto world = node_transforms(scene_, animation(), reference_["time_s"].get<double>());
  std::map<std::string, std::size_t> node;
  for (std::size_t i = 0; i < scene_.nodes.size(); ++i) node[scene_.nodes[i].name] = i;
  for (const auto& [name, position] : reference_["joint_world"].items()) {
    ASSERT_TRUE(node.count(name)) << name;
    const Eigen::Vector3d ground_truth(position[0], position[1], position[2]);
    EXPECT_LT((world[node[name]].translation() - ground_truth).norm(), 5e-6 * metre) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Real, RealRiggedBodies, support::rig_references(),
                         [](const auto& body) { return std::string(body.param); });

}  // namespace
}  // namespace doppel::real_bodies_test
