#include "doppel/actor/export/figure_writer.h"

#include "doppel/geometry/mesh.h"
#include "doppel/io/figure_export/compressed_figure.h"

namespace doppel {
namespace {

class FigureWriter : public SequenceWriter {
 public:
  FigureWriter(const std::filesystem::path& folder, const Character& character, const FigureOptions& options,
               FigureReport& report, FigureReport& fbx_report)
      : folder_(folder), character_(character), options_(options), report_(report), fbx_report_(fbx_report) {
    clip_.frames_per_second = options.frames_per_second;
    clip_.parts = options.parts;
    // Names that do not fit are refused before the first frame.
    figure_ = make_figure(character, options.names);
    if (options.glb) check_avatar(figure_, character.name, options.rights);
  }

  void write(const PosedFrame& frame) override { append_frame(clip_, frame); }
  void close() override {
    const FigureFile file{character_.name, character_.mesh, clip_, options_.rights};
    if (options_.glb || options_.usda || options_.fbx) write_skinned(file);
    if (options_.usda) write_usda(folder_ / "animation.usda", file);
    if (options_.pc2 || options_.mdd)
      write_obj(folder_ / "animation.obj", in_space(character_.mesh, options_.space), 1.0);
    if (options_.pc2) write_pc2(folder_ / "animation.pc2", clip_, options_.space);
    if (options_.mdd) write_mdd(folder_ / "animation.mdd", clip_, options_.space);
  }

 private:
  void write_skinned(const FigureFile& file) {
    const MorphTargets morphs = fit_morphs(figure_, character_.skeleton, clip_, options_.morphs);
    const FigureTracks tracks = thin_tracks(figure_, character_.skeleton, clip_, morphs, options_.tolerance);
    report_ = report_of(morphs, tracks, tracks.num_keys());
    if (options_.glb && options_.compress)
      write_compressed(file, compress_figure(figure_, morphs, tracks));
    else if (options_.glb)
      write_glb(folder_ / "animation.glb", file, figure_, morphs, tracks);
    if (options_.fbx) write_with_angles(file, morphs, tracks);
    if (options_.usda) write_usda_skel(folder_ / "animation_skel.usda", file, figure_, morphs, tracks, "animation.png");
  }

  void write_compressed(FigureFile file, const CompressedFigure& packed) {
    report_.compression = packed.error;
    const FigureError error = figure_error(packed.figure, clip_, packed.morphs, packed.tracks);
    report_.mean_error_mm = error.mean;
    report_.worst_error_mm = error.worst;
    file.compression = packed.steps;
    write_glb(folder_ / "animation.glb", file, packed.figure, packed.morphs, packed.tracks);
  }

  void write_with_angles(const FigureFile& file, const MorphTargets& morphs, const FigureTracks& tracks) {
    const auto turns = euler_tracks(figure_, tracks, options_.tolerance);
    std::size_t keys = tracks.num_keys();
    for (std::size_t i = 0; i < turns.size(); ++i) keys += turns[i].frames.size() - tracks.rotation_keys[i].size();
    fbx_report_ = report_of(morphs, with_euler_rotations(figure_, tracks, turns), keys);
    write_fbx(folder_ / "animation.fbx", file, figure_, morphs, tracks, turns);
  }

  FigureReport report_of(const MorphTargets& morphs, const FigureTracks& tracks, std::size_t keys) const {
    const FigureError error = figure_error(figure_, clip_, morphs, tracks);
    FigureReport report;
    report.nodes = static_cast<int>(figure_.nodes.size());
    report.morphs = morphs.count();
    report.morphs_at_once = morphs.at_once;
    report.morphs_exhausted = morphs.exhausted;
    report.keys = keys;
    report.mean_error_mm = error.mean;
    report.worst_error_mm = error.worst;
    report.largest_dropped_weight = figure_.largest_dropped_weight;
    return report;
  }

  std::filesystem::path folder_;
  const Character& character_;
  FigureOptions options_;
  FigureReport &report_, &fbx_report_;
  Figure figure_;
  FigureClip clip_;
};

}  // namespace

void append_frame(FigureClip& clip, const PosedFrame& frame) {
  const torch::Tensor pose = frame.window[frame.window.size(0) - 1].to(torch::kFloat64).contiguous();
  clip.dofs.emplace_back(pose.data_ptr<double>(), pose.data_ptr<double>() + pose.numel());
  clip.vertices.emplace_back(frame.vertices.begin(), frame.vertices.end());
}

std::unique_ptr<SequenceWriter> make_figure_writer(const std::filesystem::path& folder, const Character& character,
                                                   const FigureOptions& options, FigureReport& report,
                                                   FigureReport& fbx_report) {
  return std::make_unique<FigureWriter>(folder, character, options, report, fbx_report);
}

}  // namespace doppel
