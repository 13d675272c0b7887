#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "render/bench_mesh.h"

namespace doppel::bench {

/// Embree 3: refit of the moved mesh, then a packet of 16 rays for every 4x4 pixels; face id, z and barycentrics.
class EmbreePeer {
 public:
  explicit EmbreePeer(const PeerScene& scene);
  ~EmbreePeer();
  void draw();
  const std::vector<int>& face_id() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel::bench
