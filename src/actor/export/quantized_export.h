#pragma once

#include <torch/types.h>

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/actor/export/actor_trace.h"
#include "doppel/actor/export/quantized_weights.h"
#include "doppel/actor/trained_pose.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// What a model gives for one sample, as it is compared: points in metres, or colours 0..1.
struct ModelOutput {
  enum class Kind { points, colours };
  std::string name;
  Kind kind;
  torch::Tensor values;  ///< points [...,3], colours of any shape
};

/// The outputs of a model for the samples 0 .. count - 1, with the weights that its networks have at the moment.
struct ModelSamples {
  std::int64_t count = 0;
  std::function<std::vector<ModelOutput>(std::int64_t)> outputs;
};

/// An actor in up to 16 poses of the prepared capture, evenly spaced over the test split (over all splits where it has
/// no motion), each seen by another camera: `vertices`; with a texture `texture`; with Gaussians `gaussian_centres` and
/// `gaussian_colours`.
/// @param past_frames F of the motion windows @throws Error when no sequence has a motion
ModelSamples actor_samples_of(const Dataset& dataset, const ActorFunctions& functions, int past_frames);
/// PoseNet and DefNet on up to 16 images of the first camera, chosen alike: `vertices`, the root's pivot at the origin.
ModelSamples pose_samples_of(const Dataset& dataset, TrainedPose& trained);

/// How far an output of the quantized model is from that of the model, over all samples. Points: distances in mm.
/// Colours: absolute differences in grey levels, of 255.
struct OutputError {
  std::string name;
  ModelOutput::Kind kind;
  double largest = 0.0, mean = 0.0;
};

/// What quantization saves and what it costs.
struct QuantizationReport {
  int bits = 0;
  std::int64_t float_bytes = 0;  ///< of the quantized weights in float32
  std::int64_t bytes = 0;        ///< of the same in the file
  std::int64_t samples = 0;
  std::vector<OutputError> errors;

  /// {"bits", "float32_bytes", "bytes", "samples", "vertices_mm": {"largest", "mean"}, "texture_grey_levels": ...}
  nlohmann::ordered_json to_json() const;
  std::string to_text() const;  ///< some lines for people
};

/// Reads the quantized weights of a file that was written, and compares the model that has them with the model as it
/// was trained. Afterwards, the networks have their own weights again.
/// @param file the tensors of the file, by name
/// @throws Error when the file has none of `weights`, or when a result is not finite
QuantizationReport compare_quantized(const QuantizedWeights& weights, const NamedWeights& file,
                                     const ModelSamples& samples);

}  // namespace doppel
