#pragma once

#include <array>
#include <vector>

#include "doppel/solver/residuals.h"

namespace doppel {

/// Unknowns that come in blocks of so many: the nodes of a graph with a rotation and a translation each.
constexpr int kBlockSize = 6;
using Block = Eigen::Matrix<double, kBlockSize, 1>;

/// Rows that depend on few blocks of thousands of unknowns. They are filled in one after the other.
class BlockResiduals : public ResidualRows {
 public:
  /// Empties it. @param num_unknowns a multiple of kBlockSize, @param jacobian as for `Residuals`
  void reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian);
  /// Adds a group of zero rows. @return the index of its first row
  Eigen::Index add_group(double weight);

  /// The jacobian of one row.
  class JacobianRow {
   public:
    JacobianRow(BlockResiduals& rows, Eigen::Index row) : rows_(rows), row_(row) {}
    /// d value / d the unknowns of a block, to be added to; zero at first.
    Block& block(int index) { return rows_.block(row_, index); }
    double operator[](Eigen::Index unknown) const;

   private:
    BlockResiduals& rows_;
    Eigen::Index row_;
  };
  /// Rows are written in ascending order: once a row has a block, those before it get no more.
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
  std::vector<std::size_t> begin_;  ///< [rows that have been begun] into entries_
  std::vector<Entry> entries_;
};

struct BlockSystemOptions {
  int iterations = 100;     ///< of conjugate gradients, at most
  double tolerance = 1e-3;  ///< of the residual's length, relative to the gradient's
};

/// Normal equations of thousands of unknowns that are never formed: products with J and J^T, conjugate gradients
/// preconditioned with the blocks on the diagonal. Knows no character: another problem whose unknowns come in blocks of
/// six may use it as it is.
class BlockSystem {
 public:
  explicit BlockSystem(const BlockSystemOptions& options = {}) : options_(options) {}
  void reset(Eigen::Index num_unknowns);
  /// Adds the rows of a term, weighted under its kernel.
  void add(const BlockResiduals& residuals);

  /// step of (H + damping diag(H)) step = -gradient, to within the tolerance. An unknown that no row depends on stays
  /// where it is. However few iterations are allowed, the step leads downhill.
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
