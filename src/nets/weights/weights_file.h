#pragma once

/// Weights trained elsewhere: a file written by `torch.save(model.state_dict(), FILE)`, or a safetensors file.

#include <torch/nn/module.h>
#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace doppel {

/// Tensors by name, in the file's order; on the CPU, without gradient.
using NamedWeights = std::vector<std::pair<std::string, torch::Tensor>>;

/// Reads either format; the first bytes determine the format.
/// @throws FileError as read_torch_weights and read_safetensors
NamedWeights read_weights(const std::filesystem::path& path);

/// Reads a `.pth` of PyTorch 1.6 or later (a zip archive with a pickle). Only a mapping from names to tensors is
/// supported; nothing in the file is executed.
/// @throws FileError: damaged, an older layout, a whole model instead of its state_dict, a tensor beyond its storage
NamedWeights read_torch_weights(const std::filesystem::path& path);

/// Reads a safetensors file.
/// @throws FileError: damaged or truncated, tensors that overlap or leave gaps, an unknown type
NamedWeights read_safetensors(const std::filesystem::path& path);

/// Writes a safetensors file, atomically.
/// @param weights on the CPU; names must differ
/// @param metadata texts by name, for `__metadata__` of the header
/// @throws Error for a type that the format does not have, a name that occurs twice or is not in UTF-8, or a full disk
void write_safetensors(const std::filesystem::path& path, const NamedWeights& weights,
                       const std::map<std::string, std::string>& metadata = {});

/// Copies weights into the parameters and buffers of a module, converted to their types. File and module must have the
/// same names with the same shapes; only batch counters may be missing, because old files do not contain them.
/// @param source the file, for messages
/// @param unused prefixes of names in the file that the module does not use ("fc.")
/// @throws FileError listing what is missing, unexpected, or of another shape; the module is unchanged then
void load_weights(torch::nn::Module& module, const NamedWeights& weights, const std::filesystem::path& source,
                  const std::vector<std::string>& unused = {});

}  // namespace doppel
