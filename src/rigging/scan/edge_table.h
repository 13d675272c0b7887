#pragma once

#include <vector>

#include "doppel/geometry/mesh.h"

namespace doppel {

/// The edge of face f from its corner k to the next corner is the half 3 f + k.
inline int half_start(const std::vector<Triangle>& faces, int half) { return faces[half / 3][half % 3]; }
inline int half_end(const std::vector<Triangle>& faces, int half) { return faces[half / 3][(half % 3 + 1) % 3]; }

/// An edge as used by one face.
struct EdgeUse {
  int low, high;  ///< vertices, low < high
  int half;       ///< of the face
};

/// All edges of all faces, sorted: the uses of one edge stand together, by face.
std::vector<EdgeUse> sorted_edge_uses(const std::vector<Triangle>& faces);

/// Calls action(first, last) for the uses of each edge.
template <typename Action>
void for_each_edge(const std::vector<EdgeUse>& uses, const Action& action) {
  for (std::size_t first = 0; first < uses.size();) {
    std::size_t last = first + 1;
    while (last < uses.size() && uses[last].low == uses[first].low && uses[last].high == uses[first].high) ++last;
    action(uses.data() + first, uses.data() + last);
    first = last;
  }
}

/// Sets of things that are joined pair by pair. The smallest member stands for its set.
class JoinedSets {
 public:
  explicit JoinedSets(std::size_t count);
  int find(int item);
  void join(int a, int b);

 private:
  std::vector<int> parent_;
};

/// The component of each face (faces that share vertices), numbered by the first face. @param count receives how many
std::vector<int> face_components(const std::vector<Triangle>& faces, std::size_t num_vertices, int& count);

}  // namespace doppel
