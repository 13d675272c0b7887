#include "doppel/losses/image_kernel.h"

#include <cmath>
#include <cstring>

namespace doppel::kernels::DOPPEL_ISA {
namespace {

constexpr int kChroma = 0, kSquares = 1;
constexpr int kLanes = 16;  // partial sums of a row, the same number for every vector width

/// Adds half the squares (or the absolute values) of `count` numbers.
template <bool Absolute>
double row_sum(const float* __restrict values, int64_t count) {
  float parts[kLanes] = {};
  int64_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (int l = 0; l < kLanes; ++l) {
      const float v = values[i + l];
      parts[l] += Absolute ? std::fabs(v) : 0.5f * v * v;
    }
  }
  for (int l = 0; i < count; ++i, ++l) {
    const float v = values[i];
    parts[l] += Absolute ? std::fabs(v) : 0.5f * v * v;
  }
  double sum = 0.0;
  for (int l = 0; l < kLanes; ++l) sum += static_cast<double>(parts[l]);
  return sum;
}

/// The mask of a row for each of its 3 W colours.
void spread_mask(const uint8_t* __restrict mask, int64_t width, float* __restrict out) {
  for (int64_t x = 0; x < width; ++x) {
    const float m = static_cast<float>(mask[x]);
    out[3 * x] = m;
    out[3 * x + 1] = m;
    out[3 * x + 2] = m;
  }
}

/// 255 (r - t) inside the mask, 0 outside for any values there, including NaN.
void row_difference(const ImageLossParams& p, int64_t y, float* __restrict weight, float* __restrict out) {
  const int64_t count = 3 * p.width;
  const float* __restrict r = p.rendered + y * count;
  const float* __restrict t = p.target + y * count;
  spread_mask(p.mask + y * p.width, p.width, weight);
  for (int64_t i = 0; i < count; ++i) out[i] = weight[i] != 0.0f ? 255.0f * (r[i] - t[i]) : 0.0f;
}

bool any(const uint8_t* mask, int64_t count) { return std::memchr(mask, 1, static_cast<size_t>(count)) != nullptr; }

/// Chroma of the masked difference, one plane for U and one for V: rows [begin,end) into [2][rows][width].
void chroma_rows(const ImageLossParams& p, int64_t begin, int64_t end, float* planes) {
  const int64_t rows = end - begin, plane = rows * p.width;
  const float* M = p.matrix;
  const float u0 = M[0], u1 = M[1], u2 = M[2], v0 = M[3], v1 = M[4], v2 = M[5];
  for (int64_t y = begin; y < end; ++y) {
    float* __restrict u = planes + (y - begin) * p.width;
    float* __restrict v = u + plane;
    const uint8_t* __restrict mask = p.mask + y * p.width;
    if (!any(mask, p.width)) {
      std::memset(u, 0, static_cast<size_t>(p.width) * sizeof(float));
      std::memset(v, 0, static_cast<size_t>(p.width) * sizeof(float));
      continue;
    }
    const float* __restrict r = p.rendered + 3 * y * p.width;
    const float* __restrict t = p.target + 3 * y * p.width;
    for (int64_t x = 0; x < p.width; ++x) {
      const float d0 = r[3 * x] - t[3 * x], d1 = r[3 * x + 1] - t[3 * x + 1], d2 = r[3 * x + 2] - t[3 * x + 2];
      u[x] = mask[x] != 0 ? u0 * d0 + u1 * d1 + u2 * d2 : 0.0f;
      v[x] = mask[x] != 0 ? v0 * d0 + v1 * d1 + v2 * d2 : 0.0f;
    }
  }
}

/// One row smoothed along y from rows first .. first+rows-1 of a plane, then along x. Beyond the image is 0.
void smooth_row(const ImageLossParams& p, const float* plane, int64_t first, int64_t rows, int64_t y,
                float* __restrict line, float* __restrict out) {
  const int64_t W = p.width;
  const int h = p.half_size;
  float* __restrict middle = line + h;  // h zeros on either side
  std::memset(line, 0, static_cast<size_t>(W + 2 * h) * sizeof(float));
  for (int k = -h; k <= h; ++k) {
    const int64_t from = y + k - first;
    if (from < 0 || from >= rows) continue;
    const float tap = p.taps[k < 0 ? -k : k];
    const float* __restrict row = plane + from * W;
    for (int64_t x = 0; x < W; ++x) middle[x] += tap * row[x];
  }
  for (int64_t x = 0; x < W; ++x) out[x] = p.taps[0] * middle[x];
  for (int k = 1; k <= h; ++k) {
    const float tap = p.taps[k];
    for (int64_t x = 0; x < W; ++x) out[x] += tap * (middle[x - k] + middle[x + k]);
  }
}

inline int64_t clamp(int64_t value, int64_t low, int64_t high) {
  return value < low ? low : (value > high ? high : value);
}

/// The rows of an image that are in memory: [first, first + rows).
struct Rows {
  int64_t first, rows;
  float* planes;  ///< [2][rows][W]
};

/// The smoothed chroma of rows [begin,end), in p.scratch.
Rows smoothed_chroma(const ImageLossParams& p, int64_t begin, int64_t end) {
  const int64_t W = p.width;
  const int h = p.half_size;
  const int64_t a = clamp(begin - h, 0, p.height), b = clamp(end + h, 0, p.height);
  Rows raw{a, b - a, p.scratch};
  chroma_rows(p, a, b, raw.planes);
  if (h == 0) return raw;
  Rows out{begin, end - begin, raw.planes + 2 * raw.rows * W};
  float* line = out.planes + 2 * out.rows * W;
  for (int plane = 0; plane < 2; ++plane) {
    for (int64_t y = begin; y < end; ++y) {
      smooth_row(p, raw.planes + plane * raw.rows * W, raw.first, raw.rows, y, line,
                 out.planes + (plane * out.rows + y - begin) * W);
    }
  }
  return out;
}

/// M^T g in the mask: colours of a row from the two smoothed planes.
void chroma_gradient_row(const ImageLossParams& p, int64_t y, const float* __restrict u, const float* __restrict v) {
  const float* M = p.matrix;
  const float s = p.scale;
  const float u0 = s * M[0], u1 = s * M[1], u2 = s * M[2], v0 = s * M[3], v1 = s * M[4], v2 = s * M[5];
  const uint8_t* __restrict mask = p.mask + y * p.width;
  float* __restrict g = p.gradient + 3 * y * p.width;
  for (int64_t x = 0; x < p.width; ++x) {
    const bool in = mask[x] != 0;
    g[3 * x] = in ? u0 * u[x] + v0 * v[x] : 0.0f;
    g[3 * x + 1] = in ? u1 * u[x] + v1 * v[x] : 0.0f;
    g[3 * x + 2] = in ? u2 * u[x] + v2 * v[x] : 0.0f;
  }
}

void chroma_backward(const ImageLossParams& p, int64_t begin, int64_t end) {
  const int64_t W = p.width;
  const int h = p.half_size;
  // The gradient of a smoothed image is smoothed again, with the same symmetric taps.
  const Rows once = smoothed_chroma(p, clamp(begin - h, 0, p.height), clamp(end + h, 0, p.height));
  float* line = once.planes + 2 * once.rows * W;
  float* twice = line + W + 2 * h;
  for (int64_t y = begin; y < end; ++y) {
    const float *u = once.planes + (y - once.first) * W, *v = u + once.rows * W;
    if (h > 0) {
      smooth_row(p, once.planes, once.first, once.rows, y, line, twice);
      smooth_row(p, once.planes + once.rows * W, once.first, once.rows, y, line, twice + W);
      u = twice;
      v = twice + W;
    }
    chroma_gradient_row(p, y, u, v);
  }
}

}  // namespace

