#include "doppel/eval/lpips.h"

#include <torch/utils.h>

#include <algorithm>
#include <cstdint>
#include <map>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/image_tensor.h"

namespace doppel {

namespace {

/// A convolution of AlexNet, as torchvision builds it.
struct AlexConvolution {
  const char* name;
  int slice;  ///< of the package lpips
  std::int64_t inputs, outputs, side, stride, padding;
  bool pooled;  ///< max pooling (3 x 3, stride 2) stands before it
};
constexpr std::array<AlexConvolution, 5> kAlexNet{{{"0", 1, 3, 64, 11, 4, 2, false},
                                                   {"3", 2, 64, 192, 5, 1, 2, true},
                                                   {"6", 3, 192, 384, 3, 1, 1, true},
                                                   {"8", 4, 384, 256, 3, 1, 1, false},
                                                   {"10", 5, 256, 256, 3, 1, 1, false}}};
/// A smaller image leaves nothing after the second pooling.
constexpr int kMinSide = 31;
/// Keeps pixels without any feature at 0. The value is that of the package lpips.
constexpr double kNormFloor = 1e-10;
constexpr char kHowToGet[] =
    "one file with all weights comes from the Python packages torch and lpips: "
    "torch.save(lpips.LPIPS(net=\"alex\").state_dict(), \"lpips_alex.pth\")";

/// The weights by their names in torchvision.
std::map<std::string, torch::Tensor> by_torchvision_name(const NamedWeights& weights) {
  std::map<std::string, torch::Tensor> result;
  for (const auto& [name, tensor] : weights) {
    std::string known = name;
    for (const AlexConvolution& layer : kAlexNet) {
      const std::string beginning = fmt::format("net.slice{}.{}.", layer.slice, layer.name);
      if (name.rfind(beginning, 0) == 0)
        known = fmt::format("features.{}.{}", layer.name, name.substr(beginning.size()));
    }
    result.emplace(known, tensor);
  }
  return result;
}

/// Takes tensors by name and collects what is wrong with them.
class WeightChooser {
 public:
  explicit WeightChooser(const NamedWeights& weights) : weights_(by_torchvision_name(weights)) {}

  /// @return float32 of this shape, or an undefined tensor after a fault
  torch::Tensor take(const std::string& name, const std::vector<std::int64_t>& shape) {
    const auto found = weights_.find(name);
    if (found == weights_.end()) {
      missing_.push_back(name);
      return {};
    }
    if (found->second.sizes() == torch::IntArrayRef(shape))
      return found->second.detach().to(torch::kFloat32).contiguous();
    other_shape_.push_back(
        fmt::format("{} [{}] instead of [{}]", name, fmt::join(found->second.sizes(), ","), fmt::join(shape, ",")));
    return {};
  }

  /// @throws FileError when a tensor was missing or of another shape
  void finish(const std::string& source) const {
    std::vector<std::string> faults;
    if (!missing_.empty()) faults.push_back(fmt::format("missing: {}", fmt::join(missing_, ", ")));
    if (!other_shape_.empty()) faults.push_back(fmt::format("other shapes: {}", fmt::join(other_shape_, ", ")));
    if (!faults.empty())
      fail_at({source}, "these are not the weights of LPIPS with AlexNet ({}); {}", fmt::join(faults, "; "), kHowToGet);
  }

 private:
  std::map<std::string, torch::Tensor> weights_;
  std::vector<std::string> missing_, other_shape_;
};

/// Divides the features of each pixel by their norm. @param features [B,C,h,w]
torch::Tensor unit_features(const torch::Tensor& features) {
  return features / (features.square().sum(1, true).sqrt() + kNormFloor);
}

/// [1,3,H,W] RGB -1..1 of an 8-bit RGB image.
torch::Tensor image_tensor(const cv::Mat& image) {
  return bytes_of(image).permute({2, 0, 1}).unsqueeze(0).to(torch::kFloat32) / 127.5 - 1.0;
}

}  // namespace

Lpips::Lpips(const NamedWeights& weights, const std::string& source) : source_(source) {
  WeightChooser chooser(weights);
  for (std::size_t l = 0; l < kLayers; ++l) {
    const AlexConvolution& layer = kAlexNet[l];
    const std::string name = std::string("features.") + layer.name;
    weight_[l] = chooser.take(name + ".weight", {layer.outputs, layer.inputs, layer.side, layer.side});
    bias_[l] = chooser.take(name + ".bias", {layer.outputs});
    importance_[l] = chooser.take(fmt::format("lin{}.model.1.weight", l), {1, layer.outputs, 1, 1});
  }
  chooser.finish(source);
  for (std::size_t l = 0; l < kLayers; ++l)
    if (!importance_[l].ge(0).all().item<bool>())
      fail_at({source}, "lin{}.model.1.weight has values below 0 or NaN, but the weights of LPIPS are not negative; {}",
              l, kHowToGet);
}

Lpips Lpips::load(const std::vector<std::filesystem::path>& files) {
  if (files.empty()) fail<UsageError>("LPIPS: no weights are given; {}", kHowToGet);
  NamedWeights all;
  std::string source;
  for (const std::filesystem::path& file : files) {
    const NamedWeights weights = read_weights(file);
    all.insert(all.end(), weights.begin(), weights.end());
    source += (source.empty() ? "" : ", ") + file.string();
  }
  return Lpips(all, source);
}

std::array<torch::Tensor, Lpips::kLayers> Lpips::features(const torch::Tensor& image) const {
  const torch::Tensor shift = torch::tensor({-0.030f, -0.088f, -0.188f}).view({1, 3, 1, 1});
  const torch::Tensor scale = torch::tensor({0.458f, 0.448f, 0.450f}).view({1, 3, 1, 1});
  torch::Tensor x = (image.to(torch::kFloat32) - shift) / scale;
  std::array<torch::Tensor, kLayers> result;
  for (std::size_t l = 0; l < kLayers; ++l) {
    const AlexConvolution& layer = kAlexNet[l];
    if (layer.pooled) x = torch::max_pool2d(x, {3, 3}, {2, 2});
    x = torch::conv2d(x, weight_[l], bias_[l], layer.stride, layer.padding).relu();
    result[l] = x;
  }
  return result;
}

torch::Tensor Lpips::distance(const torch::Tensor& a, const torch::Tensor& b) const {
  const torch::NoGradGuard no_grad;
  check_shape("LPIPS", "a", a, {-1, 3, -1, -1}, "[B,3,H,W]");
  check_shape("LPIPS", "b", b, {a.size(0), 3, a.size(2), a.size(3)}, "[B,3,H,W]");
  if (a.size(2) < kMinSide || a.size(3) < kMinSide)
    fail<UsageError>("LPIPS: images must have sides of at least {} pixels, found {}", kMinSide, describe(a));
  const auto of_a = features(a), of_b = features(b);
  torch::Tensor sum = torch::zeros({a.size(0)}, torch::kFloat32);
  for (std::size_t l = 0; l < kLayers; ++l) {
    const torch::Tensor difference = unit_features(of_a[l]) - unit_features(of_b[l]);
    sum += (importance_[l] * difference.square()).sum(1).mean({1, 2});
  }
  return sum;
}

double Lpips::distance(const cv::Mat& a, const cv::Mat& b) const {
  return distance(image_tensor(a), image_tensor(b)).item<double>();
}

}  // namespace doppel
