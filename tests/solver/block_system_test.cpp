#include "doppel/solver/block_system.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <random>

#include "doppel/solver/dense_system.h"

namespace doppel::block_system_test {
namespace {

constexpr int kBlocks = 12, kUnknowns = kBlocks * kBlockSize;

/// A chain of blocks: rows between neighbours, and rows that hold each block.
template <typename Rows, typename AddJacobian>
Rows chain(const RobustKernel& kernel, const AddJacobian& add_jacobian) {
  std::mt19937 generator(5);
  const auto number = [&] { return 2.0 * (static_cast<double>(generator()) / 4294967296.0) - 1.0; };
  Rows rows;
  rows.reset(kUnknowns, 2, kernel, true);
  for (int i = 0; i < 6 * kBlocks; ++i) {
    const Eigen::Index first = rows.add_group(0.5 + 0.1 * i);
    for (int r = 0; r < 2; ++r) {
      rows.value(first + r) = number();
      for (const int block : {i % kBlocks, (i + 1) % kBlocks})
        for (int u = 0; u < kBlockSize; ++u) add_jacobian(rows, first + r, block, u, number());
    }
  }
  return rows;
}

BlockSystem sparse(const RobustKernel& kernel, const BlockSystemOptions& options = {500, 1e-13}) {
  const auto rows = chain<BlockResiduals>(kernel, [](BlockResiduals& r, Eigen::Index row, int block, int u, double x) {
    r.jacobian(row).block(block)[u] += x;
  });
  BlockSystem system(options);
  system.reset(kUnknowns);
  system.add(rows);
  return system;
}

DenseSystem dense(const RobustKernel& kernel) {
  auto rows = chain<Residuals>(kernel, [](Residuals& r, Eigen::Index row, int block, int u, double x) {
    r.jacobian(row)[kBlockSize * block + u] += x;
  });
  DenseSystem system;
  system.reset(kUnknowns);
  system.add(rows);
  return system;
}

TEST(BlockSystem, IsTheDenseSystemWithoutItsMatrix) {
  for (const auto kind : {RobustKernel::Kind::none, RobustKernel::Kind::huber, RobustKernel::Kind::geman_mcclure}) {
    const RobustKernel kernel{kind, 0.6};
    const BlockSystem a = sparse(kernel);
    const DenseSystem b = dense(kernel);
    EXPECT_LT((a.gradient() - b.gradient()).norm(), 1e-12 * b.gradient().norm());
    const Eigen::VectorXd probe = Eigen::VectorXd::LinSpaced(kUnknowns, -1.0, 1.0);
    EXPECT_LT((a.product(probe) - b.product(probe)).norm(), 1e-12 * b.product(probe).norm());
    for (const double damping : {1e-3, 1.0}) {
      Eigen::VectorXd step, expected;
      ASSERT_TRUE(a.solve(damping, step));
      ASSERT_TRUE(b.solve(damping, expected));
      EXPECT_LT((step - expected).norm(), 1e-8 * expected.norm());
    }
  }
}

TEST(BlockSystem, LeadsDownhillHoweverFewStepsItTakes) {
  for (int iterations = 1; iterations < 6; ++iterations) {
    const BlockSystem system = sparse({}, {iterations, 0.0});
    Eigen::VectorXd step;
    ASSERT_TRUE(system.solve(1e-3, step));
    EXPECT_LT(step.dot(system.gradient()), 0.0);
  }
}

TEST(BlockSystem, WhatNoRowDependsOnStays) {
  BlockResiduals rows;
  rows.reset(3 * kBlockSize, 1, {}, true);
  rows.value(rows.add_group(2.0)) = 3.0;
  rows.jacobian(0).block(1)[4] = 1.0;
  EXPECT_EQ(rows.jacobian(0)[kBlockSize + 4], 1.0);
  EXPECT_EQ(rows.jacobian(0)[0], 0.0);
  BlockSystem system({50, 1e-12});
  system.reset(3 * kBlockSize);
  system.add(rows);
  Eigen::VectorXd step;
  ASSERT_TRUE(system.solve(0.0, step));
  EXPECT_NEAR(step[kBlockSize + 4], -3.0, 1e-9);
  step[kBlockSize + 4] = 0.0;
  EXPECT_EQ(step.norm(), 0.0);
  rows.value(0) = std::numeric_limits<double>::quiet_NaN();
  system.reset(3 * kBlockSize);
  system.add(rows);
  EXPECT_FALSE(system.solve(0.0, step));
}

}  // namespace
}  // namespace doppel::block_system_test
