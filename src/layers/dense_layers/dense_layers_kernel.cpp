// Layers of a small network for blocks of points. The weights of a panel of outputs stay in the first-level cache while
// all points of the block pass, and the sums of a few points stay in registers.

#include "doppel/layers/dense_layers/dense_layers_kernel.h"

#include <cstring>

#include "doppel/core/vector_width.h"

namespace doppel::kernels::DOPPEL_ISA {

namespace {

constexpr int64_t kDenseLanes = kVectorBytes / sizeof(float);
// 24 sums of 32 registers, or 12 of 16.
constexpr int kPanelVectors = kVectorBytes == 64 ? 4 : 2;
constexpr int kPoints = 6;
constexpr int64_t kPanel = kPanelVectors * kDenseLanes;
constexpr int64_t kBlock = 48;  // points

typedef float DenseVec __attribute__((vector_size(kVectorBytes)));
typedef float LooseDenseVec __attribute__((vector_size(kVectorBytes), aligned(4), may_alias));

inline DenseVec load_dense(const float* p) { return *reinterpret_cast<const LooseDenseVec*>(p); }
inline void store_dense(float* p, DenseVec v) { *reinterpret_cast<LooseDenseVec*>(p) = v; }

template <int N>
inline void multiply_points(const float* from, int64_t stride, const float* weight, const float* bias, int64_t inputs,
                            float lowest, float* to, int64_t to_stride) {
  DenseVec sum[N][kPanelVectors];
  for (int v = 0; v < kPanelVectors; ++v)
    for (int i = 0; i < N; ++i) sum[i][v] = load_dense(bias + v * kDenseLanes);
  for (int64_t k = 0; k < inputs; ++k, weight += kPanel) {
    DenseVec w[kPanelVectors];
    for (int v = 0; v < kPanelVectors; ++v) w[v] = load_dense(weight + v * kDenseLanes);
    for (int i = 0; i < N; ++i) {
      const DenseVec x = from[i * stride + k] - DenseVec{};
      for (int v = 0; v < kPanelVectors; ++v) sum[i][v] += w[v] * x;
    }
  }
  for (int i = 0; i < N; ++i)
    for (int v = 0; v < kPanelVectors; ++v)
      store_dense(to + i * to_stride + v * kDenseLanes, sum[i][v] > lowest ? sum[i][v] : lowest - DenseVec{});
}

inline void run_layer(const DenseLayerParams& layer, const float* from, int64_t stride, int64_t points, float* to) {
  const int64_t to_stride = layer.panels * kPanel;
  const float lowest = layer.rectified ? 0.0f : -__builtin_inff();
  for (int64_t panel = 0; panel < layer.panels; ++panel) {
    const float *weight = layer.weight + panel * layer.inputs * kPanel, *bias = layer.bias + panel * kPanel;
    float* column = to + panel * kPanel;
    int64_t i = 0;
    for (; i + kPoints <= points; i += kPoints)
      multiply_points<kPoints>(from + i * stride, stride, weight, bias, layer.inputs, lowest, column + i * to_stride,
                               to_stride);
    for (; i < points; ++i)
      multiply_points<1>(from + i * stride, stride, weight, bias, layer.inputs, lowest, column + i * to_stride,
                         to_stride);
  }
}

inline int64_t widest(const DenseLayerParams* layers, int count) {
  int64_t width = 0;
  for (int l = 0; l < count; ++l) width = layers[l].panels * kPanel > width ? layers[l].panels * kPanel : width;
  return width;
}

}  // namespace

int64_t dense_panel() { return kPanel; }

int64_t dense_layers_scratch(const DenseLayerParams* layers, int count) { return 2 * kBlock * widest(layers, count); }

void dense_layers(const DenseLayerParams* layers, int count, const float* points, int64_t num_points, float* out,
                  float* scratch) {
  float* buffers[2] = {scratch, scratch + kBlock * widest(layers, count)};
  const int64_t outputs = layers[count - 1].outputs;
  for (int64_t first = 0; first < num_points; first += kBlock) {
    const int64_t size = num_points - first < kBlock ? num_points - first : kBlock;
    const float* from = points + first * layers[0].inputs;
    int64_t stride = layers[0].inputs;
    for (int l = 0; l < count; ++l) {
      run_layer(layers[l], from, stride, size, buffers[l % 2]);
      from = buffers[l % 2];
      stride = layers[l].panels * kPanel;
    }
    for (int64_t i = 0; i < size; ++i)
      std::memcpy(out + (first + i) * outputs, from + i * stride, static_cast<std::size_t>(outputs) * sizeof(float));
  }
}

}  // namespace doppel::kernels::DOPPEL_ISA
