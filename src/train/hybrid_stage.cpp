#include "doppel/train/hybrid_stage.h"

#include <torch/nn/functional/normalization.h>

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/losses/anchor.h"
#include "doppel/losses/images.h"
#include "doppel/render/outline/seen_vertices.h"
#include "doppel/render/projection.h"
#include "doppel/train/image_sheet.h"
#include "doppel/train/stage_table.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr std::size_t kHybridStatisticsFrames = 512;
constexpr int kImagesOfSplit = 3;
/// Each cloud has at most `cloud_rays` points of 24 bytes; with the default all clouds need less than 600 MB.
constexpr std::size_t kMaxClouds = 500;
/// A pixel of GuideImages takes 9 bytes, so all kept views need less than 600 MB. Further views are drawn in each step.
constexpr std::int64_t kMaxPixels = 64'000'000;
/// A vertex takes 12 bytes: 2,000 meshes of 5,500 vertices need 130 MB. All are dropped when one more is needed.
constexpr std::size_t kMaxMeshes = 2000;

DeltaNet& deltanet_of(TrainedActor& actor) {
  if (!actor.deltanet)
    fail<UsageError>(
        "radiance: the field lies around DeltaNet's mesh, and the stage `deltanet` has not been trained; train it "
        "first, or take another run's: --set deltanet.run=RUN");
  return actor.deltanet;
}

RadianceLoss no_radiance_loss() {
  const Tensor zero = torch::zeros({});
  return {zero, zero, zero, zero};
}

/// Lower bound of the standard deviation of an input, metres.
constexpr double kHybridFeatureFloor = 0.05;

void describe_refinement(const Keys& keys, HybridRunConfig& c) {
  keys("chamfer", c.chamfer_weight, at_least(0.0), "weight, A.3");
  keys("chamfer_threshold", c.chamfer.threshold, at_least(0.0),
       "metres beyond which a point and a vertex are not compared");
  keys("chamfer_agreement", c.chamfer.min_agreement, between(-1.0, 1.0),
       "smallest cosine between the normals of a point and its vertex");
  keys("min_facing", c.min_facing, between(0.0, 1.0),
       "smallest cosine between the direction of view and the normal of a point or vertex");
  keys("min_opacity", c.min_opacity, between(0.0, 1.0), "rays with a lower opacity give no point");
  keys("silhouette", c.silhouette_weight, at_least(0.0), "weight, A.3");
  describe_keys(keys, c.silhouette);
  keys("laplacian", c.laplacian_weight, at_least(0.0), "weight, A.3");
  describe_keys(keys, c.laplacian);
  keys("isometry", c.isometry_weight, at_least(0.0), "weight, A.3");
  keys("anchor", c.anchor_weight, at_least(0.0),
       "weight of the mean squared distance from the mesh at the start of the round: holds parts that no camera sees; "
       "no effect in `joint` steps");
}

}  // namespace

void describe_keys(const Keys& keys, HybridRunConfig& c) {
  describe_keys(keys.section("data"), c.loader);
  keys.require("data.batch_size", c.loader.batch_size == 1,
               fmt::format("found {}; a step takes the rays of one frame, so only 1 is allowed", c.loader.batch_size));
  describe_keys(keys.section("model"), c.model);
  keys("model.standardise", c.standardise, "scale the inputs of the motion network, when there are several frames");
  keys("rays.count", c.rays, between(1, 1 << 20), "of a step");
  keys("rays.in_mask", c.in_mask, between(0.0, 1.0),
       "share of them drawn inside the mask; the others from all pixels near the mesh; 0: as in A.3");
  describe_keys(keys.section("rays"), c.field_rays);
  keys("rays.cloud", c.cloud_rays, between(1, 1 << 24), "most points of a point cloud");
  describe_refinement(keys.section("loss"), c);
  describe_keys(keys, c.plan);
  describe_phased(keys.section("train"), c.trainer, c.plan.schedule(),
                  "the stage radiance takes this from its `rounds` and `rates`");
  keys.require(
      "train.keep", !c.trainer.keep_best,
      "found best; the phases of the hybrid train different terms, so no loss compares their checkpoints; only "
      "last is allowed");
}

HybridRunConfig HybridRunConfig::read(const ConfigDocument& document) {
  return read_run<HybridRunConfig>(document, "radiance");
}

