#include "doppel/io/figure_export/glb_buffer.h"

#include <algorithm>
#include <sstream>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {

int GlbBuffer::view(const void* data, std::size_t bytes, int target) {
  std::vector<unsigned char>& buffer = model_.buffers[0].data;
  buffer.resize((buffer.size() + 3) / 4 * 4);  // accessors start at multiples of four bytes
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = buffer.size();
  view.byteLength = bytes;
  view.target = target;
  const auto* first = static_cast<const unsigned char*>(data);
  buffer.insert(buffer.end(), first, first + bytes);
  model_.bufferViews.push_back(view);
  return static_cast<int>(model_.bufferViews.size()) - 1;
}

int GlbBuffer::accessor(int view, int component, int type, std::size_t count) {
  tinygltf::Accessor accessor;
  accessor.bufferView = view;
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = count;
  model_.accessors.push_back(accessor);
  return static_cast<int>(model_.accessors.size()) - 1;
}

int GlbBuffer::floats(std::span<const float> values, int width, bool bounds, int target) {
  const int type = width == 1   ? TINYGLTF_TYPE_SCALAR
                   : width == 2 ? TINYGLTF_TYPE_VEC2
                   : width == 3 ? TINYGLTF_TYPE_VEC3
                   : width == 4 ? TINYGLTF_TYPE_VEC4
                                : TINYGLTF_TYPE_MAT4;
  const int made = accessor(view(values.data(), values.size_bytes(), target), TINYGLTF_COMPONENT_TYPE_FLOAT, type,
                            values.size() / as_size(width));
  if (!bounds || values.empty()) return made;
  tinygltf::Accessor& with_bounds = model_.accessors.back();
  with_bounds.minValues.assign(values.begin(), values.begin() + width);
  with_bounds.maxValues = with_bounds.minValues;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double &least = with_bounds.minValues[i % as_size(width)], &most = with_bounds.maxValues[i % as_size(width)];
    least = std::min(least, static_cast<double>(values[i]));
    most = std::max(most, static_cast<double>(values[i]));
  }
  return made;
}

int GlbBuffer::indices(std::span<const std::uint32_t> values) {
  return accessor(view(values.data(), values.size_bytes(), TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER),
                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR, values.size());
}

int GlbBuffer::joints(std::span<const std::uint16_t> values) {
  return accessor(view(values.data(), values.size_bytes(), TINYGLTF_TARGET_ARRAY_BUFFER),
                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, values.size() / 4);
}

int GlbBuffer::image(std::span<const unsigned char> bytes) { return view(bytes.data(), bytes.size(), 0); }

tinygltf::Model empty_glb_model() {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Doppel";
  return model;
}

void write_glb_model(const std::filesystem::path& path, const tinygltf::Model& model,
                     const std::optional<GlbSteps>& compression) {
  tinygltf::TinyGLTF writer;
  std::ostringstream stream;
  if (!writer.WriteGltfSceneToStream(&model, stream, /*prettyPrint=*/false, /*writeBinary=*/true))
    fail("writing {}: tinygltf refuses the model", path.string());
  std::string bytes = stream.str();
  if (bytes.size() > 0xFFFFFFFFULL)
    fail("writing {}: the model needs {:.1f} GB, and a .glb file holds 4 GB; export fewer frames", path.string(),
         static_cast<double>(bytes.size()) / 1e9);
  if (compression) bytes = compressed_glb(bytes, *compression);
  write_atomically(path, bytes);
}

}  // namespace doppel
