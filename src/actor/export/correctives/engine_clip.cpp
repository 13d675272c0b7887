#include "doppel/actor/export/correctives/engine_clip.h"

#include <algorithm>

#include "doppel/actor/export/correctives/fit_correctives.h"
#include "doppel/actor/export/correctives/fit_helpers.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/io/figure_export/compressed_figure.h"
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
  const bool shapes = options.helpers == 0;
  const int count = shapes ? options.shapes : options.helpers, least = shapes ? kMinShapes : 1;
  const char *what = shapes ? "corrective shapes" : "helper joints", *option = shapes ? "--morphs" : "--helpers";
  if (count < least || count > kMaxShapes)
    fail<UsageError>("an engine clip has {} to {} {} ({}), found {}", least, kMaxShapes, what, option, count);
  int poses = 0;
  for (const WindowSource& source : teacher.motions)
    poses += static_cast<int>(source.motion.num_frames() / source.step);
  if (poses < kPosesPerShape * count)
    fail<UsageError>(
        "fitting {} {}: the motions to fit have {} poses at {} a second, and at least {} are needed; "
        "give more or longer motions (--motion, several times; the training motions of an actor given by --run count "
        "too), or a smaller number ({})",
        count, what, poses, teacher.frames_per_second, kPosesPerShape * count, option);
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

