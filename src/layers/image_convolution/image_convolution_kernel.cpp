// Convolution of a block of rows. The rows that the block reads are first copied into scratch memory, padded with zeros
// and, if asked for, enlarged; with stride 2 the odd and even columns are kept apart. Then every tap of the convolution
// is a fixed offset, and an output vector is a sum of weights times contiguous vectors.

#include "doppel/layers/image_convolution/image_convolution_kernel.h"

#include <cmath>
#include <cstring>

#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int kLanes = kVectorBytes / sizeof(float);
// Vectors of pixels and output channels that stay in registers: 24 sums of 32 registers, or 12 of 16.
constexpr int kVectors = kVectorBytes == 64 ? 6 : 3;
constexpr int kChannels = 4;

typedef float Vec __attribute__((vector_size(kVectorBytes)));
typedef float LooseVec __attribute__((vector_size(kVectorBytes), aligned(4), may_alias));
typedef int32_t Mask __attribute__((vector_size(kVectorBytes)));

inline Vec load(const float* p) { return *reinterpret_cast<const LooseVec*>(p); }
inline void store(float* p, Vec v) { *reinterpret_cast<LooseVec*>(p) = v; }
inline void store_some(float* p, Vec v, int64_t count) {
  if (count >= kLanes) return store(p, v);
  float lanes[kLanes];
  store(lanes, v);
  std::memcpy(p, lanes, count * sizeof(float));
}

// ---- the rows that a block reads ----

/// The rows of a block in scratch memory. With stride 2 a row has two halves: column -1, 1, 3, ... and 0, 2, 4, ...
struct Rows {
  int64_t stride;         ///< of the convolution
  int64_t count;          ///< rows of a channel
  int64_t half;           ///< floats of a half (stride 2)
  int64_t length;         ///< floats of a row
  int64_t height, width;  ///< of the image as the convolution sees it

  Rows(const ImageConvolutionParams& p, int64_t out_rows)
      : stride(p.kernel == 4 ? 2 : 1),
        count(stride * (out_rows - 1) + p.kernel),
        half(padded(p.out_width + 2) + kLanes),
        length(stride * half),
        height(p.enlarge ? 2 * p.height : p.height),
        width(p.enlarge ? 2 * p.width : p.width) {}

  /// The last vector of a row may reach kLanes - 1 floats beyond the last column.
  static int64_t padded(int64_t n) { return (n + kLanes - 1) / kLanes * kLanes; }
  /// Offset of the tap in column kx of the kernel.
  int64_t column(int64_t kx) const { return stride == 1 ? kx : (kx % 2) * half + kx / 2; }
};

inline void fill(float* to, int64_t count, float value) {
  for (int64_t i = 0; i < count; ++i) to[i] = value;
}

/// Row y of a channel. @param spread memory of a row, for shared pixels
inline const float* image_row(const ImageChannels& part, int64_t channel, int64_t y, int64_t width, float* spread) {
  const float* row = part.data + channel * part.channel + y * part.row;
  if (part.column != 0) return row;
  fill(spread, width, *row);
  return spread;
}

/// out[2j] and out[2j+1] lie a quarter pixel to the left and to the right of in[j]; pixels outside repeat the edge.
inline void enlarge_row(const float* in, int64_t width, float* out) {
  out[0] = in[0];
  for (int64_t j = 0; j + 1 < width; ++j) {
    out[2 * j + 1] = 0.75f * in[j] + 0.25f * in[j + 1];
    out[2 * j + 2] = 0.25f * in[j] + 0.75f * in[j + 1];
  }
  out[2 * width - 1] = in[width - 1];
}

/// Row u of the enlarged channel. @param spare memory of three rows
inline void enlarged_row(const ImageChannels& part, int64_t channel, int64_t u, const ImageConvolutionParams& p,
                         float* spare, float* out) {
  const int64_t near = u / 2, other = u % 2 == 0 ? near - 1 : near + 1;
  const int64_t far = other < 0 ? 0 : other >= p.height ? p.height - 1 : other;
  const float* a = image_row(part, channel, near, p.width, spare);
  const float* b = image_row(part, channel, far, p.width, spare + p.width);
  float* blend = spare + 2 * p.width;
  for (int64_t x = 0; x < p.width; ++x) blend[x] = 0.75f * a[x] + 0.25f * b[x];
  enlarge_row(blend, p.width, out);
}

inline void split_row(const float* in, int64_t half_width, float* odd, float* even) {
  for (int64_t x = 0; x < half_width; ++x) {
    even[x] = in[2 * x];
    odd[x + 1] = in[2 * x + 1];
  }
  odd[0] = even[half_width] = 0.0f;
}

/// Row y of a channel into scratch memory. @param spare memory of three rows of the image in memory
inline void copy_row(const ImageChannels& part, int64_t channel, int64_t y, const ImageConvolutionParams& p,
                     const Rows& rows, float* spare, float* to) {
  if (y < 0 || y >= rows.height) return fill(to, rows.length, 0.0f);
  if (rows.stride == 2) return split_row(image_row(part, channel, y, p.width, spare), p.out_width, to, to + rows.half);
  to[0] = to[rows.width + 1] = 0.0f;
  if (p.enlarge) return enlarged_row(part, channel, y, p, spare, to + 1);
  std::memcpy(to + 1, image_row(part, channel, y, p.width, spare), p.width * sizeof(float));
}

/// @return input channels
inline int64_t inputs_of(const ImageConvolutionParams& p) { return p.parts[0].count + p.parts[1].count; }

// ---- the sums ----

