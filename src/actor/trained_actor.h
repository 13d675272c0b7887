#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/actor/run_subject.h"
#include "doppel/character/character.h"
#include "doppel/data/dataset.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/delta_net.h"
#include "doppel/nets/egnet.h"
#include "doppel/nets/field_view.h"
#include "doppel/nets/hybrid.h"
#include "doppel/nets/lighting.h"
#include "doppel/nets/plain_field.h"
#include "doppel/nets/tex_net.h"
#include "doppel/render/render_mesh.h"
#include "doppel/render/texture_space.h"

namespace doppel {

/// An actor loaded from a run, with all networks trained so far: pose -> EGNet -> DeltaNet -> TexNet, and the hybrid
/// (chapter 6). Weights and statistics are those for evaluation: from the newest checkpoint, the running mean of the
/// weights if the run kept one, and recalibrated batch norm. Networks are in evaluation mode and need no gradient.
struct TrainedActor {
  RunSubject subject;
  Character character;
  double frames_per_second = 25.0;              ///< of the capture
  std::vector<std::string> trained_on_cameras;  ///< of EGNet; empty: all
  std::map<std::string, std::int64_t> steps;    ///< of each loaded stage

  CharacterSurface surface{nullptr};
  EgNet egnet{nullptr};
  Lighting lighting{nullptr};  ///< null if it was not trained; likewise the next four
  DeltaNet deltanet{nullptr};
  TexNet texnet{nullptr};
  Hybrid hybrid{nullptr};
  PlainField nerf{nullptr};  ///< trained on the frame below only
  std::optional<SampleId> nerf_frame;
  std::shared_ptr<RenderMesh> mesh;
  std::shared_ptr<TextureSpace> texture_space;  ///< of TexNet's size; only with TexNet
  std::shared_ptr<FieldViewer> field_viewer;    ///< only with the hybrid; likewise the next two
  FieldImageOptions field_image;
  int field_stencil = 9;
  torch::Tensor static_texture;  ///< [1,Th,Tw,3] RGB 0..1; undefined if there is none

  /// @param run output of `doppel train`: one stage (egnet) or a chain of stages
  /// @param capture a prepared capture to use instead of the one the run was trained on
  /// @param before load only the stages that are trained before this one
  /// @throws Error when the folder is not a run, EGNet has no checkpoint, or the character is not the one it was
  /// trained for
  static TrainedActor load(const std::filesystem::path& run,
                           const std::optional<std::filesystem::path>& capture = std::nullopt,
                           const std::optional<std::string>& before = std::nullopt);

  /// F: the past frames of the networks' longest motion window.
  int past_frames() const;
  /// The name of the last geometry stage: egnet or deltanet.
  std::string geometry_name() const { return deltanet ? "deltanet" : "egnet"; }

  /// EGNet's deformation. @param dof_window [B,F+1,D], oldest first, at least as long as EGNet's motion window
  /// @return A, T [B,K,3]
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& dof_window) {
    return deformation(dof_window, dof_window);
  }
  /// The same with other poses as input of EGNet's network, as in training (EgNet::forward).
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& seen_window,
                                                      const torch::Tensor& dof_window);
  /// V_co, the posed and coarsely deformed surface (6.4). @return [B,N,3] world metres
  torch::Tensor coarse(const torch::Tensor& dof_window);
  /// V_fi with DeltaNet's displacements (6.14), or V_co if there is no DeltaNet. @return [B,N,3] world metres
  torch::Tensor fine(const torch::Tensor& dof_window);
  /// V_fi with the displacements of a given DeltaNet of this actor, with gradients to its weights if they are on.
  /// @return [B,N,3]
  torch::Tensor displaced(DeltaNet& deltanet, const torch::Tensor& dof_window);
  /// The mesh that was refined together with the radiance field, or `fine` if there is none. @return [B,N,3] world
  /// metres
  torch::Tensor refined(const torch::Tensor& dof_window);
  /// The image of the radiance field in a camera. @param dof_window [1,F+1,D] @param projection [3,4] of the camera
  /// @throws Error when the camera is inside the mesh
  FieldImage radiance(const torch::Tensor& dof_window, const torch::Tensor& projection, int64_t height, int64_t width);
  /// The dynamic texture for a motion window and a camera. @return [B,T,T,3] RGB 0..1
  torch::Tensor texture(const torch::Tensor& dof_window, const torch::Tensor& projection);

  /// A digest of the weights of all loaded stages. It identifies what later stages were trained on.
  std::string digest() const;
  /// @throws UsageError naming `what` when the template has no texture or no UVs
  void require_texture(const std::string& what) const;
};

/// The input of TexNet (6.8): the normal maps of the window's poses, and the camera. The normals are those of the
/// skinned surface. With config.surface_normals, those of the last frame are taken from the finished surface instead.
/// @param dof_window [B,F+1,D] or longer @param projection [B,3,4] of one camera per item
/// @param surface [B,N,3] the finished surface of the last frame; used only with config.surface_normals
/// @return [B,3(F+1)+6,T,T]
torch::Tensor texture_input(TrainedActor& actor, const TextureSpace& space, const TexNetConfig& config,
                            const torch::Tensor& dof_window, const torch::Tensor& projection,
                            const torch::Tensor& surface);

/// The one frame that a radiance field without a mesh is trained on, from the frames of a split or from `frames`.
/// @throws UsageError unless there is exactly one
SampleId nerf_frame(const Dataset& dataset, Split split, const std::vector<long>& frames);

/// Makes a TexNet for an actor. With `residual`, TexNet adds to the actor's static texture; with `lit`, to this texture
/// under the mean of the learnt lighting.
/// @throws UsageError when the template has no UVs, or lacks the texture or the light that are needed
TexNet make_tex_net(const TrainedActor& actor, const TexNetConfig& config, at::Generator generator);

}  // namespace doppel