int64_t image_loss_scratch(const ImageLossParams& p, int64_t rows) {
  if (p.measure != kChroma) return 6 * p.width;
  const int h = p.half_size;
  return 2 * p.width * (rows + 4 * h) + 2 * p.width * (rows + 2 * h) + (p.width + 2 * h) + 2 * p.width;
}

void image_loss_forward(const ImageLossParams& p, int64_t begin, int64_t end) {
  double sum = 0.0;
  if (p.measure == kChroma) {
    const Rows rows = smoothed_chroma(p, begin, end);
    for (int plane = 0; plane < 2; ++plane) {
      const float* first = rows.planes + (plane * rows.rows + begin - rows.first) * p.width;
      for (int64_t y = begin; y < end; ++y) sum += row_sum<false>(first + (y - begin) * p.width, p.width);
    }
  } else {
    float *weight = p.scratch, *difference = weight + 3 * p.width;
    for (int64_t y = begin; y < end; ++y) {
      if (!any(p.mask + y * p.width, p.width)) continue;
      row_difference(p, y, weight, difference);
      sum += p.measure == kSquares ? row_sum<false>(difference, 3 * p.width) : row_sum<true>(difference, 3 * p.width);
    }
  }
  *p.sum = sum;
}

void image_loss_backward(const ImageLossParams& p, int64_t begin, int64_t end) {
  if (p.measure == kChroma) {
    chroma_backward(p, begin, end);
    return;
  }
  float *weight = p.scratch, *difference = weight + 3 * p.width;
  const float step = 255.0f * p.scale;
  for (int64_t y = begin; y < end; ++y) {
    float* __restrict g = p.gradient + 3 * y * p.width;
    if (!any(p.mask + y * p.width, p.width)) {
      std::memset(g, 0, static_cast<size_t>(3 * p.width) * sizeof(float));
      continue;
    }
    row_difference(p, y, weight, difference);
    if (p.measure == kSquares) {
      for (int64_t i = 0; i < 3 * p.width; ++i) g[i] = step * difference[i];
    } else {
      for (int64_t i = 0; i < 3 * p.width; ++i)
        g[i] = difference[i] > 0.0f ? step : (difference[i] < 0.0f ? -step : 0.0f);
    }
  }
}

void erode_rows(const uint8_t* from, int64_t height, int64_t width, int64_t begin, int64_t end, uint8_t* to) {
  for (int64_t y = begin; y < end; ++y) {
    const uint8_t* __restrict here = from + y * width;
    const uint8_t* __restrict above = y > 0 ? here - width : here;
    const uint8_t* __restrict below = y + 1 < height ? here + width : here;
    uint8_t* __restrict out = to + y * width;
    const auto column = [&](int64_t x) { return static_cast<uint8_t>(above[x] & here[x] & below[x]); };
    for (int64_t x = 1; x + 1 < width; ++x) out[x] = column(x - 1) & column(x) & column(x + 1);
    if (width == 0) continue;
    out[0] = width > 1 ? column(0) & column(1) : column(0);
    if (width > 1) out[width - 1] = column(width - 2) & column(width - 1);
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