/// The pixel vectors of a step: vector v reads its taps at from[v] + offset and writes `count[v]` floats at to[v].
struct PixelVectors {
  int64_t from[kVectors], to[kVectors], count[kVectors];
};

template <int C, int V>
inline void convolve(const ImageConvolutionParams& p, int64_t channel, const float* rows, const int32_t* offsets,
                     int64_t taps, const PixelVectors& pixels) {
  const float* weight = p.weight + channel * taps;
  int64_t from[V];
  for (int v = 0; v < V; ++v) from[v] = pixels.from[v];
  Vec sum[C][V] = {};
  for (int64_t t = 0; t < taps; ++t) {
    const float* at = rows + offsets[t];
    Vec x[V];
    for (int v = 0; v < V; ++v) x[v] = load(at + from[v]);
    for (int c = 0; c < C; ++c) {
      const Vec w = weight[c * taps + t] - Vec{};
      for (int v = 0; v < V; ++v) sum[c][v] += w * x[v];
    }
  }
  const int64_t plane = p.out_height * p.out_width;
  for (int c = 0; c < C; ++c) {
    const float scale = p.scale ? p.scale[channel + c] : 1.0f, shift = p.shift ? p.shift[channel + c] : 0.0f;
    for (int v = 0; v < V; ++v) {
      const Vec y = sum[c][v] * scale + shift;
      const Mask positive = y > Vec{};
      const Vec scaled = y * p.slope;
      const Vec active = (Vec)((positive & (Mask)y) | (~positive & (Mask)scaled));
      store_some(p.out + (channel + c) * plane + pixels.to[v], active, pixels.count[v]);
    }
  }
}

template <int V>
inline void convolve_channels(const ImageConvolutionParams& p, int64_t first, int64_t last, const float* rows,
                              const int32_t* offsets, int64_t taps, const PixelVectors& pixels) {
  int64_t c = first;
  for (; c + kChannels <= last; c += kChannels) convolve<kChannels, V>(p, c, rows, offsets, taps, pixels);
  if (last - c == 3) convolve<3, V>(p, c, rows, offsets, taps, pixels);
  if (last - c == 2) convolve<2, V>(p, c, rows, offsets, taps, pixels);
  if (last - c == 1) convolve<1, V>(p, c, rows, offsets, taps, pixels);
}

/// The first `count` vectors: all at once, or two by two.
inline void convolve_vectors(const ImageConvolutionParams& p, int64_t first, int64_t last, const float* rows,
                             const int32_t* offsets, int64_t taps, const PixelVectors& pixels, int count) {
  if (count == kVectors) return convolve_channels<kVectors>(p, first, last, rows, offsets, taps, pixels);
  for (int v = 0; v < count; v += 2) {
    const int next = v + 1 < count ? v + 1 : v;
    const PixelVectors two{
        {pixels.from[v], pixels.from[next]}, {pixels.to[v], pixels.to[next]}, {pixels.count[v], pixels.count[next]}};
    if (next > v)
      convolve_channels<2>(p, first, last, rows, offsets, taps, two);
    else
      convolve_channels<1>(p, first, last, rows, offsets, taps, two);
  }
}

/// Copies the rows of a block and finds the offsets of the taps [inputs, k, k].
inline void prepare_block(const ImageConvolutionParams& p, const Rows& rows, int64_t begin, float* scratch,
                          float* spare, int32_t* offsets) {
  const int64_t inputs = inputs_of(p), channel_size = rows.count * rows.length, k = p.kernel;
  for (int64_t i = 0; i < inputs; ++i) {
    const bool in_first = i < p.parts[0].count;
    const ImageChannels& part = p.parts[in_first ? 0 : 1];
    const int64_t channel = in_first ? i : i - p.parts[0].count;
    for (int64_t r = 0; r < rows.count; ++r)
      copy_row(part, channel, rows.stride * begin - 1 + r, p, rows, spare,
               scratch + i * channel_size + r * rows.length);
    for (int64_t tap = 0; tap < k * k; ++tap)
      offsets[i * k * k + tap] = static_cast<int32_t>(i * channel_size + tap / k * rows.length + rows.column(tap % k));
  }
}

}  // namespace

int64_t image_convolution_scratch(const ImageConvolutionParams& p, int64_t rows) {
  const Rows block(p, rows);
  const int64_t offsets = inputs_of(p) * p.kernel * p.kernel;  // int32, as large as a float
  return inputs_of(p) * block.count * block.length + kLanes + 3 * p.width + offsets;
}

void image_convolution(const ImageConvolutionParams& p, int64_t begin, int64_t end, int64_t first, int64_t last,
                       float* scratch) {
  const Rows rows(p, end - begin);
  const int64_t inputs = inputs_of(p), taps = inputs * p.kernel * p.kernel;
  float* spare = scratch + inputs * rows.count * rows.length + kLanes;
  int32_t* offsets = reinterpret_cast<int32_t*>(spare + 3 * p.width);
  prepare_block(p, rows, begin, scratch, spare, offsets);
  PixelVectors pixels;
  int gathered = 0;
  for (int64_t y = begin; y < end; ++y) {
    for (int64_t x = 0; x < p.out_width; x += kLanes) {
      pixels.from[gathered] = (y - begin) * rows.stride * rows.length + x;
      pixels.to[gathered] = y * p.out_width + x;
      pixels.count[gathered] = p.out_width - x;
      if (++gathered < kVectors) continue;
      convolve_vectors(p, first, last, scratch, offsets, taps, pixels, gathered);
      gathered = 0;
    }
  }
  convolve_vectors(p, first, last, scratch, offsets, taps, pixels, gathered);
}

}  // namespace doppel::kernels::DOPPEL_ISA
