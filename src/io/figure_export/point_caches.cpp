#include <bit>
#include <cstring>
#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/write_figure.h"

namespace doppel {
namespace {

/// Four bytes, the least significant first or last.
void put_word(std::ostream& out, std::uint32_t word, bool big_endian) {
  char bytes[4];
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<char>(word >> (8 * (big_endian ? 3 - i : i)));
  out.write(bytes, 4);
}
void put_float(std::ostream& out, float value, bool big_endian) {
  put_word(out, std::bit_cast<std::uint32_t>(value), big_endian);
}

std::uint32_t points_in(const FigureClip& clip) {
  return clip.vertices.empty() ? 0 : static_cast<std::uint32_t>(clip.vertices[0].size() / 3);
}

/// Writes a head, then the positions of all frames.
template <typename Head>
void write_cache(const std::filesystem::path& path, const FigureClip& clip, const FileSpace& space, bool big_endian,
                 const Head& head) {
  write_atomically(path, [&](const std::filesystem::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    head(out);
    for (const std::vector<float>& frame : clip.vertices)
      for (std::size_t i = 0; i < frame.size(); i += 3) {
        const Eigen::Vector3f point = space.of({frame[i], frame[i + 1], frame[i + 2]}).cast<float>();
        for (const float value : point) put_float(out, value, big_endian);
      }
    out.close();
    if (!out) fail("{}: writing failed; is the disk full?", path.string());
  });
}

}  // namespace

void write_pc2(const std::filesystem::path& path, const FigureClip& clip, const FileSpace& space) {
  write_cache(path, clip, space, false, [&](std::ostream& out) {
    out.write("POINTCACHE2", 12);  // with its final zero
    put_word(out, 1, false);       // version
    put_word(out, points_in(clip), false);
    put_float(out, 0.0F, false);  // first frame
    put_float(out, 1.0F, false);  // frames per sample
    put_word(out, static_cast<std::uint32_t>(clip.num_frames()), false);
  });
}

void write_mdd(const std::filesystem::path& path, const FigureClip& clip, const FileSpace& space) {
  write_cache(path, clip, space, true, [&](std::ostream& out) {
    put_word(out, static_cast<std::uint32_t>(clip.num_frames()), true);
    put_word(out, points_in(clip), true);
    for (int t = 0; t < clip.num_frames(); ++t) put_float(out, static_cast<float>(t / clip.frames_per_second), true);
  });
}

}  // namespace doppel
