// Structure-aware graph convolution (6.5), fused with the normalisation and ELU before it.
//
// The neighbourhood sum dominates the cost: about 39 neighbours, each a row of batch * outputs floats. Rows are stored
// in an order in which neighbours are close, so the sum reads full vectors from the cache. Everything else is local to
// one node and uses a few kilobytes of scratch memory.

#include "doppel/layers/graph_convolution/graph_convolution_kernel.h"

#include <cmath>
#include <cstring>

#include "doppel/core/exponential.h"
#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int64_t kWidth = kVectorBytes / sizeof(float);

typedef float Vec __attribute__((vector_size(kWidth * sizeof(float))));
typedef float LooseVec __attribute__((vector_size(kWidth * sizeof(float)), aligned(4), may_alias));
typedef int32_t IntVec __attribute__((vector_size(kWidth * sizeof(float))));

inline Vec load(const float* p) { return *reinterpret_cast<const LooseVec*>(p); }
inline void store(float* p, Vec v) { *reinterpret_cast<LooseVec*>(p) = v; }
inline Vec spread(float v) { return v - Vec{}; }

inline Vec load_some(const float* p, int64_t count) {
  if (count >= kWidth) return load(p);
  float lanes[kWidth] = {};
  std::memcpy(lanes, p, count * sizeof(float));
  return load(lanes);
}
inline void store_some(float* p, Vec v, int64_t count) {
  if (count >= kWidth) return store(p, v);
  float lanes[kWidth];
  store(lanes, v);
  std::memcpy(p, lanes, count * sizeof(float));
}

inline int64_t padded(int64_t count) { return (count + kWidth - 1) / kWidth * kWidth; }

inline Vec select(IntVec mask, Vec yes, Vec no) { return (Vec)((mask & (IntVec)yes) | (~mask & (IntVec)no)); }

inline Vec elu(Vec x) {
  const Vec zero = {};
  return select(x > zero, x, exp_of_negative<Vec, IntVec>(select(x > zero, zero, x)) - 1.0f);
}

// ---- c[i][v] = sum_h a[i * row + h * step] * b[h][v], for `rows` rows of whole vectors ----

template <int kRows>
inline void multiply_block(const float* a, int64_t row, int64_t step, const float* b, int64_t b_row, int64_t depth,
                           float* c, int64_t c_row) {
  Vec sum[kRows] = {};
  for (int64_t h = 0; h < depth; ++h) {
    const Vec factor = load(b + h * b_row);
    for (int i = 0; i < kRows; ++i) sum[i] += a[i * row + h * step] * factor;
  }
  for (int i = 0; i < kRows; ++i) store(c + i * c_row, sum[i]);
}

