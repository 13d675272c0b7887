#pragma once

#include <array>
#include <vector>

#include "doppel/solver/residuals.h"

namespace doppel {

/// The number of unknowns in a block: the rotation and the translation of a graph node.
constexpr int kBlockSize = 6;
using Block = Eigen::Matrix<double, kBlockSize, 1>;

/// Rows that each depend on a few of thousands of blocks of unknowns. They are written one after the other.
class BlockResiduals : public ResidualRows {
 public:
  /// Removes all rows. @param num_unknowns a multiple of kBlockSize @param jacobian as for `Residuals`
  void reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian);
  /// Adds a group of zero rows. @return the index of its first row
  Eigen::Index add_group(double weight);

  /// One row of the jacobian.
  class JacobianRow {
   public:
    JacobianRow(BlockResiduals& rows, Eigen::Index row) : rows_(rows), row_(row) {}
    /// d value / d the unknowns of a block, zero at first. Callers add to it.
    Block& block(int index) { return rows_.block(row_, index); }
    double operator[](Eigen::Index unknown) const;

   private:
    BlockResiduals& rows_;
    Eigen::Index row_;
  };
  /// Rows are written in ascending order: after a row has a block, earlier rows accept no further blocks.
  JacobianRow jacobian(Eigen::Index row) { return {*this, row}; }

 private:
  friend class BlockSystem;
  struct Entry {
    int block;
    Block jacobian;
  };
  Block& block(Eigen::Index row, int index);
  std::size_t begin_of(Eigen::Index row) const;
  std::size_t end_of(Eigen::Index row) const;
  std::vector<std::size_t> begin_;  ///< [rows begun so far] into entries_
  std::vector<Entry> entries_;
};

struct BlockSystemOptions {
  int iterations = 100;     ///< largest number of conjugate-gradient iterations
  double tolerance = 1e-3;  ///< on the length of the residual, relative to the length of the gradient
};

/// Normal equations of thousands of unknowns in blocks of six. The matrix is never formed: conjugate gradients,
/// preconditioned with the diagonal blocks, multiply with J and J^T. The class does not depend on the character.
class BlockSystem {
 public:
  explicit BlockSystem(const BlockSystemOptions& options = {}) : options_(options) {}
  void reset(Eigen::Index num_unknowns);
  /// Adds the rows of a term, weighted under its kernel.
  void add(const BlockResiduals& residuals);

  /// Solves (H + damping diag(H)) step = -gradient to within the tolerance. An unknown on which no row depends keeps
  /// its value. The step is a descent direction after any number of iterations.
  /// @return false when a number is not finite
  bool solve(double damping, Eigen::VectorXd& step) const;

  /// H x
  Eigen::VectorXd product(const Eigen::VectorXd& x) const;
  const Eigen::VectorXd& gradient() const { return gradient_; }

 private:
  struct Damped;
  using SquareBlock = Eigen::Matrix<double, kBlockSize, kBlockSize>;
  std::vector<SquareBlock> inverse_blocks(double damping) const;
  Eigen::VectorXd diagonal(double damping) const;

  BlockSystemOptions options_;
  Eigen::VectorXd gradient_;
  std::vector<SquareBlock> blocks_;             ///< on the diagonal of H
  std::vector<std::size_t> begin_{0};           ///< [rows + 1]
  std::vector<BlockResiduals::Entry> entries_;  ///< of J, scaled
};

}  // namespace doppel
