#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "doppel/core/error.h"
#include "doppel/nets/weights/torch_pickle.h"

namespace doppel {

/// The zip archive that torch.save of PyTorch 1.6 or later and torch::pickle_save write: a pickle, and the numbers of
/// each storage as a part of its own. Nothing in it is executed, and the memory it takes is limited by its size.
class TorchArchive {
 public:
  /// @param path the file, whose list of parts is read once more @param bytes its content
  /// @throws FileError: no such archive, compressed or damaged parts, or big-endian numbers
  TorchArchive(const std::filesystem::path& path, std::string bytes);

  /// @throws FileError as read_torch_pickle
  PickledDictionary dictionary() const { return read_torch_pickle(part("data.pkl"), where_); }

  /// The tensor of a description, on the CPU. Tensors of one storage share their memory, as in the file.
  /// @throws FileError: an unknown type, a missing storage, or a tensor that reaches beyond its storage or has more
  /// elements than it
  torch::Tensor tensor(const PickledTensor& found);

 private:
  void list_parts(const std::filesystem::path& path);
  std::string_view part(const std::string& name) const;
  const torch::Tensor& storage(const std::string& key);

  FileLocation where_;
  std::string bytes_;
  std::map<std::string, std::string_view> parts_;  ///< without the folder that all of them lie in
  std::map<std::string, torch::Tensor> storages_;
  std::size_t loaded_ = 0;  ///< bytes of them
};

}  // namespace doppel
