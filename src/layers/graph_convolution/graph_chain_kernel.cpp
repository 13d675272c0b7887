// A graph network on one sample, step by step (graph_chain_kernel.h).
//
// The features of a node stay in registers. The kernels are read once, in the order of memory. They do not fit into the
// cache, so a step takes at least the time of reading them.

#include "doppel/layers/graph_convolution/graph_chain_kernel.h"

#include "doppel/core/exponential.h"
#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int64_t kLanes = kVectorBytes / sizeof(float);
constexpr int64_t kParts = kChainFeatures / kLanes;  // vectors of a row
// Several independent sums: one sum would wait for the latency of each addition.
constexpr int64_t kSums = kParts >= 4 ? 1 : 4 / kParts;

typedef float Part __attribute__((vector_size(kVectorBytes)));
typedef float LoosePart __attribute__((vector_size(kVectorBytes), aligned(4), may_alias));
typedef int32_t IntPart __attribute__((vector_size(kVectorBytes)));
typedef uint32_t Words __attribute__((vector_size(kVectorBytes)));
typedef uint32_t LooseWords __attribute__((vector_size(kVectorBytes), aligned(4), may_alias));

struct Row {
  Part part[kParts];
};

inline Row load_row(const float* from) {
  Row row;
  for (int64_t v = 0; v < kParts; ++v) row.part[v] = *reinterpret_cast<const LoosePart*>(from + v * kLanes);
  return row;
}
inline void store_row(float* to, const Row& row) {
  for (int64_t v = 0; v < kParts; ++v) *reinterpret_cast<LoosePart*>(to + v * kLanes) = row.part[v];
}
inline void add(Row* to, const Row& row) {
  for (int64_t v = 0; v < kParts; ++v) to->part[v] += row.part[v];
}
inline void add_product(Row* to, float factor, const Row& row) {
  for (int64_t v = 0; v < kParts; ++v) to->part[v] += factor * row.part[v];
}

inline Part elu_part(Part x) {
  const Part zero = {};
  const IntPart positive = x > zero;
  const Part below = exp_of_negative<Part, IntPart>((Part)(~positive & (IntPart)x)) - 1.0f;
  return (Part)((positive & (IntPart)x) | (~positive & (IntPart)below));
}

inline Row elu_row(Row x) {
  for (int64_t v = 0; v < kParts; ++v) x.part[v] = elu_part(x.part[v]);
  return x;
}

// ---- y = a K ----

/// Rows of a kernel in float.
struct FloatKernel {
  static constexpr int64_t kNodeBytes = kChainFeatures * kChainFeatures * sizeof(float);
  static inline void add_pair(const void* kernel, int64_t pair, float even, float odd, Row* sum_even, Row* sum_odd) {
    const float* rows = static_cast<const float*>(kernel) + 2 * pair * kChainFeatures;
    add_product(sum_even, even, load_row(rows));
    add_product(sum_odd, odd, load_row(rows + kChainFeatures));
  }
};

/// Words of two bfloat16, which are the upper halves of floats.
struct ShortKernel {
  static constexpr int64_t kNodeBytes = kChainFeatures * kChainFeatures * 2;
  static inline void add_pair(const void* kernel, int64_t pair, float even, float odd, Row* sum_even, Row* sum_odd) {
    const uint32_t* words = static_cast<const uint32_t*>(kernel) + pair * kChainFeatures;
    for (int64_t v = 0; v < kParts; ++v) {
      const Words both = *reinterpret_cast<const LooseWords*>(words + v * kLanes);
      sum_even->part[v] += even * (Part)(both << 16);
      sum_odd->part[v] += odd * (Part)(both & 0xffff0000u);
    }
  }
};

template <typename Kernel>
inline Row multiply_row_by(const float* a, const void* kernel) {
  constexpr int64_t kPairSums = kSums >= 2 ? kSums : 2;
  Row sum[kPairSums] = {};
  for (int64_t pair = 0; pair < kChainFeatures / 2; ++pair) {
    const int64_t at = 2 * pair % kPairSums;
    Kernel::add_pair(kernel, pair, a[2 * pair], a[2 * pair + 1], &sum[at], &sum[at + 1]);
  }
  for (int64_t i = 1; i < kPairSums; ++i) add(&sum[0], sum[i]);
  return sum[0];
}

// ---- the sum over neighbours ----

template <typename Column>
inline __attribute__((always_inline)) Row sum_of_rings(const GraphChainStep& p, const Column* columns,
                                                       int64_t position) {
  const int32_t* begins = p.begins + position * p.rings;
  Row sum[kSums] = {};
  Row total = {};
  for (int64_t ring = 0; ring < p.rings; ++ring) {
    int64_t at = begins[ring];
    const int64_t end = begins[ring + 1];
    for (; at + kSums <= end; at += kSums)
      for (int64_t i = 0; i < kSums; ++i) add(&sum[i], load_row(p.products + columns[at + i] * kChainFeatures));
    for (; at < end; ++at) add(&sum[0], load_row(p.products + columns[at] * kChainFeatures));
    for (int64_t i = 0; i < kSums; ++i) add(&total, sum[i]);
  }
  for (int64_t v = 0; v < kParts; ++v) total.part[v] *= p.scales[position];
  return total;
}

inline __attribute__((always_inline)) Row features_of(const GraphChainStep& p, int64_t position) {
  const int64_t at = position * kChainFeatures;
  Row x = load_row(p.bias + at);
  if (p.products)
    add(&x, p.short_columns ? sum_of_rings(p, p.short_columns, position) : sum_of_rings(p, p.columns, position));
  if (p.skip) add(&x, load_row(p.skip + at));
  if (p.common) add(&x, load_row(p.common));
  return x;
}

