#include "doppel/actor/export/correctives/engine_clip.h"

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {
namespace {

constexpr int kMinShapes = 2, kMaxShapes = 256;
constexpr int kPosesPerShape = 3;  ///< that the motions have at least
constexpr double kFittedShare = 0.8;

std::vector<std::vector<double>> window_rows(const torch::Tensor& window) {
  const torch::Tensor rows = window.to(torch::kFloat64).contiguous();
  std::vector<std::vector<double>> result;
  for (std::int64_t i = 0; i < rows.size(0); ++i) {
    const double* row = rows.data_ptr<double>() + i * rows.size(1);
    result.emplace_back(row, row + rows.size(1));
  }
  return result;
}

/// @throws UsageError
void check_engine_clip(const EngineTeacher& teacher, const EngineClipOptions& options) {
  if (options.shapes < kMinShapes || options.shapes > kMaxShapes)
    fail<UsageError>("an engine clip has {} to {} corrective shapes (--morphs), found {}", kMinShapes, kMaxShapes,
                     options.shapes);
  int poses = 0;
  for (const WindowSource& source : teacher.motions)
    poses += static_cast<int>(source.motion.num_frames() / source.step);
  if (poses < kPosesPerShape * options.shapes)
    fail<UsageError>(
        "fitting {} corrective shapes: the motions to fit have {} poses at {} a second, and at least {} are needed; "
        "give more or longer motions (--motion, several times), an actor by --run, whose training motions are fitted "
        "too, or fewer shapes (--morphs)",
        options.shapes, poses, teacher.frames_per_second, kPosesPerShape * options.shapes);
}

/// Mean distance of skinned vertices from those of a frame, metres.
/// @param displaced [3N] of the rest vertices; may be empty
double mean_distance(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                     const std::vector<float>& vertices, const Eigen::VectorXf& displaced) {
  double sum = 0.0;
  for (std::size_t v = 0; v < blended.size(); ++v) {
    Eigen::Vector3d rest = figure.rest_vertices[v];
    if (displaced.size() > 0) rest += displaced.segment<3>(3 * static_cast<Eigen::Index>(v)).cast<double>();
    sum += (blended[v] * rest - Eigen::Map<const Eigen::Vector3f>(&vertices[3 * v]).cast<double>()).norm();
  }
  return sum / static_cast<double>(blended.size());
}

class EngineClipWriter : public SequenceWriter {
 public:
  EngineClipWriter(const std::filesystem::path& folder, const Character& character, EngineTeacher teacher,
                   const EngineClipOptions& options, EngineClipReport& report)
      : path_(folder / "engine.glb"),
        character_(character),
        teacher_(std::move(teacher)),
        options_(options),
        report_(report),
        figure_(make_figure(character, options.names)),  // refuses names that do not fit before the first frame
        function_(unfitted_function(figure_, teacher_.past_frames, teacher_.frames_per_second)) {
    check_engine_clip(teacher_, options);
    frames_.clip.frames_per_second = options.frames_per_second;
    frames_.clip.parts = options.parts;
  }

  void write(const PosedFrame& frame) override {
    append_frame(frames_.clip, frame);
    frames_.inputs.push_back(inputs_of_window(function_, figure_, character_.skeleton, window_rows(frame.window)));
  }

  void close() override {
    find_use();
    CorrectiveFitOptions fit;
    fit.shapes = options_.shapes - 1;
    fit.windows = options_.windows;
    const FittedCorrectives fitted = fit_correctives(figure_, character_.skeleton, function_, teacher_, frames_, fit);
    MorphTargets morphs = corrective_targets(fitted.shapes, fitted.low, fitted.high);
    set_weights(fitted.function, morphs);
    const FigureTracks tracks = thin_tracks(figure_, character_.skeleton, frames_.clip, morphs, options_.tolerance);
    write_glb(path_, {character_.name, character_.mesh, frames_.clip, {}, {}, &fitted.function}, figure_, morphs,
              tracks);
    const FigureError error = figure_error(figure_, frames_.clip, morphs, tracks);
    report_.figure = {static_cast<int>(figure_.nodes.size()),
                      morphs.count(),
                      morphs.at_once,
                      false,
                      tracks.num_keys(),
                      error.mean,
                      error.worst,
                      figure_.largest_dropped_weight,
                      {}};
    report_.inputs = static_cast<int>(fitted.function.num_inputs());
    report_.hidden = static_cast<int>(fitted.function.hidden_offset.size());
    report_.history = fitted.function.lags.empty() ? 0.0 : fitted.function.lags.back();
    for (std::size_t c = 0; c < options_.parts.size(); ++c) measure(fitted, morphs, c);
  }

 private:
  void find_use() {
    for (std::size_t c = 0; c < options_.parts.size(); ++c)
      for (int t = 0; t < options_.parts[c].frames; ++t)
        frames_.use.push_back(options_.unseen[c]                            ? FrameUse::unseen
                              : t < fitted_frames(options_.parts[c].frames) ? FrameUse::fitted
                                                                            : FrameUse::held_out);
  }

  void set_weights(const CorrectiveFunction& function, MorphTargets& morphs) const {
    morphs.weights.resize(frames_.clip.num_frames(), morphs.count());
    morphs.weights.col(0).setOnes();
    for (std::size_t t = 0; t < frames_.inputs.size(); ++t)
      morphs.weights.row(static_cast<Eigen::Index>(t)).tail(morphs.count() - 1) =
          function.weights(frames_.inputs[t]).cast<double>().transpose();
  }

  /// The errors of a clip over the frames that were not fitted.
  void measure(const FittedCorrectives& fitted, const MorphTargets& morphs, std::size_t c) {
    const ClipPart& part = options_.parts[c];
    EngineClipError error;
    error.name = part.name;
    error.unseen = options_.unseen[c];
    const LinearShapes& shapes = fitted.shapes;
    for (int f = error.unseen ? 0 : fitted_frames(part.frames); f < part.frames; ++f) {
      const int t = part.first + f;
      const std::vector<float>& vertices = frames_.clip.vertices[as_size(t)];
      const auto blended =
          blend_transforms(figure_, pose_nodes(figure_, character_.skeleton, frames_.clip.dofs[as_size(t)]));
      const Eigen::VectorXf shares = morphs.weights.row(t).tail(morphs.count() - 1).cast<float>(),
                            found = fitted.low + (fitted.high - fitted.low).cwiseProduct(shares),
                            best = shapes.weights_of(unposed_displacements(figure_, blended, vertices));
      error.skinning += 1000.0 * mean_distance(figure_, blended, vertices, {});
      error.correctives += 1000.0 * mean_distance(figure_, blended, vertices, shapes.mean + shapes.components * found);
      error.best += 1000.0 * mean_distance(figure_, blended, vertices, shapes.mean + shapes.components * best);
      ++error.frames;
    }
    for (double* sum : {&error.skinning, &error.correctives, &error.best}) *sum /= std::max(error.frames, 1);
    report_.clips.push_back(error);
  }

  std::filesystem::path path_;
  const Character& character_;
  EngineTeacher teacher_;
  EngineClipOptions options_;
  EngineClipReport& report_;
  Figure figure_;
  CorrectiveFunction function_;
  CorrectiveFrames frames_;
};

}  // namespace

int fitted_frames(int frames) { return std::max(1, static_cast<int>(kFittedShare * frames)); }

std::unique_ptr<SequenceWriter> make_engine_clip_writer(const std::filesystem::path& folder, const Character& character,
                                                        EngineTeacher teacher, const EngineClipOptions& options,
                                                        EngineClipReport& report) {
  return std::make_unique<EngineClipWriter>(folder, character, std::move(teacher), options, report);
}

}  // namespace doppel
