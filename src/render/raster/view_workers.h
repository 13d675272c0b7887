#pragma once

#include <ATen/Parallel.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/render/raster/view_pass.h"

namespace doppel::render {

/// Divides the drawing of views among threads. Keeps a ViewPass and a tile buffer for each thread.
class ViewWorkers {
 public:
  /// Calls begin(pass, view, chunks) for every view and draw(pass, view, tile, thread) for every tile of the view. With
  /// enough views each thread draws whole views; otherwise the threads share the steps of a view.
  template <typename Begin, typename Draw>
  void run(std::int64_t views, const Begin& begin, const Draw& draw) {
    const int threads = at::in_parallel_region() ? 1 : std::max(at::get_num_threads(), 1);
    if (passes_.size() < as_size(threads)) passes_.resize(threads);
    while (buffers_.size() < as_size(threads)) reset(buffers_.emplace_back());
    if (views < threads) {
      for (std::int64_t v = 0; v < views; ++v) share_out(v, threads, begin, draw);
      return;
    }
    std::atomic<std::int64_t> next{0};
    at::parallel_for(0, threads, 1, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t thread = first; thread < last; ++thread) {
        ViewPass& pass = passes_[thread];
        for (std::int64_t v = next++; v < views; v = next++) {
          begin(pass, v, 1);
          pass.prepare();
          for (int tile = 0; tile < pass.num_tiles(); ++tile) draw(pass, v, tile, thread);
        }
      }
    });
  }

  kernels::TileBuffer& buffer(std::int64_t thread) { return buffers_[thread]; }

 private:
  template <typename Begin, typename Draw>
  void share_out(std::int64_t view, int threads, const Begin& begin, const Draw& draw) {
    constexpr std::int64_t kVerticesPerThread = 16384;  // fewer do not pay for another thread
    ViewPass& pass = passes_[0];
    begin(pass, view, threads);
    at::parallel_for(0, pass.num_vertices(), kVerticesPerThread,
                     [&](std::int64_t first, std::int64_t last) { pass.project(first, last); });
    at::parallel_for(0, threads, 1, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t chunk = first; chunk < last; ++chunk) pass.bin(static_cast<int>(chunk));
    });
    std::atomic<int> next{0};
    at::parallel_for(0, threads, 1, [&](std::int64_t first, std::int64_t last) {
      for (std::int64_t thread = first; thread < last; ++thread) {
        for (int tile = next++; tile < pass.num_tiles(); tile = next++) draw(pass, view, tile, thread);
      }
    });
  }

  std::vector<ViewPass> passes_;
  std::vector<kernels::TileBuffer> buffers_;
};

}  // namespace doppel::render
