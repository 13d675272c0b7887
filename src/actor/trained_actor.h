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
#include "doppel/data/dataset/dataset.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/delta_net.h"
#include "doppel/nets/egnet.h"
#include "doppel/nets/field_view.h"
#include "doppel/nets/gaussians.h"
#include "doppel/nets/hybrid.h"
#include "doppel/nets/lighting.h"
#include "doppel/nets/plain_field.h"
#include "doppel/nets/tex_net.h"
#include "doppel/render/lighting/occlusion.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/texture/texture_space.h"

namespace doppel {

/// An actor loaded from a run, with all networks trained so far (chapter 6): EGNet, lighting, DeltaNet, TexNet, the
/// Gaussians, the hybrid and the radiance field without a mesh. A network is null if it was not trained, or if `load`
/// left it out. All values come from the checkpoint to use of each stage (`find_stage`). The weights are the running
/// mean of the weights if the run kept one, otherwise the weights of the last step. With EGNet's `recalibrate_norm`,
/// the statistics of its batch normalisation were recomputed for these weights. Networks are in evaluation mode, and
/// their weights do not require gradients and must not change: for one frame, EGNet and DeltaNet run a copy of them
/// (SagcnImpl::freeze), in the format that `inference_weights()` names.
///
/// Letters: B batch, F past frames, D DoFs, K graph nodes, N vertices, T texels along a side of the dynamic texture. A
/// `dof_window` is a motion window [B,F+1,D]: float32 DoFs as in a motion file, oldest first; the last row is the pose
/// of the result. It may be longer than needed. `past_frames() + 1` rows suffice for every function.
struct TrainedActor {
  RunSubject subject;  ///< `subject.capture` is the prepared capture in use
  Character character;
  double frames_per_second = 25.0;              ///< of the training: the time between the rows of motion windows
  std::vector<std::string> trained_on_cameras;  ///< names of the cameras that EGNet was trained on; empty: all
  std::map<std::string, std::int64_t> steps;    ///< stage name -> training steps of its checkpoint; loaded stages only

  CharacterSurface surface{nullptr};            ///< never null after `load`
  EgNet egnet{nullptr};                         ///< never null after `load`
  Lighting lighting{nullptr};                   ///< null: not loaded
  DeltaNet deltanet{nullptr};                   ///< null: not loaded
  TexNet texnet{nullptr};                       ///< null: not loaded
  Gaussians gaussians{nullptr};                 ///< null: not loaded
  Hybrid hybrid{nullptr};                       ///< null: not loaded
  PlainField nerf{nullptr};                     ///< null: not loaded. It represents the frame `nerf_frame` only.
  std::optional<SampleId> nerf_frame;           ///< nothing without `nerf`
  std::shared_ptr<RenderMesh> mesh;             ///< the template's faces and UVs; never null after `load`
  std::shared_ptr<TextureSpace> texture_space;  ///< of TexNet's size; null without TexNet
  std::shared_ptr<TextureSpace> splat_space;    ///< of the Gaussians' size; null without them
  std::shared_ptr<BodySpheres> body_spheres;    ///< in the limbs of the template; null without Gaussians with shadows
  std::shared_ptr<FieldViewer> field_viewer;    ///< null without the hybrid
  FieldImageOptions field_image;                ///< samples per ray as in the hybrid's training
  int field_stencil = 9;                        ///< pixels, as in the hybrid's training (FieldRays)
  torch::Tensor static_texture;  ///< float32 [1,Th,Tw,3] RGB 0..1; undefined when the template has no texture or no UVs

  /// @param run output of `doppel train`: one stage (egnet) or a chain of stages
  /// @param capture a prepared capture to use instead of that of the run; nothing: that of the run
  /// @param before name of a stage: only the stages that are trained before it are loaded; nothing: all
  /// @throws Error when the folder is not a run, when EGNet has no checkpoint, or when EGNet was trained for another
  /// character than that of the capture
  static TrainedActor load(const std::filesystem::path& run,
                           const std::optional<std::filesystem::path>& capture = std::nullopt,
                           const std::optional<std::string>& before = std::nullopt);

  /// The past frames F in the longest motion window of the loaded networks.
  int past_frames() const;
  /// The name of the last geometry stage: egnet or deltanet.
  std::string geometry_name() const { return deltanet ? "deltanet" : "egnet"; }

