#include "doppel/core/atomic_file.h"
#include "doppel/io/figure_export/fbx_curves.h"
#include "doppel/io/figure_export/fbx_skeleton.h"
#include "doppel/io/figure_export/fbx_surface.h"
#include "doppel/io/figure_export/write_figure.h"

namespace doppel {
namespace {

std::int64_t add_surface_model(FbxDocument& document, const std::string& name) {
  const FbxNode properties = properties70({property70("InheritType", "enum", "", "", {1})});
  const std::int64_t model = document.add("Model", name, "Model", "Mesh",
                                          {{"Version", {232}, {}}, properties, {"Culling", {"CullingOff"}, {}}});
  document.connect(model, 0);
  return model;
}

}  // namespace

void write_fbx(const std::filesystem::path& path, const FigureFile& file, const Figure& figure,
               const MorphTargets& morphs, const FigureTracks& tracks, const std::vector<EulerTrack>& turns) {
  FbxDocument document;
  const std::int64_t geometry = add_fbx_geometry(document, file, figure);
  const std::int64_t surface = add_surface_model(document, file.name);
  document.connect(geometry, surface);
  document.connect(add_fbx_material(document, file, path.stem().string() + ".png"), surface);
  FbxMoved moved;
  moved.channels = add_fbx_shapes(document, geometry, file, morphs);
  moved.bones = add_fbx_bones(document, figure);
  add_fbx_skin(document, figure, file.name, moved.bones, geometry);
  add_fbx_bind_pose(document, figure, file.name, moved.bones, surface);
  const int frames = file.clip.num_frames();
  const FbxClock clock{file.clip.frames_per_second, frames > 0 ? frames - 1 : 0};
  if (frames > 0) add_fbx_animation(document, moved, tracks, turns, clock, file.name);
  write_atomically(path, fbx_binary(document.root(clock, frames > 0 ? file.name : ""), 7400, /*compressed=*/true));
}

}  // namespace doppel
