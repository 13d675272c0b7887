#include "doppel/eval/cloud_metrics.h"

#include <cmath>

#include "doppel/core/progress.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/surface_metrics.h"

namespace doppel {

namespace {

constexpr double kMillimetres = 1000.0;

/// The p-quantile of sorted values, 0 <= p <= 1.
double sorted_quantile(const torch::Tensor& sorted, double p) {
  return sorted[std::lround(p * static_cast<double>(sorted.numel() - 1))].item<double>();
}

}  // namespace

nlohmann::ordered_json CloudResult::to_json() const {
  nlohmann::ordered_json json{{"surface_distance_mm", surface_distance_mm},
                              {"noise_mm", noise_mm},
                              {"median_mm", median_mm},
                              {"p99_mm", p99_mm},
                              {"points", points}};
  for (const auto& [name, distance] : cameras) json["cameras"][name] = distance;
  return json;
}

std::optional<CloudResult> evaluate_clouds(const Dataset& dataset, Split split, const torch::Tensor& faces,
                                           std::int64_t num_vertices, const CloudFunction& cloud,
                                           const EvaluationOptions& options, const std::string& title) {
  const torch::NoGradGuard no_grad;
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  GroundTruth ground_truth(dataset, options.ground_truth);
  BatchOptions wanted;
  wanted.past_frames = 0;
  wanted.images = true;
  std::vector<std::vector<torch::Tensor>> distances(cameras.size());  // of each cloud
  Progress progress(title, static_cast<std::int64_t>(samples.size()));
  for (const SampleId& sample : samples) {
    const torch::Tensor expected = ground_truth.at(sample, num_vertices);
    if (expected.defined()) {
      const SurfaceDistance surface(expected, faces);
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        if (dataset.crop_box(sample, cameras[c]).empty()) continue;
        const Batch batch = make_batch(dataset, {sample}, {{cameras[c]}}, wanted);
        const torch::Tensor points =
            cloud({{sample}, cameras[c], batch.image_projection, static_cast<int>(batch.image.size(2))});
        if (points.size(0) > 0) distances[c].push_back(surface.distances(points).to(torch::kFloat64));
      }
    }
    progress.advance(1);
  }
  CloudResult result;
  std::vector<torch::Tensor> all;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    if (distances[c].empty()) continue;
    result.cameras.emplace_back(dataset.camera(cameras[c]).name,
                                kMillimetres * torch::cat(distances[c]).mean().item<double>());
    all.insert(all.end(), distances[c].begin(), distances[c].end());
  }
  if (all.empty()) return std::nullopt;
  const torch::Tensor sorted = std::get<0>(torch::cat(all).sort());
  result.surface_distance_mm = kMillimetres * sorted.mean().item<double>();
  result.noise_mm = kMillimetres * std::sqrt(sorted.square().mean().item<double>());
  result.median_mm = kMillimetres * sorted_quantile(sorted, 0.5);
  result.p99_mm = kMillimetres * sorted_quantile(sorted, 0.99);
  result.points = static_cast<double>(sorted.numel()) / static_cast<double>(all.size());
  return result;
}

}  // namespace doppel
