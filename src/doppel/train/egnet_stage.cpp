#include "doppel/train/egnet_stage.h"

#include <algorithm>
#include <cmath>

#include "doppel/render/boundary.h"
#include "doppel/train/overlay.h"

namespace doppel {

namespace {

/// Enough frames for statistics; more would only cost memory.
constexpr std::size_t kStatisticsFrames = 2048;
constexpr std::int64_t kStatisticsChunk = 64;

SilhouetteTarget silhouette_target(const Batch& batch) {
  return {batch.projection, batch.distance, batch.pixel_scale, batch.valid, batch.contour, batch.contour_offsets};
}

/// DoF units per radian: noise of one size in radians for joints whose weights differ.
torch::Tensor radians_to_dof(const Skeleton& skeleton) {
  torch::Tensor scale = torch::zeros({skeleton.num_dofs()});
  for (int d = 0; d < skeleton.num_dofs(); ++d) {
    double largest = 0.0;
    for (const Dof::Drive& drive : skeleton.dofs[d].joints)
      if (skeleton.joints[drive.joint].type == Joint::Type::revolute)
        largest = std::max(largest, std::abs(drive.weight));
    if (largest > 0.0) scale[d] = 1.0 / largest;
  }
  return scale;
}

std::string join(const torch::Tensor& numbers, const std::function<std::string(std::int64_t)>& name) {
  std::string out;
  const torch::Tensor flat = numbers.contiguous().view(-1);
  for (std::int64_t i = 0; i < flat.numel(); ++i) out += (i ? ", " : "") + name(flat[i].item<std::int64_t>());
  return out;
}

}  // namespace

torch::Tensor face_tensor(const Character& character) {
  torch::Tensor faces = torch::empty({character.mesh.num_faces(), 3}, torch::kInt32);
  std::copy_n(character.mesh.faces.data()->data(), faces.numel(), faces.data_ptr<int>());
  return faces;
}

EgNetStage::EgNetStage(const Dataset& dataset, const Character& character, const EgNetRunConfig& config)
    : dataset_(dataset),
      character_(character),
      config_(config),
      loader_(dataset, config.loader),
      network_(character, config.model, at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.seed))),
      surface_(character),
      arap_graph_(character),
      faces_(face_tensor(character)),
      radians_to_dof_(radians_to_dof(character.skeleton)) {
  if (config_.standardise) standardise_inputs();
}

LossTerms EgNetStage::loss(StepContext& context) {
  {
    ProfileScope scope(*context.profile, "load");
    last_batch_ = loader_.next();
  }
  return loss(last_batch_, context);
}

LossTerms EgNetStage::loss(const Batch& batch, StepContext& context) {
  Profile& profile = *context.profile;
  torch::Tensor A, T, vertices, boundary;
  {
    ProfileScope scope(profile, "network");
    std::tie(A, T) = network_->forward(noisy(batch.dofs, context.generator));
  }
  {
    ProfileScope scope(profile, "layers");
    vertices = surface_->deformed(batch.dofs.select(1, -1).contiguous(), A, T);
  }
  {
    ProfileScope scope(profile, "boundary");
    BoundaryOptions options;
    options.visible_only = config_.silhouette.visible_only;
    boundary = boundary_vertices(vertices.detach(), batch.projection, faces_, batch.distance.size(2),
                                 batch.distance.size(3), batch.valid, options);
  }
  SilhouetteLoss silhouette;
  {
    ProfileScope scope(profile, "silhouette");
    silhouette = silhouette_loss(vertices, faces_, boundary, silhouette_target(batch), config_.silhouette);
  }
  ProfileScope scope(profile, "arap");
  const torch::Tensor arap = arap_loss(A, T, arap_graph_);
  return {{"model_to_data", silhouette.model_to_data, config_.silhouette_weight},
          {"data_to_model", silhouette.data_to_model, config_.silhouette_weight},
          {"arap", arap, config_.arap_weight}};
}

torch::Tensor EgNetStage::noisy(const torch::Tensor& dofs, at::Generator generator) const {
  torch::Tensor out = dofs;
  if (config_.pose_noise > 0.0) {
    const auto shared = torch::empty({dofs.size(0), 1, dofs.size(2)}).normal_(0.0, config_.pose_noise, generator);
    out = out + shared * radians_to_dof_;
  }
  if (config_.input_noise > 0.0)
    out = out + torch::empty(dofs.sizes()).normal_(0.0, config_.input_noise, generator) * radians_to_dof_;
  return out;
}

