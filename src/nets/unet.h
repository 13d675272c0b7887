#pragma once

/// The encoder and decoder of pix2pix (Isola et al. 2017) with skip connections. The depth follows from the size of the
/// image.

#include <torch/nn/module.h>
#include <torch/nn/modules/conv.h>
#include <torch/nn/pimpl.h>
#include <torch/types.h>

#include <optional>
#include <utility>
#include <vector>

#include "doppel/core/options.h"
#include "doppel/distributed/batch_share.h"
#include "doppel/nets/shared_norm.h"

namespace doppel {

/// The upsampling of the decoder: one transposed 4x4 convolution, or bilinear interpolation and a 3x3 convolution (no
/// checkerboard artefacts, more multiplications).
enum class Upsampling { transposed, bilinear_conv };

struct UNetConfig {
  int levels = 10;          ///< halvings on the way down, 1 to 10
  int first_channels = 16;  ///< after the first halving; each further one doubles them, up to 512. pix2pix has 64.
  double width = 1.0;       ///< factor of all channels
  Upsampling upsample = Upsampling::transposed;
  double dropout = 0.5;  ///< on the three innermost decoder levels while training
  double norm_epsilon = 1e-3;
  double norm_momentum = 0.01;  ///< running = (1 - momentum) running + momentum new
  double leaky_slope = 0.3;     ///< of the encoder below 0; pix2pix has 0.2
  double head_scale = 1.0;      ///< factor of the last layer's initial weights

  /// @throws UsageError listing every fault
  void check() const;
  /// Channels after halving number `level` (0 is the first).
  int64_t channels(int level) const;
};
void describe_keys(const Keys& keys, UNetConfig& config);

/// Whether a network runs the kernels for inference: evaluation mode, no gradients, and float32 on the CPU outside a
/// trace of plain operations (takes_kernel).
bool runs_kernels(const torch::nn::Module& network, const torch::Tensor& input);

/// Dropout that draws from `generator` only, so that a resumed run draws the same numbers as an uninterrupted run.
/// @return features with a share `probability` set to 0 and the rest divided by 1 - probability
torch::Tensor dropout(const torch::Tensor& features, double probability, const at::Generator& generator,
                      const BatchShare& share = {});

/// A transposed 4x4 convolution of stride 2 and padding 1, computed as an ordinary convolution. Each of the four kinds
/// of output pixel depends on 2x2 inputs. All four are computed as 3x3 convolutions with zeros, and a pixel shuffle
/// arranges their channels. This takes more multiplications, but ordinary convolutions are faster on a CPU than
/// transposed ones.
/// @param features [B,Cin,H,W] @param weight [Cin,Cout,4,4] @param bias [Cout] or undefined @return [B,Cout,2H,2W]
torch::Tensor transposed_convolution(const torch::Tensor& features, const torch::Tensor& weight,
                                     const torch::Tensor& bias);

/// An image whose channels may be in two parts.
struct UNetImage {
  torch::Tensor first;   ///< [B,C1,H,W]
  torch::Tensor second;  ///< [B,C2,H,W]; undefined: none

  UNetImage(torch::Tensor image, torch::Tensor more = {}) : first(std::move(image)), second(std::move(more)) {}
  torch::Tensor joined() const;
};

/// The UNet. Batch normalisation uses the statistics of the batch, in evaluation mode the running statistics.
class UNetImpl : public torch::nn::Module {
 public:
  /// @param generator draws the initial weights, N(0, 0.02); by default a fresh one with a fixed seed
  UNetImpl(int64_t inputs, int64_t outputs, const UNetConfig& config,
           std::optional<at::Generator> generator = std::nullopt);

  /// In evaluation mode without gradients the layers run as image_convolution.
  /// @param image [B,Cin,H,W], H and W multiples of 2^levels; or its channels in two parts
  /// @param generator of the dropout; needed while training unless dropout is 0 @param share the rows of a shared batch
  /// @return [B,Cout,H,W], any real numbers: no activation follows the last convolution
  /// @throws UsageError for another size; for a training batch of 1 whose innermost map is one pixel, which batch
  /// normalisation would set to 0
  torch::Tensor forward(const UNetImage& image, const std::optional<at::Generator>& generator = std::nullopt,
                        const BatchShare& share = {});

  const UNetConfig& config() const { return config_; }

 private:
  torch::Tensor down(int level, const torch::Tensor& features);
  torch::Tensor up(int level, const torch::Tensor& features, const std::optional<at::Generator>& generator,
                   const BatchShare& share);
  torch::Tensor infer(const UNetImage& image);
  torch::Tensor infer_up(int level, const UNetImage& features);
  void check_input(const UNetImage& image, bool has_generator) const;
  void initialise(const at::Generator& generator);

  UNetConfig config_;
  int64_t inputs_;
  std::vector<torch::nn::Conv2d> down_;
  std::vector<ImageNorm> down_norm_, up_norm_;  // none for the first level down and the last up
  std::vector<torch::nn::ConvTranspose2d> up_transposed_;
  std::vector<torch::nn::Conv2d> up_convolution_;
};
TORCH_MODULE(UNet);

}  // namespace doppel
