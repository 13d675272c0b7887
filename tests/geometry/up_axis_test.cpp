#include "doppel/geometry/up_axis.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "doppel/geometry/best_rotation.h"

namespace doppel::up_axis_test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(UpAxis, OfEverySignIsTurnedToY) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0}) {
      const Vector3d up = sign * Vector3d::Unit(axis);
      const Matrix3d turn = y_up_from_axis(up);
      EXPECT_TRUE((turn * up).isApprox(Vector3d::UnitY(), 1e-12));
      EXPECT_NEAR(turn.determinant(), 1.0, 1e-12);
    }
  // The usual turn of files with z up keeps x.
  EXPECT_TRUE((y_up_from_axis(Vector3d::UnitZ()) * Vector3d::UnitX()).isApprox(Vector3d::UnitX(), 1e-12));
}

TEST(UpAxis, NearestToADirectionHasItsSign) {
  const NearestAxis nearest = nearest_axis({0.3, -2.0, 0.4});
  EXPECT_EQ(nearest.axis, -Vector3d::UnitY());
  EXPECT_NEAR(nearest.cosine, 2.0 / std::sqrt(4.25), 1e-12);
  EXPECT_EQ(axis_name(nearest.axis), "-y");
  EXPECT_EQ(nearest_axis(Vector3d::Zero()).cosine, 0.0);
}

TEST(BestRotation, IsTheOneThatMadeTheDirections) {
  const Matrix3d made = Eigen::AngleAxisd(2.0, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  Eigen::Matrix3Xd from(3, 2);
  from << 1, 0.2, 0, 0.3, 0.5, 0;
  EXPECT_TRUE(best_rotation(from, made * from).isApprox(made, 1e-12));
}

}  // namespace
}  // namespace doppel::up_axis_test
