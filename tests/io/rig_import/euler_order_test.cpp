#include "doppel/io/rig_import/euler_order.h"

#include <gtest/gtest.h>

namespace doppel::euler_order_test {
namespace {

const EulerOrder kAll[] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};

Eigen::Matrix3d turned(const EulerOrder& order, const Eigen::Vector3d& angles) {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i)
    rotation =
        rotation *
        Eigen::AngleAxisd(angles[i], Eigen::Vector3d::Unit(order[static_cast<std::size_t>(i)])).toRotationMatrix();
  return rotation;
}

TEST(EulerOrder, AnglesGiveTheRotationBackInEveryOrder) {
  for (const EulerOrder& order : kAll)
    for (const Eigen::Vector3d& angles : {Eigen::Vector3d(0.3, -1.2, 2.0), Eigen::Vector3d(-3.0, 1.5, 0.1),
                                          Eigen::Vector3d(1.0, M_PI / 2, 0.4), Eigen::Vector3d(1.0, -M_PI / 2, 0.4)}) {
      const Eigen::Matrix3d rotation = turned(order, angles);
      const Eigen::Vector3d found = euler_angles(rotation, order, Eigen::Vector3d(0.2, 0, 0.1));
      EXPECT_LT((turned(order, found) - rotation).norm(), 1e-7);
      EXPECT_LT((euler_angles(rotation, order, angles) - angles).norm(), 1e-6);
    }
}

TEST(EulerOrder, AnglesGoOnWithoutAJump) {
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (int i = 0; i <= 100; ++i) {
    const Eigen::Vector3d ground_truth(0.08 * i, 0.5, -0.03 * i);
    const Eigen::Vector3d found = euler_angles(turned({1, 2, 0}, ground_truth), {1, 2, 0}, before);
    EXPECT_LT((found - ground_truth).norm(), 1e-9) << i;
    before = found;
  }
}

TEST(EulerOrder, AnotherOrderIsTakenNearThePole) {
  const Eigen::Quaterniond raised(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  EXPECT_EQ(choose_euler_order({Eigen::Quaterniond::Identity()}, {0, 2, 1}), (EulerOrder{0, 2, 1}));
  EXPECT_NE(choose_euler_order({raised}, {0, 2, 1})[1], 2);
}

}  // namespace
}  // namespace doppel::euler_order_test