HybridStage::HybridStage(const Dataset& dataset, TrainedActor& actor, const HybridRunConfig& config)
    : CaptureStage(dataset, actor.character,
                   with_past_frames(config.loader, std::max(actor.past_frames(), config.model.motion.past_frames))),
      actor_(actor),
      config_(config),
      model_(actor.character, deltanet_of(actor), config.model,
             at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      viewer_(actor.character),
      guide_(guide_of(config.model.field, config.field_rays.stencil)),
      laplacian_graph_(actor.character, config.laplacian),
      edges_(MeshTopology(actor.character.mesh), rest_vertices(actor.character)) {
  const Tensor windows = training_windows(kHybridStatisticsFrames, config.model.motion.past_frames);
  // One frame has no standard deviation: every input would be 0.
  if (!config.standardise || windows.size(0) < 2) return;
  const auto [mean, std] =
      input_statistics(windows, [this](const Tensor& part) { return model_->motion->network_input(part); });
  model_->motion->set_input_statistics(mean, std, kHybridFeatureFloor);
}

LossTerms HybridStage::loss(const Batch& batch, StepContext& context) {
  const HybridPlan::Position position = config_.plan.at(context.step);
  if (position.phase == HybridPhase::joint || (position.phase == HybridPhase::field && position.first)) {
    model_->follow();
    forget_meshes();
  }
  if (position.first) clouds_.clear();
  const Tensor zero = torch::zeros({});
  Terms terms{no_radiance_loss(), {zero, zero}, zero, zero, zero, zero};
  const Tensor views = batch.valid[0].nonzero().squeeze(1);
  if (views.size(0) > 0 && position.phase == HybridPhase::field) {
    FixedMesh& mesh = fixed_mesh(batch);
    terms.field = field_loss(batch, views, mesh.vertices, &mesh, context);
  }
  if (views.size(0) > 0 && position.phase != HybridPhase::field) {
    const Tensor vertices = actor_.displaced(model_->refined, batch.dofs);
    if (position.phase == HybridPhase::joint) terms.field = field_loss(batch, views, vertices[0], nullptr, context);
    if (position.phase == HybridPhase::refine && config_.chamfer_weight > 0.0)
      terms.chamfer = cloud_loss(batch, views, vertices, context);
    compare_surface(batch, vertices, context, terms);
  }
  const auto rays = [count = static_cast<double>(terms.field.rays)] { return count; };
  return {{"colour", terms.field.colour, 1.0, rays},
          {"mask", terms.field.mask, 1.0, rays},
          {"variance", terms.field.variance, position.variance, rays},
          {"chamfer", terms.chamfer, config_.chamfer_weight, same_on_all_ranks},
          {"model_to_data", terms.silhouette.model_to_data, config_.silhouette_weight, same_on_all_ranks},
          {"data_to_model", terms.silhouette.data_to_model, config_.silhouette_weight, same_on_all_ranks},
          {"laplacian", terms.laplacian, config_.laplacian_weight, same_on_all_ranks},
          {"isometry", terms.isometry, config_.isometry_weight, same_on_all_ranks},
          {"anchor", terms.anchor, config_.anchor_weight, same_on_all_ranks}};
}

LossTerms HybridStage::validation_terms(const Batch& batch, StepContext& context) {
  const Tensor views = batch.valid[0].nonzero().squeeze(1);
  if (views.size(0) == 0) return {};
  return {
      {"colour", field_loss(batch, views, actor_.displaced(model_->around, batch.dofs)[0], nullptr, context).colour}};
}

HybridStage::FixedMesh& HybridStage::fixed_mesh(const Batch& batch) {
  const std::array<std::int64_t, 2> key{batch.sequence[0].item<std::int64_t>(), batch.frames[0].item<std::int64_t>()};
  if (meshes_.size() >= kMaxMeshes && meshes_.count(key) == 0) forget_meshes();
  FixedMesh& mesh = meshes_[key];
  if (!mesh.vertices.defined()) {
    const torch::NoGradGuard no_grad;
    mesh.vertices = actor_.displaced(model_->around, batch.dofs)[0];
  }
  return mesh;
}

void HybridStage::forget_meshes() {
  meshes_.clear();
  kept_pixels_ = 0;
}

GuideImages HybridStage::guide(const Batch& batch, std::int64_t view, const Tensor& vertices, FixedMesh* mesh) {
  const std::int64_t camera = batch.cameras[0][view].item<std::int64_t>();
  if (mesh)
    if (const auto kept = mesh->views.find(camera); kept != mesh->views.end()) return kept->second;
  const std::int64_t height = batch.image.size(2), width = batch.image.size(3);
  GuideImages drawn;
  try {
    drawn = viewer_.guide(vertices, batch.image_projection[0][view].unsqueeze(0), height, width, guide_);
  } catch (const Error& error) {
    fail("radiance: frame {}, camera {}: {}", batch.frames[0].item<std::int64_t>(),
         dataset().camera(static_cast<int>(camera)).name, error.what());
  }
  if (mesh && kept_pixels_ + height * width <= kMaxPixels) {
    mesh->views[camera] = drawn;
    kept_pixels_ += height * width;
  }
  return drawn;
}

HybridStage::ImageRays HybridStage::draw_rays(const Batch& batch, const Tensor& views, const Tensor& vertices,
                                              FixedMesh* mesh, StepContext& context) {
  const std::int64_t V = views.size(0), share = std::max<std::int64_t>(1, config_.rays / V);
  std::vector<Tensor> origin, direction, near, far, colour, mask;
  for (std::int64_t v = 0; v < V; ++v) {
    const std::int64_t view = views[v].item<std::int64_t>();
    const GuideImages seen = guide(batch, view, vertices, mesh);
    if (!seen.reached.any().item<bool>()) continue;
    const Tensor image = batch.image[0][view], projection = batch.image_projection[0][view];
    const Tensor foreground = batch.image_mask[0][view].to(torch::kFloat32);
    const Tensor pixels = draw_pixels(seen, 0, foreground, share, config_.in_mask, context.generator);
    const PixelRays rays = pixel_rays(projection, pixels);
    const RayInterval interval = guided_interval(seen, 0, pixels, viewer_.faces(), vertices, projection, guide_);
    origin.push_back(rays.origin.expand({pixels.size(0), 3}));
    direction.push_back(rays.direction);
    near.push_back(interval.near);
    far.push_back(interval.far);
    colour.push_back(image_float(at_pixels(image, pixels)));
    mask.push_back(at_pixels(foreground, pixels));
  }
  if (origin.empty()) return {};
  // Every rank draws all rays, and keeps its share of them.
  const Tensor all = torch::cat(direction);
  const BatchShare part = share_of_rays(context.ranks, all.size(0));
  const auto rows = [&](const std::vector<Tensor>& parts) { return part.rows(torch::cat(parts)); };
  return {rows(origin), part.rows(all), rows(near), rows(far), rows(colour), rows(mask), part};
}

RadianceLoss HybridStage::field_loss(const Batch& batch, const Tensor& views, const Tensor& vertices, FixedMesh* mesh,
                                     StepContext& context) {
  ImageRays rays;
  {
    ProfileScope scope(*context.profile, "rays");
    rays = draw_rays(batch, views, vertices, mesh, context);
  }
  if (!rays.origin.defined()) return no_radiance_loss();
  Tensor carried;
  {
    ProfileScope scope(*context.profile, "features");
    carried = model_->vertex_values(batch.dofs);
  }
  ProfileScope scope(*context.profile, "field");
  const RaySamples samples =
      sample_cells(rays.near, rays.far, config_.field_rays.samples, context.generator, rays.share);
  const RenderedRays seen =
      render_field(model_->field, viewer_.closest(), {vertices, carried}, rays.origin, rays.direction, samples);
  RadianceLossOptions options;
  return radiance_loss(seen, samples, rays.colour, rays.mask, options);
}

const PointCloud& HybridStage::cloud(const Batch& batch, std::int64_t view) {
  const std::array<std::int64_t, 3> key{batch.sequence[0].item<std::int64_t>(), batch.frames[0].item<std::int64_t>(),
                                        batch.cameras[0][view].item<std::int64_t>()};
  const auto found = clouds_.find(key);
  if (found != clouds_.end()) return found->second;
  if (clouds_.size() >= kMaxClouds) clouds_.clear();
  const torch::NoGradGuard no_grad;
  const Tensor projection = batch.image_projection[0][view];
  FixedMesh& mesh = fixed_mesh(batch);
  const FieldSurface around{mesh.vertices, model_->vertex_values(batch.dofs)};
  const GuideImages drawn = guide(batch, view, mesh.vertices, &mesh);
  Tensor pixels = drawn.pixels(0);
  if (pixels.size(0) > config_.cloud_rays) {
    // The same each time the cloud is computed.
    at::Generator generator = at::detail::createCPUGenerator(static_cast<std::uint64_t>(config_.subject.seed));
    const Tensor order = torch::randperm(pixels.size(0), generator, torch::kInt64);
    pixels = pixels.index_select(0, order.narrow(0, 0, config_.cloud_rays));
  }
  const PixelRays rays = pixel_rays(projection, pixels);
  const RayInterval interval = guided_interval(drawn, 0, pixels, viewer_.faces(), around.vertices, projection, guide_);
  FieldImageOptions options;
  options.samples = config_.field_rays.samples;
  const FieldPixels seen = draw_field(model_->field, viewer_.closest(), around, rays.origin, rays.direction,
                                      interval.near, interval.far, options);
  RenderedRays points;
  points.opacity = seen.opacity;
  points.depth = seen.depth;
  return clouds_[key] = oriented(point_cloud(points, rays.origin, rays.direction, config_.min_opacity), around.vertices,
                                 rays.origin);
}

PointCloud HybridStage::oriented(const Tensor& points, const Tensor& vertices, const Tensor& eye) {
  const Tensor surface = vertices.unsqueeze(0);
  const ClosestPoints at = viewer_.closest()->forward(surface, points.unsqueeze(0));
  Tensor normals = viewer_.closest()->interpolate(at, silhouette_normals(surface, viewer_.faces())).squeeze(0);
  normals = torch::nn::functional::normalize(normals);
  const Tensor look = torch::nn::functional::normalize(eye - points);
  const Tensor kept = ((normals * look).sum(1) > config_.min_facing).nonzero().squeeze(1);
  return {points.index_select(0, kept), normals.index_select(0, kept)};
}

Tensor HybridStage::cloud_loss(const Batch& batch, const Tensor& views, const Tensor& vertices, StepContext& context) {
  const std::int64_t turn =
      torch::randint(0, views.size(0), {1}, context.generator, torch::kInt64).item<std::int64_t>();
  const std::int64_t view = views[turn].item<std::int64_t>();
  const PointCloud* points = nullptr;
  Tensor normals, visible;
  {
    ProfileScope scope(*context.profile, "cloud");
    points = &cloud(batch, view);
    normals = silhouette_normals(vertices, viewer_.faces())[0];
    const GuideImages seen = viewer_.guide(vertices[0], batch.image_projection[0][view].unsqueeze(0),
                                           batch.image.size(2), batch.image.size(3), guide_);
    visible = seen_vertices(seen.face_id[0], viewer_.faces(), vertices[0],
                            camera_placement(batch.image_projection[0][view]).centre, config_.min_facing);
  }
  ProfileScope scope(*context.profile, "chamfer");
  return chamfer_loss(vertices[0], normals, *points, visible, config_.chamfer);
}

void HybridStage::compare_surface(const Batch& batch, const Tensor& vertices, StepContext& context, Terms& terms) {
  terms.silhouette = batch_silhouette_loss(vertices, actor_.mesh->faces, batch, config_.silhouette, *context.profile);
  ProfileScope scope(*context.profile, "smoothness");
  terms.laplacian = laplacian_loss(vertices, actor_.coarse(batch.dofs), laplacian_graph_);
  terms.isometry = isometry_loss(vertices, edges_);
  if (config_.anchor_weight > 0.0) terms.anchor = anchor_loss(vertices, fixed_mesh(batch).vertices.unsqueeze(0));
}

std::vector<ReportImage> HybridStage::images() {
  std::vector<ReportImage> images =
      outline_images(actor_.mesh->faces, "DeltaNet blue, refined red", [this](const SampleId& sample) {
        const Tensor window = dataset().dof_window(sample, loader_options().past_frames).unsqueeze(0);
        return std::make_pair(actor_.fine(window)[0], actor_.displaced(model_->refined, window)[0]);
      });
  FieldImageOptions options;
  options.samples = config_.field_rays.samples;
  for (const Split split : splits_to_show()) {
    ImageSheet sheet(dataset(), loader_options().image_size);
    for (const SampleId& sample : samples_to_show(split, kImagesOfSplit)) {
      const Batch batch = sheet.batch(sample, loader_options().past_frames);
      const FieldSurface around{actor_.displaced(model_->around, batch.dofs)[0], model_->vertex_values(batch.dofs)};
      const FieldImage seen = viewer_.draw(model_->field, around, batch.image_projection[0][0], batch.image.size(2),
                                           batch.image.size(3), config_.field_rays.stencil, options);
      ShadedImage drawing;
      drawing.colour = seen.colour.unsqueeze(0).unsqueeze(0);
      drawing.mask = (seen.opacity > 0).unsqueeze(0).unsqueeze(0);
      sheet.add(batch, {drawing});
    }
    if (sheet.empty()) continue;
    images.push_back({"radiance-" + to_string(split),
                      to_string(split) + " split: filmed image, radiance field and its error", sheet.image()});
  }
  return images;
}

namespace {

void evaluate_radiance(const ActorEvaluation& evaluation, nlohmann::ordered_json& rows) {
  rows["refined"] = evaluate_actor_surface(evaluation, "refined", &TrainedActor::refined);
  rows["radiance"] = evaluate_actor_drawing(evaluation, "radiance", Drawing::radiance);
  if (const auto cloud = evaluate_actor_cloud(evaluation); !cloud.is_null()) rows["cloud"] = cloud;
}

}  // namespace

StageEntry hybrid_entry() {
  return actor_stage_entry<HybridStage, HybridRunConfig>("radiance", {"hybrid"}, {"egnet", "deltanet"},
                                                         evaluate_radiance);
}

}  // namespace doppel
