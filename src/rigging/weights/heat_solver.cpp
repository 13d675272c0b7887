#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/rigging/weights/heat_domain.h"

namespace doppel {
namespace {

constexpr int kColumns = 8;    // fields that are solved together
constexpr double kAir = 1e-4;  // conduction of the cells around the body, relative to those inside
constexpr double kWall = 0.1;  // conduction through a surface inside of the solid: skin under clothes, touching limbs
constexpr int kMaxIterations = 2000;
constexpr double kTolerance = 1e-6;  // of the residual, relative to the right-hand side

using Columns = Eigen::Array<double, kColumns, 1>;
using Block = std::vector<Columns>;  // [n]

/// The Laplace equation on the cells that no bone fills: symmetric and positive definite.
class HeatEquation {
 public:
  explicit HeatEquation(const HeatDomain& domain) : domain_(domain) {
    const SolidGrid& grid = domain.grid;
    const std::size_t row = as_size(grid.size[0]), layer = row * as_size(grid.size[1]);
    const std::array<std::size_t, 6> steps{1, row, layer, -std::size_t{1}, -row, -layer};
    const std::size_t n = domain.cells.size();
    neighbour_.resize(n);
    conduction_.resize(n);
    diagonal_.assign(n, 0.0);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < 6; ++k) {
        const std::size_t cell = domain.cells[i] + steps[k];
        const int other = cell < domain.cell_number.size() ? domain.cell_number[cell] : -1;
        neighbour_[i][k] = other < 0 ? static_cast<int>(i) : other;
        const bool inside = other >= 0 && grid.inside[domain.cells[i]] != 0 && grid.inside[cell] != 0;
        const std::uint8_t wall = other < 0 ? 0 : domain.walls[k < 3 ? domain.cells[i] : cell][k % 3];
        const double conduction = other < 0                             ? 0.0
                                  : !inside || wall == HeatDomain::kGap ? kAir
                                  : wall != HeatDomain::kNone           ? kWall
                                                                        : 1.0;
        conduction_[i][k] = static_cast<float>(conduction);
        diagonal_[i] += conduction_[i][k];
      }
  }

  /// Solves for the bones first .. first + kColumns, and writes them into `result` [n * num_bones].
  void solve(int first, int num_bones, std::vector<float>& result) const {
    const std::size_t n = domain_.cells.size();
    Block x(n, Columns::Zero()), r(n, Columns::Zero()), p(n, Columns::Zero()), q(n);
    for (std::size_t i = 0; i < n; ++i)
      for (const auto& [bone, share] : domain_.fixed[i])
        if (bone >= first && bone < first + kColumns) x[i][bone - first] = share;
    multiply(x, q);
    Columns norm = Columns::Zero();
    for (std::size_t i = 0; i < n; ++i)
      if (free(i)) {
        r[i] = -q[i];
        norm += r[i].square() / diagonal_[i];
      }
    descend(norm, x, r, p, q);
    for (std::size_t i = 0; i < n; ++i)
      for (int k = 0; k < std::min(kColumns, num_bones - first); ++k)
        result[i * as_size(num_bones) + as_size(first + k)] = static_cast<float>(std::clamp(x[i][k], 0.0, 1.0));
  }

 private:
  bool free(std::size_t i) const { return domain_.fixed[i].empty(); }

  /// q = A p in the free cells.
  void multiply(const Block& p, Block& q) const {
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (!free(i)) continue;
      Columns sum = diagonal_[i] * p[i];
      for (std::size_t k = 0; k < 6; ++k) sum -= double{conduction_[i][k]} * p[neighbour_[i][k]];
      q[i] = sum;
    }
  }

  /// Conjugate gradients with the diagonal as preconditioner, all columns side by side.
  void descend(const Columns& norm, Block& x, Block& r, Block& p, Block& q) const {
    Columns rho = norm;
    const Columns goal = kTolerance * kTolerance * norm;
    for (std::size_t i = 0; i < x.size(); ++i)
      if (free(i)) p[i] = r[i] / diagonal_[i];
    for (int iteration = 0; (rho > goal).any(); ++iteration) {
      if (iteration == kMaxIterations)
        fail(
            "skinning weights: the heat equation is not solved after {} iterations; the solid has too many loose parts",
            kMaxIterations);
      multiply(p, q);
      Columns curvature = Columns::Zero();
      for (std::size_t i = 0; i < x.size(); ++i)
        if (free(i)) curvature += p[i] * q[i];
      const Columns step = (curvature > 0).select(rho / curvature.max(1e-300), Columns::Zero());
      Columns next = Columns::Zero();
      for (std::size_t i = 0; i < x.size(); ++i) {
        if (!free(i)) continue;
        x[i] += step * p[i];
        r[i] -= step * q[i];
        next += r[i].square() / diagonal_[i];
      }
      const Columns turn = (rho > 0).select(next / rho.max(1e-300), Columns::Zero());
      for (std::size_t i = 0; i < x.size(); ++i)
        if (free(i)) p[i] = r[i] / diagonal_[i] + turn * p[i];
      rho = next;
    }
  }

  const HeatDomain& domain_;
  std::vector<std::array<int, 6>> neighbour_;
  std::vector<std::array<float, 6>> conduction_;
  std::vector<double> diagonal_;
};

}  // namespace

std::vector<float> solve_heat(const HeatDomain& domain, int num_bones) {
  const HeatEquation equation(domain);
  std::vector<float> result(domain.cells.size() * as_size(num_bones));
  for (int first = 0; first < num_bones; first += kColumns) equation.solve(first, num_bones, result);
  return result;
}

}  // namespace doppel