  /// EGNet's embedded deformation of the last frame. @param dof_window at least as long as EGNet's motion window
  /// @return A [B,K,3] radians and T [B,K,3] metres, in canonical pose (embedded_deformation.h)
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& dof_window) {
    return deformation(dof_window, dof_window);
  }
  /// The same with other poses as input of EGNet's network, for example poses with noise as in training. Inertia is
  /// computed from `dof_window` (EgNet::forward). @param seen_window those poses, as `dof_window`
  std::pair<torch::Tensor, torch::Tensor> deformation(const torch::Tensor& seen_window,
                                                      const torch::Tensor& dof_window);
  /// V_co: the template with EGNet's deformation, in the pose of the last frame (6.4). @return [B,N,3] world metres
  torch::Tensor coarse(const torch::Tensor& dof_window);
  /// V_fi: V_co with DeltaNet's displacements (6.14). Without DeltaNet, V_co. @return [B,N,3] world metres
  torch::Tensor fine(const torch::Tensor& dof_window);
  /// V_fi with the displacements of the given DeltaNet of this actor, for example `hybrid->refined`. Gradients go to
  /// the weights of this DeltaNet if they require gradients. EGNet passes no gradients. @return [B,N,3] world metres
  torch::Tensor displaced(DeltaNet& deltanet, const torch::Tensor& dof_window);
  /// The mesh that the hybrid refined together with its radiance field. Without the hybrid, the result of `fine`.
  /// @return [B,N,3] world metres
  torch::Tensor refined(const torch::Tensor& dof_window);
  /// The image of the hybrid's radiance field in a camera. @pre `hybrid` is not null
  /// @param dof_window [1,F+1,D] @param projection float32 [3,4] pixels from world metres
  /// @param height, width of the image, pixels
  /// @throws Error when the camera is inside the mesh
  FieldImage radiance(const torch::Tensor& dof_window, const torch::Tensor& projection, int64_t height, int64_t width);
  /// The dynamic texture for a motion window and a camera. @pre `texnet` is not null
  /// @param projection [B,3,4] pixels from world metres @return [B,T,T,3] RGB 0..1, row 0 at v = 1
  torch::Tensor texture(const torch::Tensor& dof_window, const torch::Tensor& projection);
  /// The same where the result of `fine` is at hand. @param vertices [B,N,3] `fine(dof_window)`
  torch::Tensor texture(const torch::Tensor& dof_window, const torch::Tensor& projection,
                        const torch::Tensor& vertices);

  /// The Gaussians at the end of a motion window, as a camera sees them. @pre `gaussians` is not null
  /// @param dof_window [B,F+1,D] @param projection [B,3,4] pixels from world metres @param vertices [B,N,3]
  /// `fine(dof_window)`
  Splats splats(const torch::Tensor& dof_window, const torch::Tensor& projection, const torch::Tensor& vertices);

  /// The same as rows of numbers, see splat_rows.h. @return [B,P,14]
  torch::Tensor gaussian_rows(const torch::Tensor& dof_window, const torch::Tensor& projection,
                              const torch::Tensor& vertices);

  /// A digest of the weights of EGNet, lighting and DeltaNet, as far as they are loaded. Stages that use these networks
  /// store it as part of their identity.
  std::string digest() const;
  /// Checks that the template has UVs and a texture. @param what needs them; the message begins with this text
  /// @throws UsageError when the template lacks one of them
  void require_texture(const std::string& what) const;
};

/// The input of TexNet (6.8): a map of world normals for each pose of the window, then the centre and the viewing
/// direction of the camera (texnet_input). The normals are those of the skinned surface. With config.surface_normals,
/// the last map holds the normals of `surface` instead. F is config.past_frames and T the size of `space`.
/// @param dof_window [B,F+1,D] or longer
/// @param projection [B,3,4] pixels from world metres: one camera for each item of the batch
/// @param surface [B,N,3] result of `fine` for the last frame, world metres; may be undefined without
/// config.surface_normals
/// @throws UsageError when dof_window has fewer than F+1 rows
TexNetInput texture_input(TrainedActor& actor, const TextureSpace& space, const TexNetConfig& config,
                          const torch::Tensor& dof_window, const torch::Tensor& projection,
                          const torch::Tensor& surface);

/// The Gaussians at the end of a motion window on the finished surface. Gradients go to `gaussians`, none to the
/// surface.
/// @param gaussians of this actor @param space of their size @param dof_window [B,F+1,D]
/// @param projection [B,3,4] pixels from world metres, the camera that the network sees
/// @param vertices [B,N,3] result of `fine` @param generator, share as in GaussiansImpl::forward
Splats posed_splats(TrainedActor& actor, Gaussians& gaussians, const TextureSpace& space,
                    const torch::Tensor& dof_window, const torch::Tensor& projection, const torch::Tensor& vertices,
                    const std::optional<at::Generator>& generator = std::nullopt, const BatchShare& share = {});

/// Finds the one frame that a radiance field without a mesh is trained on.
/// @param frames of the split; empty: all frames of the split
/// @throws UsageError unless this is exactly one frame of one sequence; also the errors of `chosen_samples`
SampleId nerf_frame(const Dataset& dataset, Split split, const std::vector<long>& frames);

/// Makes an untrained TexNet for an actor. With config.residual, TexNet's output is added to the actor's static
/// texture. With config.lit, it is added to this texture under the actor's lighting, averaged over the trained cameras.
/// @param generator draws the initial weights
/// @throws UsageError when the template has no UVs, when config.residual is set and the template has no texture, or
/// when config.lit is set and the lighting was not trained
TexNet make_tex_net(const TrainedActor& actor, const TexNetConfig& config, at::Generator generator);

/// Makes untrained Gaussians for an actor, and the spheres of their shadows (actor.body_spheres), with the colours of
/// its static texture. With config.lit, these are under the actor's lighting, averaged over the trained cameras.
/// @param space of the size config.size @param generator draws the initial weights
/// @throws UsageError when the template has no UVs or no texture, or when config.lit is set and the lighting was not
/// trained
Gaussians make_gaussians(TrainedActor& actor, const TextureSpace& space, const GaussiansConfig& config,
                         at::Generator generator);

}  // namespace doppel