// A single sum would wait for each addition; four independent sums hide this latency.
inline Vec multiply_row(const float* a, int64_t step, const float* b, int64_t b_row, int64_t depth) {
  Vec sum[4] = {};
  int64_t h = 0;
  for (; h + 4 <= depth; h += 4)
    for (int i = 0; i < 4; ++i) sum[i] += a[(h + i) * step] * load(b + (h + i) * b_row);
  for (; h < depth; ++h) sum[0] += a[h * step] * load(b + h * b_row);
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

inline void multiply(const float* a, int64_t row, int64_t step, const float* b, int64_t b_row, int64_t rows,
                     int64_t depth, int64_t columns, float* c, int64_t c_row) {
  for (int64_t v = 0; v < columns; v += kWidth) {
    int64_t i = 0;
    for (; i + 8 <= rows; i += 8)
      multiply_block<8>(a + i * row, row, step, b + v, b_row, depth, c + i * c_row + v, c_row);
    for (; i + 4 <= rows; i += 4)
      multiply_block<4>(a + i * row, row, step, b + v, b_row, depth, c + i * c_row + v, c_row);
    for (; i < rows; ++i) store(c + i * c_row + v, multiply_row(a + i * row, step, b + v, b_row, depth));
  }
}

// ---- sum = sum_e values[e] * rows[columns[e]], over a piece of kVectors vectors ----

template <int kVectors, int kChains>
inline void gather_piece(const float* rows, int64_t row, const int32_t* columns, const float* values, int64_t count,
                         float* sum) {
  // With few vectors the additions would wait for each other; independent sums hide this latency.
  Vec total[kChains][kVectors] = {};
  int64_t e = 0;
  for (; e + kChains <= count; e += kChains)
    for (int chain = 0; chain < kChains; ++chain) {
      const float* source = rows + columns[e + chain] * row;
      const float value = values[e + chain];
      for (int v = 0; v < kVectors; ++v) total[chain][v] += value * load(source + v * kWidth);
    }
  for (; e < count; ++e) {
    const float* source = rows + columns[e] * row;
    for (int v = 0; v < kVectors; ++v) total[0][v] += values[e] * load(source + v * kWidth);
  }
  for (int v = 0; v < kVectors; ++v) {
    Vec all = total[0][v];
    for (int chain = 1; chain < kChains; ++chain) all += total[chain][v];
    store(sum + v * kWidth, all);
  }
}

inline void gather_row(const float* rows, int64_t row, const int32_t* columns, const float* values, int64_t count,
                       float* sum) {
  int64_t at = 0;
  for (; at + 8 * kWidth <= row; at += 8 * kWidth) gather_piece<8, 1>(rows + at, row, columns, values, count, sum + at);
  for (; at + 4 * kWidth <= row; at += 4 * kWidth) gather_piece<4, 1>(rows + at, row, columns, values, count, sum + at);
  for (; at + 2 * kWidth <= row; at += 2 * kWidth) gather_piece<2, 2>(rows + at, row, columns, values, count, sum + at);
  for (; at < row; at += kWidth) gather_piece<1, 4>(rows + at, row, columns, values, count, sum + at);
}

// ---- scratch ----

struct Scratch {
  float *input, *active, *grad_output, *grad_active, *kernel, *transposed;
  float *mean, *inverse_std;
};

Scratch split_scratch(const GraphConvolutionParams& p, float* memory) {
  const int64_t in = padded(p.inputs), out = padded(p.outputs);
  Scratch s;
  s.input = memory;
  s.active = s.input + p.batch * in;
  s.grad_output = s.active + p.batch * in;
  s.grad_active = s.grad_output + p.batch * out;
  s.kernel = s.grad_active + p.batch * in;
  s.transposed = s.kernel + in * out;
  s.mean = s.transposed + in * out;
  s.inverse_std = s.mean + in;
  return s;
}

void load_rows(const float* from, int64_t from_stride, int64_t rows, int64_t count, float* to, int64_t to_stride) {
  for (int64_t i = 0; i < rows; ++i)
    for (int64_t v = 0; v < count; v += kWidth)
      store(to + i * to_stride + v, load_some(from + i * from_stride + v, count - v));
}

void store_rows(const float* from, int64_t from_stride, int64_t rows, int64_t count, float* to, int64_t to_stride) {
  for (int64_t i = 0; i < rows; ++i)
    for (int64_t v = 0; v < count; v += kWidth)
      store_some(to + i * to_stride + v, load(from + i * from_stride + v), count - v);
}

// Kernels are prefetched some nodes ahead into the second-level cache. The first-level cache has too few slots for
// pending lines, so prefetches into it would delay all other loads.
constexpr int64_t kNodesAhead = 8;

inline void prefetch_kernel(const GraphConvolutionParams& p, int64_t node) {
  constexpr int64_t kLine = 16;  // floats
  const int64_t size = p.inputs * p.outputs;
  const float* kernel = p.kernels + node * size;
  for (int64_t i = 0; i < size; i += kLine) __builtin_prefetch(kernel + i, 0, 2);
}

// K_l with rows of whole vectors: the original if it has them, otherwise a padded copy.
const float* padded_kernel(const GraphConvolutionParams& p, int64_t node, const Scratch& s) {
  const float* kernel = p.kernels + node * p.inputs * p.outputs;
  if (p.outputs == padded(p.outputs)) return kernel;
  load_rows(kernel, p.outputs, p.inputs, p.outputs, s.kernel, padded(p.outputs));
  return s.kernel;
}

// A tile of kWidth x kWidth, by exchanging halves, quarters, ... of pairs of rows.
inline void transpose_tile(const float* from, int64_t from_row, float* to, int64_t to_row) {
  Vec row[kWidth];
  for (int64_t i = 0; i < kWidth; ++i) row[i] = load(from + i * from_row);
#pragma GCC unroll 4
  for (int64_t half = kWidth / 2; half > 0; half /= 2) {
    IntVec first, second;
    for (int64_t lane = 0; lane < kWidth; ++lane) {
      first[lane] = static_cast<int32_t>((lane & half) ? kWidth + lane - half : lane);
      second[lane] = static_cast<int32_t>((lane & half) ? kWidth + lane : lane + half);
    }
#pragma GCC unroll 16
    for (int64_t i = 0; i < kWidth; ++i) {
      if (i & half) continue;
      const Vec a = row[i], b = row[i + half];
      row[i] = __builtin_shuffle(a, b, first);
      row[i + half] = __builtin_shuffle(a, b, second);
    }
  }
  for (int64_t i = 0; i < kWidth; ++i) store(to + i * to_row, row[i]);
}

// to[h'][h] = K_l[h][h'], [padded(outputs)][padded(inputs)]
void transpose_kernel(const GraphConvolutionParams& p, const float* kernel, float* to) {
  const int64_t in = padded(p.inputs), out = padded(p.outputs);
  if (in == p.inputs) {
    for (int64_t h = 0; h < in; h += kWidth)
      for (int64_t o = 0; o < out; o += kWidth) transpose_tile(kernel + h * out + o, out, to + o * in + h, in);
    return;
  }
  std::memset(to, 0, in * out * sizeof(float));
  for (int64_t h = 0; h < p.inputs; ++h)
    for (int64_t o = 0; o < p.outputs; ++o) to[o * in + h] = kernel[h * out + o];
}

// ---- norm and ELU of one node ----

void batch_moments(const float* input, int64_t batch, int64_t row, Vec* mean, Vec* variance) {
  Vec sum = {};
  for (int64_t b = 0; b < batch; ++b) sum += load(input + b * row);
  *mean = sum / static_cast<float>(batch);
  Vec square = {};
  for (int64_t b = 0; b < batch; ++b) {
    const Vec centred = load(input + b * row) - *mean;
    square += centred * centred;
  }
  *variance = square / static_cast<float>(batch);
}

// Mean and 1 / std of node `node` into scratch and, for the backward pass, into p.mean and p.inverse_std.
void find_statistics(const GraphConvolutionParams& p, int64_t node, const Scratch& s) {
  const int64_t in = padded(p.inputs), at = node * p.inputs;
  for (int64_t v = 0; v < in; v += kWidth) {
    const int64_t left = p.inputs - v;
    Vec mean, variance;
    if (p.batch_statistics) {
      batch_moments(s.input + v, p.batch, in, &mean, &variance);
      const float unbiased = static_cast<float>(p.batch) / static_cast<float>(p.batch - 1);
      const Vec old_mean = load_some(p.running_mean + at + v, left), old_var = load_some(p.running_var + at + v, left);
      store_some(p.running_mean + at + v, old_mean + p.momentum * (mean - old_mean), left);
      store_some(p.running_var + at + v, old_var + p.momentum * (variance * unbiased - old_var), left);
    } else {
      mean = load_some(p.running_mean + at + v, left);
      variance = load_some(p.running_var + at + v, left);
    }
    Vec inverse;
    const Vec guarded = variance + p.epsilon;
    for (int64_t lane = 0; lane < kWidth; ++lane) inverse[lane] = 1.0f / std::sqrt(guarded[lane]);
    store_some(p.mean + at + v, mean, left);
    store_some(p.inverse_std + at + v, inverse, left);
  }
}

// active = elu(norm(input)); the statistics are in p.mean and p.inverse_std.
void activate(const GraphConvolutionParams& p, int64_t node, const float* input, float* active) {
  const int64_t in = padded(p.inputs), at = node * p.inputs;
  for (int64_t v = 0; v < in; v += kWidth) {
    Vec mean = {}, scale = spread(1.0f), shift = {};
    if (p.norm_weight) {
      const int64_t left = p.inputs - v;
      mean = load_some(p.mean + at + v, left);
      scale = load_some(p.norm_weight + at + v, left) * load_some(p.inverse_std + at + v, left);
      shift = load_some(p.norm_bias + at + v, left);
    }
    for (int64_t b = 0; b < p.batch; ++b) {
      const Vec x = (load(input + b * in + v) - mean) * scale + shift;
      store(active + b * in + v, p.elu ? elu(x) : x);
    }
  }
}

const float* node_input(const GraphConvolutionParams& p, int64_t node, const Scratch& s, bool fresh_statistics) {
  const int64_t in = padded(p.inputs);
  load_rows(p.features.data + node * p.features.node_stride, p.features.batch_stride, p.batch, p.inputs, s.input, in);
  if (p.norm_weight && fresh_statistics) find_statistics(p, node, s);
  if (!p.norm_weight && !p.elu) return s.input;
  activate(p, node, s.input, s.active);
  return s.active;
}

// ELU: y = x > 0 ? x : e^x - 1, so dx = dy * (y > 0 ? 1 : y + 1).
void backward_elu(const GraphConvolutionParams& p, const Scratch& s) {
  const Vec zero = {}, one = spread(1.0f);
  for (int64_t i = 0; i < p.batch * padded(p.inputs); i += kWidth) {
    const Vec y = load(s.active + i);
    store(s.grad_active + i, load(s.grad_active + i) * select(y > zero, one, y + one));
  }
}

// u = w h + c with h = (x - mean) s; dw = sum du h, dc = sum du.
// Batch statistics: dx = w s (du - dc / B - h dw / B); fixed ones: dx = w s du.
void backward_norm(const GraphConvolutionParams& p, int64_t node, const Scratch& s) {
  const int64_t in = padded(p.inputs), at = node * p.inputs;
  const float share = p.batch_statistics ? 1.0f / static_cast<float>(p.batch) : 0.0f;
  for (int64_t v = 0; v < in; v += kWidth) {
    const int64_t left = p.inputs - v;
    const Vec mean = load_some(p.mean + at + v, left), inverse = load_some(p.inverse_std + at + v, left);
    Vec grad_weight = {}, grad_bias = {};
    for (int64_t b = 0; b < p.batch; ++b) {
      const Vec du = load(s.grad_active + b * in + v);
      grad_bias += du;
      grad_weight += du * (load(s.input + b * in + v) - mean) * inverse;
    }
    store_some(p.grad_norm_weight + at + v, grad_weight, left);
    store_some(p.grad_norm_bias + at + v, grad_bias, left);
    const Vec scale = load_some(p.norm_weight + at + v, left) * inverse;
    for (int64_t b = 0; b < p.batch; ++b) {
      const Vec normalised = (load(s.input + b * in + v) - mean) * inverse;
      const Vec du = load(s.grad_active + b * in + v);
      store(s.grad_active + b * in + v, scale * (du - share * (grad_bias + normalised * grad_weight)));
    }
  }
}

}  // namespace

