#pragma once

#include <vector>

#include "doppel/geometry/topology.h"

namespace doppel {

/// Replaces every value of a vertex by the mean of the value and the mean of its neighbours, `rounds` times.
/// @param values [N] of anything that adds and scales: numbers, vectors
template <typename Value>
void smooth_values(std::vector<Value>& values, const MeshTopology& topology, int rounds) {
  const IndexRows& ring = topology.one_ring();
  for (int round = 0; round < rounds; ++round) {
    const std::vector<Value> old = values;
    for (int v = 0; v < ring.num_rows(); ++v) {
      Value mean = old[ring.row(v).front()];
      for (const int w : ring.row(v).subspan(1)) mean = mean + old[w];
      values[v] = 0.5 * old[v] + (0.5 / ring.size(v)) * mean;
    }
  }
}

}  // namespace doppel
