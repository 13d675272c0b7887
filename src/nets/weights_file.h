#pragma once

/// Weights trained elsewhere: what `torch.save(model.state_dict(), FILE)` wrote, or a safetensors file.

#include <torch/torch.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace doppel {

/// Tensors by name, in the file's order; on the CPU, without gradient.
using NamedWeights = std::vector<std::pair<std::string, torch::Tensor>>;

/// Reads either kind; the first bytes tell which it is.
/// @throws FileError as the two below
NamedWeights read_weights(const std::filesystem::path& path);

/// A `.pth` of PyTorch 1.6 or later (a zip archive with a pickle). Only what a mapping from names to tensors needs is
/// understood; nothing in the file is executed.
/// @throws FileError: damaged, an older layout, a whole model instead of its state_dict, a tensor beyond its storage
NamedWeights read_torch_weights(const std::filesystem::path& path);

/// @throws FileError: damaged or cut short, tensors that overlap or leave gaps, an unknown type
NamedWeights read_safetensors(const std::filesystem::path& path);

/// Copies weights into the parameters and buffers of a module, converted to its types. Every name must be met on both
/// sides with the same shape; only counters of batches may be missing, as old files do not hold them.
/// @param source the file, for messages
/// @param unused beginnings of names in the file that the module does without ("fc.")
/// @throws FileError listing what is missing, unexpected, or of another shape; the module is unchanged then
void load_weights(torch::nn::Module& module, const NamedWeights& weights, const std::filesystem::path& source,
                  const std::vector<std::string>& unused = {});

}  // namespace doppel