int64_t graph_convolution_width() { return kWidth; }

int64_t graph_convolution_scratch(const GraphConvolutionParams& p) {
  const int64_t in = padded(p.inputs), out = padded(p.outputs);
  return p.batch * (3 * in + out) + 2 * in * out + 2 * in;
}

namespace {

// One sample, no norm, 16 features: the case of an actor at run time. Everything stays in registers.
constexpr int64_t kSampleInputs = 16;

bool is_sample(const GraphConvolutionParams& p) {
  return p.batch == 1 && !p.norm_weight && p.inputs == kSampleInputs && p.outputs == padded(p.outputs);
}

// use(v, vector v of act(f_l) K_l)
template <typename Use>
inline void transform_sample(const GraphConvolutionParams& p, int64_t node, const Use& use) {
  alignas(64) float active[kSampleInputs];
  const float* input = p.features.data + node * p.features.node_stride;
  for (int64_t v = 0; v < kSampleInputs; v += kWidth) {
    const Vec x = load(input + v);
    store(active + v, p.elu ? elu(x) : x);
  }
  const float* kernel = p.kernels + node * kSampleInputs * p.outputs;
  for (int64_t v = 0; v < p.outputs; v += kWidth) use(v, multiply_row(active, 1, kernel + v, p.outputs, kSampleInputs));
}

void transform_node(const GraphConvolutionParams& p, int64_t node, const Scratch& s, float* to) {
  const int64_t in = padded(p.inputs), out = padded(p.outputs);
  const float* input = node_input(p, node, s, true);
  multiply(input, in, 1, padded_kernel(p, node, s), out, p.batch, p.inputs, out, to, out);
}

}  // namespace

