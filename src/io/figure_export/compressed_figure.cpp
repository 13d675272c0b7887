#include "doppel/io/figure_export/compressed_figure.h"

#include <algorithm>

namespace doppel {
namespace {

constexpr double kCoarsestStep = 0x1p-12, kFinestStep = 0x1p-17;  // metres
constexpr double kMaxCompressionError = 0.1;                      // millimetres

/// The largest weight takes what rounding the others leaves, so that the sum stays 1.
std::array<float, 4> rounded_weights(const std::array<float, 4>& weights, double step) {
  std::array<float, 4> result{};
  double rest = 1.0;
  for (std::size_t i = 1; i < 4; ++i) {
    const double weight = round_to_step(static_cast<double>(weights[i]), step);
    result[i] = static_cast<float>(weight);
    rest -= weight;
  }
  result[0] = static_cast<float>(rest);
  return result;
}

Figure rounded_figure(Figure figure, const GlbSteps& steps) {
  for (Eigen::Vector3d& vertex : figure.rest_vertices)
    for (double& value : vertex) value = round_to_step(value, steps.position);
  for (std::array<float, 4>& weights : figure.weight) weights = rounded_weights(weights, steps.skin_weight);
  return figure;
}

MorphTargets rounded_morphs(MorphTargets morphs, const GlbSteps& steps) {
  for (Eigen::MatrixX3f& target : morphs.targets)
    for (float& value : target.reshaped())
      value = static_cast<float>(round_to_step(static_cast<double>(value), steps.displacement));
  return morphs;
}

FigureTracks rounded_tracks(FigureTracks tracks, const GlbSteps& steps) {
  for (auto& track : tracks.rotation)
    for (Eigen::Quaterniond& turn : track)
      for (double& value : turn.coeffs()) value = round_to_step(value, steps.rotation);
  for (auto& track : tracks.translation)
    for (Eigen::Vector3d& offset : track)
      for (double& value : offset) value = round_to_step(value, steps.translation);
  for (double& weight : tracks.weights.reshaped()) weight = round_to_step(weight, steps.morph_weight);
  interpolate_between_keys(tracks);
  return tracks;
}

/// @param surfaces of the figure without compression, by frame
/// @return the error; of the frames up to the first whose error is too large, when `give_up`
FigureError compression_error(const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks,
                              const CompressedFigure& packed, bool give_up) {
  FigureError error;
  const std::size_t frames = tracks.rotation.empty() ? 0 : tracks.rotation[0].size();
  for (std::size_t t = 0; t < frames; ++t) {
    const auto exact = figure_surface(figure, morphs, tracks, t),
               found = figure_surface(packed.figure, packed.morphs, packed.tracks, t);
    for (std::size_t v = 0; v < exact.size(); ++v) {
      const double distance = 1000.0 * (found[v] - exact[v]).norm();
      error.mean += distance / static_cast<double>(exact.size() * frames);
      error.worst = std::max(error.worst, distance);
    }
    if (give_up && error.worst > kMaxCompressionError) break;
  }
  return error;
}

}  // namespace

CompressedFigure compress_figure(const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks) {
  CompressedFigure packed;
  packed.tracks = rounded_tracks(tracks, packed.steps);
  for (packed.steps.displacement = kCoarsestStep;; packed.steps.displacement /= 2) {
    packed.steps.position = packed.steps.displacement / 4;
    packed.figure = rounded_figure(figure, packed.steps);
    packed.morphs = rounded_morphs(morphs, packed.steps);
    const bool last = packed.steps.displacement <= kFinestStep;
    packed.error = compression_error(figure, morphs, tracks, packed, !last);
    if (last || packed.error.worst <= kMaxCompressionError) return packed;
  }
}

}  // namespace doppel
