#pragma once

#include <torch/script.h>
#include <torch/types.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "doppel/actor/export/actor_metadata.h"
#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/script_file.h"
#include "doppel/character/character.h"

namespace doppel {

/// Writes one TorchScript file that runs without Doppel: it contains plain aten operations, and parameters stay
/// parameters. `torch::jit::load` and Python's `torch.jit.load` can read the file.
///
/// Extra files in the archive: `metadata.json` (name, window, DoF and joint names, units, frame rate, fingerprint),
/// `faces.npy` [F,3] int32, and, where the template has them, `uvs.npy` [U,2] float32 and `face_uvs.npy` [F,3] int32.
///
/// The module's method `forward` is the geometry. With a texture, there are two more, `textured(window, projection) ->
/// (vertices, texture)` and `texture(window, projection, vertices) -> texture` for vertices at hand. With Gaussians,
/// there is `gaussians(window, projection, vertices) -> rows` (splat_rows.h).
///
/// @param modules the modules that the functions use; their parameters and buffers are saved in the file under their
/// names
/// @throws Error as traced_actor
void write_actor(const std::filesystem::path& path, const Character& character, const ActorDescription& description,
                 const ActorFunctions& functions, const ScriptModules& modules);

/// The template's faces and UVs.
struct ActorTopology {
  std::vector<std::int32_t> faces;     ///< [F,3]
  std::vector<float> uvs;              ///< [U,2]; empty: the template has no UVs
  std::vector<std::int32_t> face_uvs;  ///< [F,3]; empty without UVs
};

/// An actor file that was read.
class ActorFile {
 public:
  /// @throws FileError when the file is not an actor file; the message says what is missing
  static ActorFile load(const std::filesystem::path& path);

  const ActorDescription& description() const { return description_; }
  const ActorTopology& topology() const { return topology_; }
  /// [B,F+1,D] -> [B,N,3] @throws Error for another shape
  torch::Tensor forward(const torch::Tensor& window) const;
  /// Vertices [B,N,3] and dynamic texture [B,T,T,3] for one camera. @param projection [B,3,4]
  /// @throws Error for another shape, or when the file has no texture (description().texture_size)
  std::pair<torch::Tensor, torch::Tensor> textured(const torch::Tensor& window, const torch::Tensor& projection) const;
  /// The texture alone. @param vertices [B,N,3] result of `forward` for this window
  torch::Tensor texture(const torch::Tensor& window, const torch::Tensor& projection,
                        const torch::Tensor& vertices) const;
  /// The Gaussians as a camera sees them, for `splats_of_rows`. @param projection [B,3,4]
  /// @param vertices [B,N,3] result of `forward` for this window @return [B,P,14], see splat_rows.h
  /// @throws Error for another shape, or when the file has no Gaussians (description().num_gaussians)
  torch::Tensor gaussians(const torch::Tensor& window, const torch::Tensor& projection,
                          const torch::Tensor& vertices) const;

 private:
  void check_window(const torch::Tensor& window) const;
  void require_texture() const;
  /// @param action begins the messages: "texturing"
  void check_view(const char* action, const torch::Tensor& window, const torch::Tensor& projection) const;
  mutable ScriptFile file_;
  ActorDescription description_;
  ActorTopology topology_;
};

}  // namespace doppel