void graph_convolution_transform(const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end) {
  const Scratch s = split_scratch(p, scratch);
  const bool sample = is_sample(p);
  for (int64_t node = begin; node < end; ++node) {
    if (node + kNodesAhead < end) prefetch_kernel(p, node + kNodesAhead);
    float* to = p.packed + p.positions[node] * p.batch * padded(p.outputs);
    if (sample)
      transform_sample(p, node, [to](int64_t v, Vec product) { store(to + v, product); });
    else
      transform_node(p, node, s, to);
  }
}

void graph_convolution_gather(const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end) {
  float* sum = split_scratch(p, scratch).grad_output;
  const int64_t out = padded(p.outputs), row = p.batch * out;
  for (int64_t position = begin; position < end; ++position) {
    const int64_t node = p.order[position], first = p.offsets[position];
    gather_row(p.packed, row, p.columns + first, p.values + first, p.offsets[position + 1] - first, sum);
    for (int64_t v = 0; v < out; v += kWidth) {
      const int64_t left = p.outputs - v;
      const Vec bias = load_some(p.bias + node * p.outputs + v, left);
      for (int64_t b = 0; b < p.batch; ++b) {
        Vec total = load(sum + b * out + v) + bias;
        if (p.skip.data)
          total += load_some(p.skip.data + b * p.skip.batch_stride + node * p.skip.node_stride + v, left);
        store_some(p.output.data + b * p.output.batch_stride + node * p.output.node_stride + v, total, left);
      }
    }
  }
}

