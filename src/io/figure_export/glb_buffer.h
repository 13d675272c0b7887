#pragma once

#include <tiny_gltf.h>

#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "doppel/io/figure_export/glb_compression.h"

namespace doppel {

/// Appends arrays to the binary part of a glTF model. Each function returns the index of the new accessor.
class GlbBuffer {
 public:
  explicit GlbBuffer(tinygltf::Model& model) : model_(model) { model.buffers.emplace_back(); }

  /// @param width values per element: 1, 2, 3, 4 or 16
  int floats(std::span<const float> values, int width, bool bounds, int target = 0);
  int indices(std::span<const std::uint32_t> values);
  /// Four node numbers per vertex.
  int joints(std::span<const std::uint16_t> values);
  /// The bytes of an image; returns the index of the buffer view.
  int image(std::span<const unsigned char> bytes);

 private:
  int view(const void* data, std::size_t bytes, int target);
  int accessor(int view, int component, int type, std::size_t count);

  tinygltf::Model& model_;
};

/// A glTF 2.0 model with nothing in it.
tinygltf::Model empty_glb_model();

/// Writes a model as a binary glTF file, atomically. @param compression as for compressed_glb; nothing: none
/// @throws Error naming the file when it cannot be written, or would be larger than 4 GB
void write_glb_model(const std::filesystem::path& path, const tinygltf::Model& model,
                     const std::optional<GlbSteps>& compression = std::nullopt);

}  // namespace doppel
