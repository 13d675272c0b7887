#include "doppel/train/capture_stage.h"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/thin_out.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/train/image_sheet.h"
#include "doppel/train/overlay.h"

namespace doppel {

namespace {

constexpr std::int64_t kStatisticsChunk = 64;
constexpr int kValidationFrames = 64;
constexpr std::int64_t kLastStep = std::numeric_limits<std::int64_t>::max();

std::string join(const torch::Tensor& numbers, const std::function<std::string(std::int64_t)>& name) {
  std::string out;
  const torch::Tensor flat = numbers.contiguous().view(-1);
  for (std::int64_t i = 0; i < flat.numel(); ++i) out += (i ? ", " : "") + name(flat[i].item<std::int64_t>());
  return out;
}

}  // namespace

CaptureStage::CaptureStage(const Dataset& dataset, const Character& character, const LoaderOptions& options)
    : dataset_(dataset), character_(character), options_(options), loader_(dataset, options) {}

LossTerms CaptureStage::loss(StepContext& context) {
  {
    ProfileScope scope(*context.profile, "load");
    last_batch_ = loader_.next();
    context.share = loader_.share();
  }
  return loss(last_batch_, context);
}

std::string CaptureStage::batch_description() const {
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

std::string CaptureStage::identity() const {
  std::vector<std::string> cameras;
  for (const int c : dataset_.camera_indices(options_.cameras)) cameras.push_back(dataset_.camera(c).name);
  return fmt::format("character {} {}, capture {} with {} training frames at {:g} a second and cameras {}",
                     character_.name, character_.fingerprint(), dataset_.capture().name,
                     chosen_samples(dataset_, options_.split, options_.frames).size(), dataset_.capture().fps,
                     fmt::join(cameras, ", "));
}

std::string CaptureStage::content() const {
  if (content_.empty()) content_ = fmt::format("{:08x}", dataset_.checksum());
  return content_;
}

std::vector<std::string> CaptureStage::camera_names() const {
  std::vector<std::string> names;
  for (const PinholeCamera& camera : dataset_.cameras()) names.push_back(camera.name);
  return names;
}

torch::Tensor CaptureStage::training_windows(std::size_t limit, int past_frames) const {
  std::vector<SampleId> samples = chosen_samples(dataset_, options_.split, options_.frames);
  thin_out(samples, static_cast<int>(limit));
  return dataset_.dof_windows(samples, past_frames);
}

LossTerms CaptureStage::validation_terms(const Batch& batch, StepContext& context) {
  context.step = kLastStep;
  return loss(batch, context);
}

std::optional<double> CaptureStage::validation_loss(std::int64_t step) {
  const std::vector<SampleId> samples = samples_to_show(Split::validation, kValidationFrames);
  if (samples.empty()) return std::nullopt;
  const torch::NoGradGuard no_grad;
  BatchOptions options = batch_options(options_);
  options.augment = false;
  const std::vector<int> all = dataset_.camera_indices(options_.cameras);
  double sum = 0.0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // A stage that trains on one camera at a time gets the cameras in turn.
    const std::vector<int> cameras = options_.cameras_per_sample == 1 ? std::vector<int>{all[i % all.size()]} : all;
    Profile profile;
    StepContext context{step, at::detail::createCPUGenerator(options_.seed), &profile};
    for (const LossTerm& term : validation_terms(make_batch(dataset_, {samples[i]}, {cameras}, options), context))
      sum += term.weight * term.value.item<double>();
  }
  return sum / static_cast<double>(samples.size());
}

std::vector<Split> CaptureStage::splits_to_show() const {
  return {dataset_.samples(Split::validation).empty() ? Split::test : Split::validation, Split::train};
}

std::vector<SampleId> CaptureStage::samples_to_show(Split split, int count) const {
  const std::vector<SampleId> samples =
      split == options_.split ? chosen_samples(dataset_, options_.split, options_.frames) : dataset_.samples(split);
  std::vector<SampleId> chosen;
  const auto n = std::min(as_size(count), samples.size());
  for (std::size_t i = 0; i < n && !samples.empty(); ++i)
    chosen.push_back(samples[(2 * i + 1) * samples.size() / (2 * n)]);
  return chosen;
}

std::vector<ReportImage> CaptureStage::outline_images(
    const torch::Tensor& faces, const std::string& legend,
    const std::function<std::pair<torch::Tensor, torch::Tensor>(const SampleId&)>& surfaces) const {
  std::vector<ReportImage> images;
  for (const Split split : splits_to_show()) {
    const std::vector<SampleId> samples = samples_to_show(split, 4);
    if (samples.empty()) continue;
    OverlaySheet sheet(dataset_, faces);
    for (const SampleId& sample : samples) {
      const auto [blue, red] = surfaces(sample);
      sheet.add(sample, blue, red);
    }
    images.push_back({"overlay-" + to_string(split), to_string(split) + " split: outline of the mask green, " + legend,
                      sheet.image()});
  }
  return images;
}

std::vector<ReportImage> CaptureStage::drawn_images(
    const std::string& name, const std::string& content,
    const std::function<std::vector<ShadedImage>(const Batch&)>& drawings) const {
  std::vector<ReportImage> images;
  for (const Split split : splits_to_show()) {
    ImageSheet sheet(dataset_, options_.image_size);
    for (const SampleId& sample : samples_to_show(split, 4)) {
      const Batch batch = sheet.batch(sample, options_.past_frames);
      sheet.add(batch, drawings(batch));
    }
    if (sheet.empty()) continue;
    images.push_back({name + "-" + to_string(split), to_string(split) + " split: " + content, sheet.image()});
  }
  return images;
}

BatchShare share_of_rays(const Ranks* ranks, std::int64_t rays) {
  if (!ranks) return {0, rays, rays};
  if (rays < ranks->world())
    fail<UsageError>("a step of {} rays cannot be shared by {} ranks; start fewer ranks, or set a larger rays.count",
                     rays, ranks->world());
  return ranks->share(rays);
}

double silhouette_views(const Batch& batch) { return batch.valid.sum().item<double>(); }

SilhouetteTarget silhouette_target(const Batch& batch) {
  return {batch.projection, batch.distance, batch.pixel_scale, batch.valid, batch.contour, batch.contour_offsets};
}

SilhouetteLoss batch_silhouette_loss(const torch::Tensor& vertices, const torch::Tensor& faces, const Batch& batch,
                                     const SilhouetteOptions& options, Profile& profile) {
  const SilhouetteTarget target = silhouette_target(batch);
  const std::int64_t size = batch.distance.size(2);
  if (options.boundary == SilhouetteBoundary::outline) {
    OutlinePoints outline;
    {
      ProfileScope scope(profile, "boundary");
      outline = outline_points(vertices.detach(), batch.projection, faces, size, size, batch.valid);
    }
    ProfileScope scope(profile, "silhouette");
    return silhouette_loss(vertices, faces, outline, target, options);
  }
  torch::Tensor boundary;
  {
    ProfileScope scope(profile, "boundary");
    BoundaryOptions boundary_options;
    boundary_options.visible_only = options.visible_only;
    boundary = boundary_vertices(vertices.detach(), batch.projection, faces, size, size, batch.valid, boundary_options);
  }
  ProfileScope scope(profile, "silhouette");
  return silhouette_loss(vertices, faces, boundary, target, options);
}

std::pair<torch::Tensor, torch::Tensor> input_statistics(
    const torch::Tensor& windows, const std::function<torch::Tensor(const torch::Tensor&)>& features) {
  torch::NoGradGuard no_grad;
  torch::Tensor sum, squares;
  for (const torch::Tensor& part : windows.split(kStatisticsChunk)) {
    const torch::Tensor values = features(part).to(torch::kFloat64);
    const torch::Tensor a = values.sum(0), b = values.square().sum(0);
    sum = sum.defined() ? sum + a : a;
    squares = squares.defined() ? squares + b : b;
  }
  const torch::Tensor mean = sum / windows.size(0);
  const torch::Tensor variance = (squares / windows.size(0) - mean.square()).clamp_min(0.0);
  return {mean.to(torch::kFloat32), variance.sqrt().to(torch::kFloat32)};
}

}  // namespace doppel
