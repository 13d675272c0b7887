#include "doppel/eval/cloud_metrics.h"

#include <cmath>

#include "doppel/core/progress.h"
#include "doppel/data/batch_builder.h"
#include "doppel/data/loader.h"
#include "doppel/eval/ground_truth.h"
#include "doppel/eval/surface_metrics.h"

namespace doppel {

namespace {

constexpr double kMillimetres = 1000.0;

struct Sums {
  double distance = 0.0, squares = 0.0;
  std::int64_t points = 0, clouds = 0;

  void add(const torch::Tensor& distances) {
    distance += distances.sum().item<double>();
    squares += distances.square().sum().item<double>();
    points += distances.numel();
    ++clouds;
  }
  void add(const Sums& other) {
    distance += other.distance;
    squares += other.squares;
    points += other.points;
    clouds += other.clouds;
  }
  double mean() const { return distance / static_cast<double>(points); }
};

}  // namespace

nlohmann::ordered_json CloudResult::to_json() const {
  nlohmann::ordered_json json{{"surface_distance_mm", surface_distance_mm}, {"noise_mm", noise_mm}, {"points", points}};
  for (const auto& [name, distance] : cameras) json["cameras"][name] = distance;
  return json;
}

std::optional<CloudResult> evaluate_clouds(const Dataset& dataset, Split split, const torch::Tensor& faces,
                                           std::int64_t num_vertices, const CloudFunction& cloud,
                                           const EvaluationOptions& options, const std::string& title) {
  const torch::NoGradGuard no_grad;
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  GroundTruth truth(dataset);
  BatchOptions wanted;
  wanted.past_frames = 0;
  wanted.images = true;
  std::vector<Sums> per_camera(cameras.size());
  Progress progress(title, static_cast<std::int64_t>(samples.size()));
  for (const SampleId& sample : samples) {
    const torch::Tensor expected = truth.at(sample, num_vertices);
    if (expected.defined()) {
      const SurfaceDistance surface(expected, faces);
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        if (dataset.crop_box(sample, cameras[c]).empty()) continue;
        const Batch batch = make_batch(dataset, {sample}, {{cameras[c]}}, wanted);
        const torch::Tensor points =
            cloud({{sample}, cameras[c], batch.image_projection, static_cast<int>(batch.image.size(2))});
        if (points.size(0) > 0) per_camera[c].add(surface.distances(points));
      }
    }
    progress.advance(1);
  }
  CloudResult result;
  Sums all;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    all.add(per_camera[c]);
    if (per_camera[c].points > 0)
      result.cameras.emplace_back(dataset.camera(cameras[c]).name, kMillimetres * per_camera[c].mean());
  }
  if (all.points == 0) return std::nullopt;
  result.surface_distance_mm = kMillimetres * all.mean();
  result.noise_mm = kMillimetres * std::sqrt(all.squares / static_cast<double>(all.points));
  result.points = static_cast<double>(all.points) / static_cast<double>(all.clouds);
  return result;
}

}  // namespace doppel
