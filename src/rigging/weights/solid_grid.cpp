#include "doppel/rigging/weights/solid_grid.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

/// The lower envelope of parabolas (Felzenszwalb & Huttenlocher 2012): squared distances along one line of cells.
class DistanceLine {
 public:
  explicit DistanceLine(int longest)
      : position_(as_size(longest)), border_(as_size(longest) + 1), out_(as_size(longest)) {}

  /// Replaces the squared distances at data[0], data[stride], ... @param n number of cells
  void transform(float* data, std::size_t stride, int n) {
    int last = 0;
    position_[0] = 0;
    border_[0] = -kFar;
    border_[1] = kFar;
    for (int q = 1; q < n; ++q) {
      float cut = crossing(data, stride, q, position_[last]);
      while (last > 0 && cut <= border_[last]) cut = crossing(data, stride, q, position_[--last]);
      if (cut <= border_[last]) last = -1;
      position_[++last] = q;
      border_[last] = last == 0 ? -kFar : cut;
      border_[as_size(last) + 1] = kFar;
    }
    for (int q = 0, k = 0; q < n; ++q) {
      while (border_[as_size(k) + 1] < static_cast<float>(q)) ++k;
      const int away = q - position_[k];
      out_[q] = static_cast<float>(away * away) + data[as_size(position_[k]) * stride];
    }
    for (int q = 0; q < n; ++q) data[as_size(q) * stride] = out_[q];
  }

  static constexpr float kFar = 1e12f;

 private:
  static float crossing(const float* data, std::size_t stride, int q, int p) {
    const float a = data[as_size(q) * stride] + static_cast<float>(q) * static_cast<float>(q);
    const float b = data[as_size(p) * stride] + static_cast<float>(p) * static_cast<float>(p);
    return (a - b) / static_cast<float>(2 * (q - p));
  }
  std::vector<int> position_;
  std::vector<float> border_, out_;
};

}  // namespace

SolidGrid solid_grid(const VoxelSolid& solid) {
  SolidGrid grid;
  grid.cell = solid.cell_size();
  grid.origin = solid.centre(0);
  grid.size = solid.dims();
  grid.inside.assign(solid.num_cells(), 0);
  for (const int cell : solid.inside_cells()) grid.inside[cell] = 1;
  return grid;
}

std::vector<float> distance_to_outside(const SolidGrid& grid) {
  std::vector<float> distance(grid.inside.size());
  for (std::size_t i = 0; i < distance.size(); ++i) distance[i] = grid.inside[i] != 0 ? 1e10f : 0.0f;
  const auto [nx, ny, nz] = grid.size;
  DistanceLine line(std::max({nx, ny, nz}));
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y) line.transform(&distance[grid.index(0, y, z)], 1, nx);
  for (int z = 0; z < nz; ++z)
    for (int x = 0; x < nx; ++x) line.transform(&distance[grid.index(x, 0, z)], as_size(nx), ny);
  for (int y = 0; y < ny; ++y)
    for (int x = 0; x < nx; ++x) line.transform(&distance[grid.index(x, y, 0)], as_size(nx) * as_size(ny), nz);
  for (float& d : distance) d = static_cast<float>(grid.cell) * std::sqrt(d);
  return distance;
}

}  // namespace doppel
