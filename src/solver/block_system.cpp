#include "doppel/solver/block_system.h"

#include <Eigen/Cholesky>

#include "doppel/core/as_size.h"
#include "doppel/solver/conjugate_gradients.h"

namespace doppel {

// ---- rows ----

void BlockResiduals::reset(int num_unknowns, int rows_per_group, const RobustKernel& kernel, bool jacobian) {
  reset_rows(num_unknowns, rows_per_group, kernel, jacobian);
  begin_.clear();
  entries_.clear();
}

Eigen::Index BlockResiduals::add_group(double weight) { return add_rows(weight); }

std::size_t BlockResiduals::begin_of(Eigen::Index row) const {
  const auto r = as_size(row);
  return r < begin_.size() ? begin_[r] : entries_.size();
}

std::size_t BlockResiduals::end_of(Eigen::Index row) const { return begin_of(row + 1); }

Block& BlockResiduals::block(Eigen::Index row, int index) {
  while (begin_.size() <= as_size(row)) begin_.push_back(entries_.size());
  for (std::size_t i = begin_of(row); i < entries_.size(); ++i)
    if (entries_[i].block == index) return entries_[i].jacobian;
  entries_.push_back({index, Block::Zero()});
  return entries_.back().jacobian;
}

double BlockResiduals::JacobianRow::operator[](Eigen::Index unknown) const {
  for (std::size_t i = rows_.begin_of(row_); i < rows_.end_of(row_); ++i)
    if (rows_.entries_[i].block == unknown / kBlockSize) return rows_.entries_[i].jacobian[unknown % kBlockSize];
  return 0.0;
}

// ---- system ----

void BlockSystem::reset(Eigen::Index num_unknowns) {
  gradient_.setZero(num_unknowns);
  blocks_.assign(num_unknowns / kBlockSize, SquareBlock::Zero());
  begin_.assign(1, 0);
  entries_.clear();
}

void BlockSystem::add(const BlockResiduals& rows) {
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
    const double factor = rows.factor(row / rows.rows_per_group()), value = factor * rows.value(row);
    for (std::size_t i = rows.begin_of(row); i < rows.end_of(row); ++i) {
      const int block = rows.entries_[i].block;
      const Block jacobian = factor * rows.entries_[i].jacobian;
      gradient_.segment<kBlockSize>(block * kBlockSize) += value * jacobian;
      blocks_[block].noalias() += jacobian * jacobian.transpose();
      entries_.push_back({block, jacobian});
    }
    begin_.push_back(entries_.size());
  }
}

Eigen::VectorXd BlockSystem::product(const Eigen::VectorXd& x) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(x.size());
  for (std::size_t row = 0; row + 1 < begin_.size(); ++row) {
    double along = 0.0;
    for (std::size_t i = begin_[row]; i < begin_[row + 1]; ++i)
      along += entries_[i].jacobian.dot(x.segment<kBlockSize>(entries_[i].block * kBlockSize));
    for (std::size_t i = begin_[row]; i < begin_[row + 1]; ++i)
      result.segment<kBlockSize>(entries_[i].block * kBlockSize) += along * entries_[i].jacobian;
  }
  return result;
}

/// The diagonal that the damping adds; 1 where the diagonal of H is 0.
Eigen::VectorXd BlockSystem::diagonal(double damping) const {
  Eigen::VectorXd result(gradient_.size());
  for (Eigen::Index i = 0; i < result.size(); ++i) {
    const double entry = blocks_[i / kBlockSize](i % kBlockSize, i % kBlockSize);
    result[i] = entry > 0.0 ? damping * entry : 1.0;
  }
  return result;
}

std::vector<BlockSystem::SquareBlock> BlockSystem::inverse_blocks(double damping) const {
  constexpr double kFloor = 1e-9;  // relative to the largest entry, so that a block of few rows has an inverse
  const Eigen::VectorXd added = diagonal(damping);
  std::vector<SquareBlock> result;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    SquareBlock block = blocks_[b];
    block.diagonal() += added.segment<kBlockSize>(static_cast<Eigen::Index>(b) * kBlockSize);
    block.diagonal().array() += kFloor * block.diagonal().maxCoeff();
    result.emplace_back(block.llt().solve(SquareBlock::Identity()));
  }
  return result;
}

/// H with damping.
struct BlockSystem::Damped {
  const BlockSystem& system;
  Eigen::VectorXd added;
  std::vector<SquareBlock> inverse;

  void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& image) const {
    image = system.product(x) + added.cwiseProduct(x);
  }
  void precondition(const Eigen::VectorXd& x, Eigen::VectorXd& result) const {
    result.resize(x.size());
    for (std::size_t b = 0; b < inverse.size(); ++b) {
      const auto first = static_cast<Eigen::Index>(b) * kBlockSize;
      result.segment<kBlockSize>(first).noalias() = inverse[b] * x.segment<kBlockSize>(first);
    }
  }
  double dot(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const { return a.dot(b); }
};

bool BlockSystem::solve(double damping, Eigen::VectorXd& step) const {
  const Damped damped{*this, diagonal(damping), inverse_blocks(damping)};
  conjugate_gradients(damped, -gradient_, options_.iterations, options_.tolerance, step);
  return gradient_.allFinite() && step.allFinite();
}

}  // namespace doppel