inline Row normalised(const GraphChainStep& p, int64_t position, Row x) {
  if (!p.norm_scale) return x;
  const Row scale = load_row(p.norm_scale + position * kChainFeatures),
            shift = load_row(p.norm_shift + position * kChainFeatures);
  for (int64_t v = 0; v < kParts; ++v) x.part[v] = x.part[v] * scale.part[v] + shift.part[v];
  return x;
}

inline int64_t block_end(int64_t nodes, int64_t block) {
  const int64_t end = (block + 1) * kChainBlock;
  return end < nodes ? end : nodes;
}

// Kernels are prefetched some nodes ahead, half of a node's kernel at a time, because the cache has few requests in
// flight.
constexpr int64_t kBytesAhead = 4096, kLineBytes = 64;

void sum_alone(const GraphChainStep& p, int64_t begin, int64_t end) {
  for (int64_t position = begin * kChainBlock; position < block_end(p.nodes, end - 1); ++position)
    store_row(p.features + position * kChainFeatures, features_of(p, position));
}

// Nodes that are computed side by side, so that their latencies overlap.
constexpr int64_t kSide = 2;

template <int64_t kBytes>
inline void prefetch(const char* from) {
  for (int64_t line = 0; line < kBytes; line += kLineBytes) __builtin_prefetch(from + line, 0, 3);
}

template <typename Kernel>
inline __attribute__((always_inline)) void step_nodes(const GraphChainStep& p, int64_t first, int64_t count,
                                                      Row* block_sum) {
  constexpr int64_t kHalf = Kernel::kNodeBytes / 2;
  const char* kernels = static_cast<const char*>(p.kernels) + first * Kernel::kNodeBytes;
  Row x[kSide];
  for (int64_t i = 0; i < count; ++i) {
    prefetch<kHalf>(kernels + i * Kernel::kNodeBytes + kBytesAhead);
    x[i] = features_of(p, first + i);
  }
  if (p.features)
    for (int64_t i = 0; i < count; ++i) store_row(p.features + (first + i) * kChainFeatures, x[i]);
  alignas(64) float active[kSide][kChainFeatures];
  for (int64_t i = 0; i < count; ++i) store_row(active[i], elu_row(normalised(p, first + i, x[i])));
  for (int64_t i = 0; i < count; ++i) {
    const char* kernel = kernels + i * Kernel::kNodeBytes;
    prefetch<kHalf>(kernel + kHalf + kBytesAhead);
    const Row y = multiply_row_by<Kernel>(active[i], kernel);
    if (p.next) store_row(p.next + (first + i) * kChainFeatures, y);
    add(block_sum, y);
  }
}

template <typename Kernel>
void step(const GraphChainStep& p, int64_t begin, int64_t end) {
  if (!p.kernels) return sum_alone(p, begin, end);
  for (int64_t block = begin; block < end; ++block) {
    Row block_sum = {};
    const int64_t last = block_end(p.nodes, block);
    int64_t position = block * kChainBlock;
    for (; position + kSide <= last; position += kSide) step_nodes<Kernel>(p, position, kSide, &block_sum);
    if (position < last) step_nodes<Kernel>(p, position, last - position, &block_sum);
    if (p.sums) store_row(p.sums + block * kChainFeatures, block_sum);
  }
}

}  // namespace

void graph_chain_step(const GraphChainStep& p, int64_t begin, int64_t end) { step<FloatKernel>(p, begin, end); }

void graph_chain_step_short(const GraphChainStep& p, int64_t begin, int64_t end) { step<ShortKernel>(p, begin, end); }

void graph_chain_first(const GraphChainEnd& p, int64_t begin, int64_t end) {
  for (int64_t position = begin * kChainBlock; position < block_end(p.nodes, end - 1); ++position) {
    const float* features = p.features + p.order[position] * p.size;
    const float* kernel = p.kernels + position * p.size * kChainFeatures;
    Row sum[kSums] = {};
    int64_t h = 0;
    for (; h + kSums <= p.size; h += kSums)
      for (int64_t i = 0; i < kSums; ++i)
        add_product(&sum[i], features[h + i], load_row(kernel + (h + i) * kChainFeatures));
    for (; h < p.size; ++h) add_product(&sum[0], features[h], load_row(kernel + h * kChainFeatures));
    for (int64_t i = 1; i < kSums; ++i) add(&sum[0], sum[i]);
    store_row(p.next + position * kChainFeatures, sum[0]);
  }
}

void graph_chain_last(const GraphChainEnd& p, int64_t begin, int64_t end) {
  for (int64_t position = begin * kChainBlock; position < block_end(p.nodes, end - 1); ++position) {
    const Row active = elu_row(load_row(p.features + position * kChainFeatures));
    float* to = p.next + position * kChainFeatures;
    for (int64_t o = 0; o < p.size; ++o) {
      const Row kernel = load_row(p.kernels + (position * p.size + o) * kChainFeatures);
      Part sum = {};
      for (int64_t v = 0; v < kParts; ++v) sum += active.part[v] * kernel.part[v];
      float total = 0.0f;
      for (int64_t lane = 0; lane < kLanes; ++lane) total += sum[lane];
      to[o] = total;
    }
    for (int64_t o = p.size; o < kChainFeatures; ++o) to[o] = 0.0f;
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