/// Mean distances of the vertices of a frame from those of the actor, metres.
struct FrameErrors {
  double skinning, function, best;
};

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
    if (options_.helpers > 0)
      write_helpers();
    else
      write_correctives();
  }

 private:
  void find_use() {
    for (std::size_t c = 0; c < options_.parts.size(); ++c)
      for (int t = 0; t < options_.parts[c].frames; ++t)
        frames_.use.push_back(options_.unseen[c]                            ? FrameUse::unseen
                              : t < fitted_frames(options_.parts[c].frames) ? FrameUse::fitted
                                                                            : FrameUse::held_out);
  }

  // ---- corrective shapes ----

  void write_correctives() {
    CorrectiveFitOptions fit;
    fit.shapes = options_.shapes - 1;
    fit.windows = options_.windows;
    const FittedCorrectives fitted = fit_correctives(figure_, character_.skeleton, function_, teacher_, frames_, fit);
    MorphTargets morphs = corrective_targets(fitted.shapes, fitted.low, fitted.high);
    set_weights(fitted.function, morphs);
    FigureFile file{character_.name, character_.mesh, frames_.clip};
    file.correctives = &fitted.function;
    write_file(file, figure_, morphs,
               thin_tracks(figure_, character_.skeleton, frames_.clip, morphs, options_.tolerance));
    report_function(fitted.function);
    measure([&](std::size_t t) { return errors_of_shapes(fitted, morphs, t); });
  }

  void set_weights(const CorrectiveFunction& function, MorphTargets& morphs) const {
    morphs.weights.resize(frames_.clip.num_frames(), morphs.count());
    morphs.weights.col(0).setOnes();
    for (std::size_t t = 0; t < frames_.inputs.size(); ++t)
      morphs.weights.row(static_cast<Eigen::Index>(t)).tail(morphs.count() - 1) =
          function.weights(frames_.inputs[t]).cast<double>().transpose();
  }

  FrameErrors errors_of_shapes(const FittedCorrectives& fitted, const MorphTargets& morphs, std::size_t t) const {
    const LinearShapes& shapes = fitted.shapes;
    const std::vector<float>& vertices = frames_.clip.vertices[t];
    const auto blended = blend_transforms(figure_, bones_of(t));
    const Eigen::VectorXf shares =
                              morphs.weights.row(static_cast<Eigen::Index>(t)).tail(morphs.count() - 1).cast<float>(),
                          found = fitted.low + (fitted.high - fitted.low).cwiseProduct(shares),
                          best = shapes.weights_of(unposed_displacements(figure_, blended, vertices));
    return {mean_distance(figure_, blended, vertices, {}),
            mean_distance(figure_, blended, vertices, shapes.mean + shapes.components * found),
            mean_distance(figure_, blended, vertices, shapes.mean + shapes.components * best)};
  }

  // ---- helper joints ----

  void write_helpers() {
    HelperFitOptions fit;
    fit.joints.helpers = options_.helpers;
    fit.windows = options_.windows;
    const FittedHelpers fitted = fit_helpers(figure_, character_.skeleton, function_, teacher_, frames_, fit);
    const Figure& figure = fitted.figure.figure();
    std::vector<std::vector<Eigen::Affine3d>> posed;
    for (std::size_t t = 0; t < frames_.inputs.size(); ++t)
      posed.push_back(fitted.figure.under(bones_of(t), frames_.clip.vertices[t]));
    TriangleMesh mesh = character_.mesh;
    mesh.vertices = figure.rest_vertices;
    FigureFile file{character_.name, mesh, frames_.clip};
    file.helpers = &fitted.function;
    file.standing = &fitted.figure.standing();
    write_file(file, figure, {}, thin_tracks(figure, posed, frames_.clip, {}, options_.tolerance));
    report_.helpers = options_.helpers;
    report_function(fitted.function.shares);
    measure([&](std::size_t t) { return errors_of_helpers(fitted, posed[t], t); });
  }

  /// @param posed the nodes of the file
  FrameErrors errors_of_helpers(const FittedHelpers& fitted, const std::vector<Eigen::Affine3d>& posed,
                                std::size_t t) const {
    const Figure& figure = fitted.figure.figure();
    const std::vector<float>& vertices = frames_.clip.vertices[t];
    const std::vector<Eigen::Affine3d> bones = bones_of(t), moved = fitted.figure.nodes(
                                                                bones, fitted.function.transforms(frames_.inputs[t]));
    return {mean_distance(figure_, blend_transforms(figure_, bones), vertices, {}),
            mean_distance(figure, blend_transforms(figure, moved), vertices, {}),
            mean_distance(figure, blend_transforms(figure, posed), vertices, {})};
  }

  // ---- both ----

  std::vector<Eigen::Affine3d> bones_of(std::size_t t) const {
    return pose_nodes(figure_, character_.skeleton, frames_.clip.dofs[t]);
  }

  void write_file(FigureFile file, const Figure& figure, const MorphTargets& morphs, const FigureTracks& tracks) {
    FigureError error;
    if (options_.compress) {
      const CompressedFigure packed = compress_figure(figure, morphs, tracks);
      file.compression = packed.steps;
      write_glb(path_, file, packed.figure, packed.morphs, packed.tracks);
      error = figure_error(packed.figure, frames_.clip, packed.morphs, packed.tracks);
      report_.figure.compression = packed.error;
    } else {
      write_glb(path_, file, figure, morphs, tracks);
      error = figure_error(figure, frames_.clip, morphs, tracks);
    }
    report_.figure.nodes = static_cast<int>(figure.nodes.size());
    report_.figure.morphs = morphs.count();
    report_.figure.keys = tracks.num_keys();
    report_.figure.mean_error_mm = error.mean;
    report_.figure.worst_error_mm = error.worst;
    report_.figure.largest_dropped_weight = figure.largest_dropped_weight;
  }

  void report_function(const CorrectiveFunction& function) {
    report_.inputs = static_cast<int>(function.num_inputs());
    report_.hidden = static_cast<int>(function.hidden_offset.size());
    report_.history = function.lags.empty() ? 0.0 : function.lags.back();
  }

  /// The errors of the clips over the frames that were not fitted.
  void measure(const std::function<FrameErrors(std::size_t t)>& errors_of) {
    for (std::size_t c = 0; c < options_.parts.size(); ++c) {
      const ClipPart& part = options_.parts[c];
      EngineClipError error;
      error.name = part.name;
      error.unseen = options_.unseen[c];
      const int first = error.unseen ? 0 : fitted_frames(part.frames);
      error.frames = std::max(part.frames - first, 0);
      for (int f = first; f < part.frames; ++f) {
        const FrameErrors frame = errors_of(as_size(part.first + f));
        error.skinning += 1000.0 * frame.skinning / error.frames;
        error.function += 1000.0 * frame.function / error.frames;
        error.best += 1000.0 * frame.best / error.frames;
      }
      report_.clips.push_back(error);
    }
  }

  std::filesystem::path path_;
  const Character& character_;
  EngineTeacher teacher_;
  EngineClipOptions options_;
  EngineClipReport& report_;
  Figure figure_;
  CorrectiveFunction function_;
  EngineFrames frames_;
};

}  // namespace

int fitted_frames(int frames) { return std::max(1, static_cast<int>(kFittedShare * frames)); }

std::unique_ptr<SequenceWriter> make_engine_clip_writer(const std::filesystem::path& folder, const Character& character,
                                                        EngineTeacher teacher, const EngineClipOptions& options,
                                                        EngineClipReport& report) {
  return std::make_unique<EngineClipWriter>(folder, character, std::move(teacher), options, report);
}

}  // namespace doppel
