#pragma once

#include <cstdint>
#include <vector>

#include "doppel/render/raster/raster_kernel.h"

namespace doppel::render {

/// Faces in the form of the kernels, checked once.
struct FaceTable {
  std::vector<std::int32_t> corners;  ///< [F,4], the fourth unused
  std::int64_t num_faces = 0;
  std::int64_t num_vertices = 0;  ///< largest index + 1
};

/// The steps of drawing one view: project, bin, then draw or cover tile by tile. Threads may share each step, and the
/// result does not depend on the division of the work. A ViewPass holds only scratch memory. Each thread has one and
/// reuses it for all its views.
class ViewPass {
 public:
  /// Starts a new view. `vertices` [N,3] and `faces` must outlive the pass over the view.
  void begin(const FaceTable& faces, const float* vertices, std::int64_t num_vertices, const float* matrix, int width,
             int height, float z_near, bool cull, int num_chunks = 1);
  /// As above, for checked `faces` [F,4] as in FaceTable.
  void begin(const std::int32_t* faces, std::int64_t num_faces, const float* vertices, std::int64_t num_vertices,
             const float* matrix, int width, int height, float z_near, bool cull, int num_chunks = 1);

  std::int64_t num_vertices() const { return num_vertices_; }
  void project(std::int64_t begin, std::int64_t end) { kernels::project_vertices(view_, begin, end); }
  /// Sorts the faces of a chunk into tiles, keeping their order.
  void bin(int chunk);
  int num_chunks() const { return num_chunks_; }
  /// Runs `project` and `bin` on the calling thread.
  void prepare();

  int tiles_x() const { return tiles_x_; }
  int num_tiles() const { return tiles_x_ * tiles_y_; }
  bool tile_empty(int tile) const;

  /// Draws a tile and writes it to the images, together with the part that the previous drawing wrote (`dirty`).
  void draw_tile(int tile, kernels::TileBuffer& buffer, kernels::TileRect& dirty,
                 const kernels::RasterOutput& out) const;
  /// Draws a tile into the buffer alone; the caller resolves and resets it. @return the part that was drawn
  kernels::TileRect draw_tile(int tile, kernels::TileBuffer& buffer) const;
  /// Sets the bits of a tile's covered pixels; `rows` [64].
  void cover_tile(int tile, std::uint64_t* rows) const;

  const kernels::RasterView& view() const { return view_; }
  /// [N,4]: u, v, 1/w (0: not on the screen), w.
  const float* screen() const { return screen_.data(); }

 private:
  /// The bins of a run of faces: entries of tile t are entries[offsets[t] .. offsets[t+1]).
  struct Chunk {
    std::int64_t begin = 0, end = 0;
    std::vector<kernels::FaceTiles> bounds;
    std::vector<std::int32_t> offsets, entries;
    std::vector<kernels::CutTriangle> cut;
    std::vector<std::int32_t> codes;  ///< per bound: the face, or ~(index in cut)
  };
  void bound(Chunk& chunk);
  void sort(Chunk& chunk);
  bool tiles_of(const kernels::CutTriangle& triangle, kernels::FaceTiles& tiles) const;
  template <typename Draw>
  void for_each_bin(int tile, const Draw& draw) const;

  kernels::RasterView view_;
  std::int64_t num_vertices_ = 0, num_faces_ = 0;
  int num_chunks_ = 0, tiles_x_ = 0, tiles_y_ = 0;
  std::vector<float> screen_;
  std::vector<Chunk> chunks_;
};

/// A tile buffer in its initial state.
void reset(kernels::TileBuffer& buffer);

}  // namespace doppel::render
