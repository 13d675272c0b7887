#pragma once

#include <array>
#include <map>

#include "doppel/actor/trained_actor.h"
#include "doppel/losses/chamfer.h"
#include "doppel/losses/isometry.h"
#include "doppel/losses/laplacian.h"
#include "doppel/losses/radiance.h"
#include "doppel/nets/field_view.h"
#include "doppel/nets/hybrid.h"
#include "doppel/render/rays/guided_sampling.h"
#include "doppel/train/capture_stage.h"
#include "doppel/train/hybrid_plan.h"
#include "doppel/train/run_config.h"
#include "doppel/train/trainer.h"

namespace doppel {

/// The configuration of the stage `radiance`; `docs/training.md` lists the keys.
struct HybridRunConfig {
  RunSubject subject;
  LoaderOptions loader = image_loader(1, 1);

  HybridConfig model;
  bool standardise = true;  ///< scale the inputs of the motion network, when there are several frames

  // Rays.
  int rays = 1000;       ///< rays of a step, shared among its cameras (A.3)
  double in_mask = 0.5;  ///< share of these rays drawn inside the mask; thesis: 0 (A.3)
  FieldRays field_rays;
  int cloud_rays = 50000;  ///< largest number of rays for the point cloud of one view

  // Weights of the refinement (A.3).
  double chamfer_weight = 5000.0;    ///< per squared metre
  double silhouette_weight = 50.0;   ///< of the sums of squared residuals (silhouette.h)
  double laplacian_weight = 4000.0;  ///< per squared metre
  LaplacianOptions laplacian;
  double isometry_weight = 7.5e4;  ///< per squared metre; 0.075 per squared millimetre
  /// Weight of the mean squared distance from the mesh at the start of the round, per square metre. Without it, parts
  /// that no camera sees (the underside of a skirt, for example) drift, because no other loss holds them.
  double anchor_weight = 0.0;
  double min_opacity = 0.98;  ///< T: smallest opacity of a ray that gives a point
  double min_facing = 0.2;    ///< smallest cosine between ray and normal; depth is uncertain at grazing angles
  ChamferOptions chamfer;
  SilhouetteOptions silhouette;

  HybridPlan plan;
  TrainerOptions trainer;

  static HybridRunConfig read(const ConfigDocument& document);
};
void describe_keys(const Keys& keys, HybridRunConfig& config);

/// Trains the hybrid (6.12), alternating between the radiance field around the mesh (6.28) and DeltaNet, which is
/// fitted to point clouds from the radiance field (6.27). The clouds are computed around the mesh at the start of the
/// phase, so they stay fixed while the mesh moves.
class HybridStage : public CaptureStage {
 public:
  /// @param dataset, actor must outlive the stage
  /// @throws UsageError when DeltaNet was not trained; Error when the template is not closed
  HybridStage(const Dataset& dataset, TrainedActor& actor, const HybridRunConfig& config);

  std::string name() const override { return "radiance"; }
  /// Shares the rays of a step. The losses of the mesh are about one frame; every rank computes them alike.
  void share_batches(Ranks&) override {}
  torch::nn::Module& model() override { return *model_; }
  using CaptureStage::loss;
  LossTerms loss(const Batch& batch, StepContext& context) override;
  std::string identity() const override { return CaptureStage::identity() + ", on " + actor_.digest(); }
  bool is_trained_from(std::int64_t step, const std::string& parameter) const override {
    return parameter.rfind("refined.", 0) == 0 ? config_.plan.trains_mesh_from(step)
                                               : config_.plan.trains_field_from(step);
  }
  std::vector<ReportImage> images() override;

  Hybrid& hybrid() { return model_; }

 protected:
  /// The colours of the radiance field alone, because the phases train different terms.
  LossTerms validation_terms(const Batch& batch, StepContext& context) override;

 private:
  /// All terms of a step; those of other phases stay 0.
  struct Terms {
    RadianceLoss field;
    SilhouetteLoss silhouette;
    torch::Tensor chamfer, laplacian, isometry, anchor;
  };

  /// Rays of several views with the colours and masks of their pixels; undefined when no view sees the mesh.
  struct ImageRays {
    torch::Tensor origin, direction, near, far;  ///< [R,3], [R,3], [R], [R]
    torch::Tensor colour, mask;                  ///< [R,3], [R]
    BatchShare share;                            ///< of all R rays
  };
  /// The mesh of a frame that the field surrounds, and its views by camera. Both are kept while the mesh is fixed.
  struct FixedMesh {
    torch::Tensor vertices;                     ///< [N,3], no gradient
    std::map<std::int64_t, GuideImages> views;  ///< by index into Dataset::cameras(), one view each
  };
  /// The mesh of the batch's frame, computed on first use. The reference is valid until the next call.
  FixedMesh& fixed_mesh(const Batch& batch);
  void forget_meshes();

  /// One view of a mesh. @param view into the batch's cameras @param vertices [N,3] @param mesh keeps the view; null:
  /// the view is not kept
  GuideImages guide(const Batch& batch, std::int64_t view, const torch::Tensor& vertices, FixedMesh* mesh);
  /// @param views int64 [V] into the batch's cameras @param vertices [N,3] @param mesh as `guide`
  ImageRays draw_rays(const Batch& batch, const torch::Tensor& views, const torch::Tensor& vertices, FixedMesh* mesh,
                      StepContext& context);
  RadianceLoss field_loss(const Batch& batch, const torch::Tensor& views, const torch::Tensor& vertices,
                          FixedMesh* mesh, StepContext& context);
  /// The point cloud of the batch's frame in one view, kept until the radiance field is trained again.
  const PointCloud& cloud(const Batch& batch, std::int64_t view);
  /// Points with the normals of the nearest surface, without points that `eye` [3] sees at a grazing angle.
  PointCloud oriented(const torch::Tensor& points, const torch::Tensor& vertices, const torch::Tensor& eye);
  torch::Tensor cloud_loss(const Batch& batch, const torch::Tensor& views, const torch::Tensor& vertices,
                           StepContext& context);
  void compare_surface(const Batch& batch, const torch::Tensor& vertices, StepContext& context, Terms& terms);

  TrainedActor& actor_;
  HybridRunConfig config_;
  Hybrid model_{nullptr};
  FieldViewer viewer_;
  GuideOptions guide_;
  LaplacianGraph laplacian_graph_;
  EdgeLengths edges_;
  std::map<std::array<std::int64_t, 3>, PointCloud> clouds_;  ///< by sequence, frame and camera
  std::map<std::array<std::int64_t, 2>, FixedMesh> meshes_;   ///< by sequence and frame
  std::int64_t kept_pixels_ = 0;                              ///< of all views in `meshes_`
};

}  // namespace doppel
