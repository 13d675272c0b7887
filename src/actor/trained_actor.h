#pragma once

#include <torch/torch.h>

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
#include "doppel/nets/plain_field.h"
#include "doppel/nets/tex_net.h"
#include "doppel/render/render_mesh.h"
#include "doppel/render/texture_space.h"
#include "doppel/nets/lighting.h"

namespace doppel {

/// An actor as a run left it, as far as it has been trained: pose -> EGNet -> DeltaNet -> TexNet, and the hybrid
/// (chapter 6). Weights and statistics are those meant for use: the newest checkpoint, of it the running mean of the
/// weights where the run kept one, recalibrated batch norm. Networks are in evaluation mode and need no gradient.
struct TrainedActor {
  RunSubject subject;
  Character character;
  double frames_per_second = 25.0;              ///< of the capture
  std::vector<std::string> trained_on_cameras;  ///< of EGNet; empty: all
  std::map<std::string, std::int64_t> steps;    ///< of each stage that is there

  CharacterSurface surface{nullptr};
  EgNet egnet{nullptr};
  Lighting lighting{nullptr};  ///< null where it was not trained; so are the next four
  DeltaNet deltanet{nullptr};
  TexNet texnet{nullptr};
  Hybrid hybrid{nullptr};
  PlainField nerf{nullptr};  ///< of the frame below alone
  std::optional<SampleId> nerf_frame;
  std::shared_ptr<RenderMesh> mesh;
  std::shared_ptr<TextureSpace> texture_space;  ///< of TexNet's size, with TexNet only
  std::shared_ptr<FieldViewer> field_viewer;    ///< with the hybrid only, and so the next two
  FieldImageOptions field_image;
  int field_stencil = 9;
  torch::Tensor static_texture;  ///< [1,Th,Tw,3] RGB 0..1, undefined without one

  /// @param run what `doppel train` wrote: one stage (egnet) or a chain of stages
  /// @param capture a prepared folder to use instead of the one the run was trained on
  /// @param before load only the stages that are trained before this one
  /// @throws Error when the folder is not a run, EGNet has no checkpoint, or the character is not the one it was
  /// trained for
  static TrainedActor load(const std::filesystem::path& run,
                           const std::optional<std::filesystem::path>& capture = std::nullopt,
                           const std::optional<std::string>& before = std::nullopt);

  /// F: how many past frames the longest window of the networks takes.
  int past_frames() const;
  /// What the last stage of geometry is called: egnet or deltanet.
  std::string geometry_name() const { return deltanet ? "deltanet" : "egnet"; }

  /// EGNet's deformation. @param dof_window [B,F+1,D], oldest first, at least its window long
  /// @return A, T [B,K,3]
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& dof_window) {
    return deformation(dof_window, dof_window);
  }
  /// The same where EGNet's network sees other poses, as in training (EgNet::forward).
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& seen_window,
                                                      const torch::Tensor& dof_window);
  /// V_co, the posed and coarsely deformed surface (6.4). @return [B,N,3] world metres
  torch::Tensor coarse(const torch::Tensor& dof_window);
  /// V_fi with DeltaNet's displacements (6.14), or V_co where there is no DeltaNet. @return [B,N,3] world metres
  torch::Tensor fine(const torch::Tensor& dof_window);
  /// V_fi with the displacements of any DeltaNet of this actor, with gradients to it where they are on. @return [B,N,3]
  torch::Tensor displaced(DeltaNet& deltanet, const torch::Tensor& dof_window);
  /// The mesh that the radiance field refined, or `fine` where there is none. @return [B,N,3] world metres
  torch::Tensor refined(const torch::Tensor& dof_window);
  /// What a camera sees of the radiance field. @param dof_window [1,F+1,D] @param projection [3,4] of the camera
  /// @throws Error when the camera stands inside the mesh
  FieldImage radiance(const torch::Tensor& dof_window, const torch::Tensor& projection, int64_t height,
                        int64_t width);
  /// The dynamic texture for a pose and a view. @return [B,T,T,3] RGB 0..1
  torch::Tensor texture(const torch::Tensor& dof_window, const torch::Tensor& projection);

  /// A digest of the weights of the stages that are there: what later stages were trained on.
  std::string digest() const;
  /// @throws UsageError naming `what` when the template has no texture or no UVs
  void require_texture(const std::string& what) const;
};

/// What TexNet sees (6.8): the normal maps of the window's poses, skinned only but for config.surface_normals, and the
/// camera.
/// @param dof_window [B,F+1,D] or longer @param projection [B,3,4] of one camera per item
/// @param surface [B,N,3] the finished surface of the last frame, with config.surface_normals; else unused
/// @return [B,3(F+1)+6,T,T]
torch::Tensor texture_input(TrainedActor& actor, const TextureSpace& space, const TexNetConfig& config,
                            const torch::Tensor& dof_window, const torch::Tensor& projection,
                            const torch::Tensor& surface);

/// The one frame that a field without a mesh is trained on: the frames of a split, or those of them that are named.
/// @throws UsageError unless there is exactly one
SampleId nerf_frame(const Dataset& dataset, Split split, const std::vector<long>& frames);

/// TexNet for an actor; with `residual` on top of the actor's static texture, with `lit`
/// under the mean of the light that its cameras learnt.
/// @throws UsageError when the template has no UVs, or lacks the texture or the light that are needed
TexNet make_tex_net(const TrainedActor& actor, const TexNetConfig& config, at::Generator generator);

}  // namespace doppel