torch::Tensor EgNetStage::training_windows(std::size_t limit) const {
  const std::vector<SampleId> samples = dataset_.samples(config_.loader.split);
  const std::size_t count = std::min(limit, samples.size());
  std::vector<torch::Tensor> windows;
  for (std::size_t i = 0; i < count; ++i)
    windows.push_back(dataset_.dof_window(samples[i * samples.size() / count], config_.model.window));
  return torch::stack(windows);
}

void EgNetStage::standardise_inputs() {
  torch::NoGradGuard no_grad;
  const torch::Tensor windows = training_windows(kStatisticsFrames);
  torch::Tensor sum, squares;
  for (const torch::Tensor& part : windows.split(kStatisticsChunk)) {
    const torch::Tensor features = network_->node_features(part).to(torch::kFloat64);
    const torch::Tensor a = features.sum(0), b = features.square().sum(0);
    sum = sum.defined() ? sum + a : a;
    squares = squares.defined() ? squares + b : b;
  }
  const torch::Tensor mean = sum / windows.size(0);
  const torch::Tensor variance = (squares / windows.size(0) - mean.square()).clamp_min(0.0);
  network_->set_input_statistics(mean.to(torch::kFloat32), variance.sqrt().to(torch::kFloat32), config_.feature_floor);
}

void EgNetStage::prepare_evaluation() {
  if (!config_.recalibrate_norm || config_.model.sagcn.norm == SagcnNorm::none) return;
  // In training mode a pass mixes a share `momentum` of the batch's statistics into the running ones. Started from
  // zero, one pass over all frames leaves momentum * (statistics of the whole set).
  std::vector<torch::Tensor> running;
  for (const auto& item : network_->named_buffers())
    if (item.key().find("running_") != std::string::npos && item.value().defined()) running.push_back(item.value());
  const torch::Tensor windows = training_windows(kStatisticsFrames);
  if (windows.size(0) < 2) return;
  for (torch::Tensor& buffer : running) buffer.zero_();
  network_->train();
  network_->forward(windows);
  for (torch::Tensor& buffer : running) buffer.div_(config_.model.sagcn.norm_momentum);
}

std::string EgNetStage::batch_description() const {
  if (!last_batch_.frames.defined()) return "none yet";
  std::string out = "frames ";
  for (std::int64_t b = 0; b < last_batch_.frames.size(0); ++b)
    out +=
        fmt::format("{}{}:{}", b ? ", " : "", dataset_.sequences()[last_batch_.sequence[b].item<std::int64_t>()].name,
                    last_batch_.frames[b].item<std::int64_t>());
  return out + "; cameras " +
         join(last_batch_.cameras[0], [this](std::int64_t c) { return dataset_.camera(static_cast<int>(c)).name; }) +
         (last_batch_.cameras.size(0) > 1 ? " (of the first)" : "");
}

std::string EgNetStage::identity() const {
  return fmt::format("character {} {}, capture {} with {} training frames and {} cameras", character_.name,
                     character_.fingerprint(), dataset_.capture().name, dataset_.samples(config_.loader.split).size(),
                     dataset_.camera_indices(config_.loader.cameras).size());
}

std::vector<Picture> EgNetStage::pictures() {
  std::vector<Picture> pictures;
  for (Split split : {Split::test, Split::train}) {
    const std::vector<SampleId> samples = dataset_.samples(split);
    if (samples.empty()) continue;
    OverlaySheet sheet(dataset_, faces_);
    for (int column = 0; column < 4; ++column) {
      const SampleId sample = samples[(2 * column + 1) * samples.size() / 8];
      const torch::Tensor window = dataset_.dof_window(sample, config_.model.window).unsqueeze(0);
      const auto [A, T] = network_->forward(window);
      const torch::Tensor dofs = window.select(1, -1).contiguous();
      sheet.add(sample, surface_->skinned(dofs)[0], surface_->deformed(dofs, A, T)[0]);
    }
    pictures.push_back({"overlay-" + to_string(split),
                        to_string(split) + " split: outline of the mask green, pure skinning blue, EGNet red",
                        sheet.image()});
  }
  return pictures;
}

}  // namespace doppel
