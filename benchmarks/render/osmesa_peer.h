#pragma once

#include <memory>
#include <vector>

#include "render/bench_mesh.h"

namespace doppel::bench {

/// OSMesa (llvmpipe): flat colours that spell the face id, back faces culled, id and depth read back. The mesh stays in
/// buffers of the driver, so the peer is spared its upload.
class OsmesaPeer {
 public:
  explicit OsmesaPeer(const PeerScene& scene);
  ~OsmesaPeer();
  void draw();
  const std::vector<int>& face_id();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel::bench