void graph_convolution_pack(const GraphConvolutionParams& p, float*, int64_t begin, int64_t end) {
  const int64_t out = padded(p.outputs);
  for (int64_t position = begin; position < end; ++position) {
    const int64_t node = p.order[position];
    float* row = p.packed + position * p.batch * out;
    load_rows(p.grad_output.data + node * p.grad_output.node_stride, p.grad_output.batch_stride, p.batch, p.outputs,
              row, out);
    for (int64_t v = 0; v < out; v += kWidth) {
      Vec sum = {};
      for (int64_t b = 0; b < p.batch; ++b) sum += load(row + b * out + v);
      store_some(p.grad_bias + node * p.outputs + v, sum, p.outputs - v);
    }
  }
}

namespace {

// dK, dy and the gradients derived from them, of one node: dz_l is in s.grad_output, y_l in `input`.
void backward_of_node(const GraphConvolutionParams& p, int64_t node, const Scratch& s, const float* input) {
  const int64_t in = padded(p.inputs), out = padded(p.outputs);
  float* grad_kernel = p.grad_kernels + node * p.inputs * p.outputs;
  const bool direct = p.outputs == out;
  float* product = direct ? grad_kernel : s.transposed;
  multiply(input, 1, in, s.grad_output, out, p.inputs, p.batch, out, product, out);
  if (!direct) store_rows(product, out, p.inputs, p.outputs, grad_kernel, p.outputs);

  if (!p.grad_features.data && !p.norm_weight) return;
  transpose_kernel(p, padded_kernel(p, node, s), s.transposed);
  multiply(s.grad_output, out, 1, s.transposed, in, p.batch, p.outputs, in, s.grad_active, in);
  if (p.elu) backward_elu(p, s);
  if (p.norm_weight) backward_norm(p, node, s);
  if (p.grad_features.data)
    store_rows(s.grad_active, in, p.batch, p.inputs, p.grad_features.data + node * p.grad_features.node_stride,
               p.grad_features.batch_stride);
}

}  // namespace

// With g = grad_output and y_l = act(f_l):
//   dz_l = sum_k a_kl g_k,  dK_l = y_l^T dz_l,  dy_l = dz_l K_l^T,  then ELU and norm of the node.
void graph_convolution_backward(const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end) {
  const Scratch s = split_scratch(p, scratch);
  const int64_t out = padded(p.outputs);
  for (int64_t position = begin; position < end; ++position) {
    if (position + kNodesAhead < end) prefetch_kernel(p, p.order[position + kNodesAhead]);
    const int64_t node = p.order[position], first = p.offsets[position];
    gather_row(p.packed, p.batch * out, p.columns + first, p.transposed_values + first, p.offsets[position + 1] - first,
               s.grad_output);
    const float* input = node_input(p, node, s, false);

    backward_of_node(p, node, s, input);
  }
}

namespace {

// total += act(f_l) K_l
void add_node(const GraphConvolutionParams& p, int64_t node, const Scratch& s, float* total) {
  if (is_sample(p))
    return transform_sample(p, node, [total](int64_t v, Vec product) { store(total + v, load(total + v) + product); });
  transform_node(p, node, s, s.grad_output);
  for (int64_t i = 0; i < p.batch * padded(p.outputs); i += kWidth)
    store(total + i, load(total + i) + load(s.grad_output + i));
}

}  // namespace

void graph_dense_sum(const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end) {
  const Scratch s = split_scratch(p, scratch);
  const int64_t row = p.batch * padded(p.outputs);
  for (int64_t block = begin; block < end; ++block) {
    float* total = p.packed + block * row;
    std::memset(total, 0, row * sizeof(float));
    const int64_t last = (block + 1) * kGraphDenseBlock;
    for (int64_t node = block * kGraphDenseBlock; node < (last < p.nodes ? last : p.nodes); ++node) {
      if (node + kNodesAhead < p.nodes) prefetch_kernel(p, node + kNodesAhead);
      add_node(p, node, s, total);
    }
  }
}

void graph_dense_backward(const GraphConvolutionParams& p, float* scratch, int64_t begin, int64_t end) {
  const Scratch s = split_scratch(p, scratch);
  load_rows(p.grad_output.data, p.grad_output.batch_stride, p.batch, p.outputs, s.grad_output, padded(p.outputs));
  for (int64_t node = begin; node < end; ++node) backward_of_node(p, node, s, node_input(p, node, s, false));
}

}  // namespace doppel::kernels::DOPPEL_ISA
