#include "doppel/actor/export/quantized_export.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/tensor/reference_scope.h"
#include "doppel/core/thin_out.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr int kMaxSamples = 16;

/// Samples of the test split, else of any. @param allowed of a sequence
template <typename Allowed>
std::vector<SampleId> samples_to_compare(const Dataset& dataset, const Allowed& allowed) {
  for (const Split split : {Split::test, Split::validation, Split::train}) {
    std::vector<SampleId> samples = dataset.samples(split);
    std::erase_if(samples, [&](const SampleId& s) { return !allowed(dataset.sequences().at(s.sequence)); });
    thin_out(samples, kMaxSamples);
    if (!samples.empty()) return samples;
  }
  fail("comparing the quantized model: {} has no sequence to compare on; export without --quantize",
       dataset.folder().string());
}

/// Networks have the weights of a file as long as the scope lives.
class StoredWeightsScope {
 public:
  explicit StoredWeightsScope(const std::vector<StoredWeight>& weights) : weights_(weights) {
    for (const StoredWeight& entry : weights_) own_.push_back(entry.parameter.detach().clone());
    for (const StoredWeight& entry : weights_) entry.parameter.detach().copy_(entry.weight);
  }
  ~StoredWeightsScope() {
    for (std::size_t i = 0; i < own_.size(); ++i) weights_[i].parameter.detach().copy_(own_[i]);
  }
  StoredWeightsScope(const StoredWeightsScope&) = delete;
  StoredWeightsScope& operator=(const StoredWeightsScope&) = delete;

 private:
  const std::vector<StoredWeight>& weights_;
  std::vector<Tensor> own_;
};

/// Distances in mm, or differences in grey levels.
Tensor output_errors(const ModelOutput& found, const ModelOutput& wanted) {
  const Tensor difference = found.values.to(torch::kFloat64) - wanted.values.to(torch::kFloat64);
  const Tensor errors =
      wanted.kind == ModelOutput::Kind::points ? 1000.0 * difference.norm(2, {-1}, false) : 255.0 * difference.abs();
  if (!errors.isfinite().all().item<bool>())
    fail(
        "comparing the quantized model: {} holds numbers that are not finite; export with more bits, or without "
        "--quantize",
        wanted.name);
  return errors;
}

std::string unit_of(ModelOutput::Kind kind) { return kind == ModelOutput::Kind::points ? "mm" : "grey_levels"; }

}  // namespace

ModelSamples actor_samples_of(const Dataset& dataset, const ActorFunctions& functions, int past_frames) {
  const std::vector<SampleId> samples =
      samples_to_compare(dataset, [](const DatasetSequence& sequence) { return sequence.has_motion(); });
  const Tensor windows = dataset.dof_windows(samples, past_frames), cameras = projection_tensor(dataset.cameras());
  return {static_cast<std::int64_t>(samples.size()), [=](std::int64_t i) {
            const Tensor window = windows.narrow(0, i, 1), camera = cameras.narrow(0, i % cameras.size(0), 1);
            const Tensor vertices = functions.geometry(window);
            std::vector<ModelOutput> all{{"vertices", ModelOutput::Kind::points, vertices}};
            if (functions.texture)
              all.push_back({"texture", ModelOutput::Kind::colours, functions.texture(window, camera, vertices)});
            if (functions.gaussians) {
              const Tensor rows = functions.gaussians(window, camera, vertices);
              all.push_back({"gaussian_centres", ModelOutput::Kind::points, rows.narrow(2, 0, 3)});
              all.push_back({"gaussian_colours", ModelOutput::Kind::colours, rows.narrow(2, 11, 3)});
            }
            return all;
          }};
}

ModelSamples pose_samples_of(const Dataset& dataset, TrainedPose& trained) {
  const std::vector<SampleId> samples = samples_to_compare(dataset, [](const DatasetSequence&) { return true; });
  const Batch batch = person_batch(dataset, samples, {0}, trained.input_size());
  const PersonView view = person_view(batch);
  return {
      static_cast<std::int64_t>(samples.size()), [view, &trained](std::int64_t i) {
        const auto row = [i](const Tensor& rows) { return rows.narrow(0, i, 1); };
        const Tensor image = row(view.image);
        const LandmarkRays none{row(view.rays.origin), row(view.rays.direction),
                                torch::zeros_like(row(view.rays.confidence))};
        const Tensor dofs = trained.dofs(trained.capture({image, row(view.camera_rotation), none, Tensor()}));
        const auto [A, T] = trained.deformation(image);
        return std::vector<ModelOutput>{{"vertices", ModelOutput::Kind::points, trained.surface->deformed(dofs, A, T)}};
      }};
}

nlohmann::ordered_json QuantizationReport::to_json() const {
  nlohmann::ordered_json json{{"bits", bits}, {"float32_bytes", float_bytes}, {"bytes", bytes}, {"samples", samples}};
  for (const OutputError& error : errors)
    json[error.name + "_" + unit_of(error.kind)] = {{"largest", error.largest}, {"mean", error.mean}};
  return json;
}

std::string QuantizationReport::to_text() const {
  std::string text = fmt::format("{} bits: {:.1f} MB of weights take {:.1f} MB; the difference in {} frames:\n", bits,
                                 static_cast<double>(float_bytes) / 1e6, static_cast<double>(bytes) / 1e6, samples);
  for (const OutputError& error : errors) {
    std::string name = error.name, unit = unit_of(error.kind);
    for (std::string* words : {&name, &unit}) std::replace(words->begin(), words->end(), '_', ' ');
    text += fmt::format("  {}: {:.3g} {} on average, {:.3g} {} at most\n", name, error.mean, unit, error.largest, unit);
  }
  return text;
}

QuantizationReport compare_quantized(const QuantizedWeights& weights, const NamedWeights& file,
                                     const ModelSamples& samples) {
  const torch::NoGradGuard no_grad;
  const ReferenceScope plain_operations;  // kernels might keep copies of the weights
  const std::vector<StoredWeight> stored = weights.stored(file);
  if (stored.empty()) fail("comparing the quantized model: the file holds no quantized weight of the networks");
  QuantizationReport report{weights.bits(), 0, 0, samples.count, {}};
  for (const StoredWeight& entry : stored) {
    report.float_bytes += static_cast<std::int64_t>(entry.parameter.nbytes());
    report.bytes += entry.bytes;
  }
  for (std::int64_t i = 0; i < samples.count; ++i) {
    const std::vector<ModelOutput> wanted = samples.outputs(i);
    const StoredWeightsScope of_the_file(stored);
    const std::vector<ModelOutput> found = samples.outputs(i);
    if (i == 0)
      for (const ModelOutput& output : wanted) report.errors.push_back({output.name, output.kind});
    for (std::size_t o = 0; o < wanted.size(); ++o) {
      const Tensor errors = output_errors(found[o], wanted[o]);
      report.errors[o].largest = std::max(report.errors[o].largest, errors.max().item<double>());
      report.errors[o].mean += errors.mean().item<double>() / static_cast<double>(samples.count);
    }
  }
  return report;
}

}  // namespace doppel
