#include "doppel/track/livecap/livecap_config.h"

#include "doppel/track/fit/config_terms.h"
#include "doppel/track/fit/thesis_units.h"

namespace doppel {
namespace {

constexpr ConfigUnits kThesisUnits{per_squared_thesis_pixel, thesis_pixels, per_squared_millimetre};

void read_photometric(const ConfigReader& reader, NonrigidOptions& surface) {
  surface.photometric_weight = reader.get("weight", surface.photometric_weight, between(0.0, 1e12));
  surface.colour_threshold = reader.get("threshold", surface.colour_threshold, between(0.0, 2.0));
  surface.halve_levels = reader.get("halve_levels", surface.halve_levels);
  surface.match_exposure = reader.get("match_exposure", surface.match_exposure);
  const std::vector<int> kernels = reader.list<int>("kernels");
  if (reader.has("kernels")) surface.blur_kernels = kernels;
  for (const int size : surface.blur_kernels)
    if (size < 1 || size > 255 || size % 2 == 0)
      reader.fail_at_key("kernels", "a kernel is {} pixels; it must be odd, 1 to 255", size);
  if (surface.blur_kernels.empty()) reader.fail_at_key("kernels", "the list of kernels is empty; each gives a step");
}

void read_surface(const ConfigReader& reader, LivecapOptions& fit) {
  NonrigidOptions& surface = fit.nonrigid;
  fit.surface = reader.get("enabled", fit.surface);
  read_photometric(reader.section("photometric"), surface);
  read_image_term(reader, "silhouette", surface.silhouette_weight, surface.silhouette_scale, kThesisUnits);
  const ConfigReader silhouette = reader.section("silhouette");
  surface.part_mask = silhouette.get("parts", surface.part_mask);
  read_number(silhouette, "growth", surface.part_growth, between(0.0, 1000.0), thesis_pixels);
  surface.window_pixels = silhouette.get("pixels", surface.window_pixels, between(16, 4096));
  read_weight(reader, "smoothness", surface.smoothness_weight, per_squared_millimetre);
  read_weight(reader, "length", surface.length_weight, per_squared_millimetre);
  read_weight(reader, "velocity", surface.velocity_weight, per_squared_millimetre);
  read_weight(reader, "acceleration", surface.acceleration_weight, per_squared_millimetre);
  surface.carry = reader.get("carry", surface.carry);
  read_weight(reader, "skinned", surface.skinned_weight, per_squared_millimetre);
  surface.materials = reader.get("materials", surface.materials);
  surface.rigidity = reader.get("rigidity", surface.rigidity, between(0.0, 1e6));
  surface.warp_displacements = reader.get("warp", surface.warp_displacements);
  surface.snap = reader.get("snap", surface.snap);
  surface.snapping.max_rigidity = reader.get("snap_max_rigidity", surface.snapping.max_rigidity, between(0.0, 1e6));
  surface.snapping.first_share = reader.get("snap_first_share", surface.snapping.first_share, between(0.0, 1.0));
  reader.renamed("lonely_motion", "max_isolated_motion");
  surface.max_isolated_motion = reader.get("max_isolated_motion", surface.max_isolated_motion, between(0.0, 1e6));
  surface.conjugate_gradients = reader.get("conjugate_gradients", surface.conjugate_gradients, between(1, 10000));
}

}  // namespace

LivecapConfig read_livecap_config(const ConfigDocument& document) {
  LivecapConfig config;
  LivecapOptions& fit = config.fit;
  const ConfigReader root = document.root();
  read_pose_fit(root, fit, kThesisUnits);
  fit.faces = root.section("keypoints").get("faces", fit.faces);
  fit.remove_depth = root.section("silhouette").get("remove_depth", fit.remove_depth);
  fit.level_silhouette = root.section("silhouette").get("level", fit.level_silhouette);
  read_weight(root, "joints", fit.joint_weight, per_squared_millimetre);
  const ConfigReader motion = root.section("motion");
  fit.motion.turn_weight = motion.get("turn", fit.motion.turn_weight, between(0.0, 1e12));
  fit.motion.shift_weight = motion.get("shift", fit.motion.shift_weight, between(1e-3, 1e12));
  const ConfigReader usual = root.section("usual");
  fit.usual_weight = usual.get("weight", fit.usual_weight, between(0.0, 1e12));
  fit.usual_spread = usual.get("spread", fit.usual_spread, between(1e-3, 10.0));
  read_weight(root, "floor", fit.floor_weight, per_squared_millimetre);
  const ConfigReader floor = root.section("floor");
  fit.floor_slide = floor.get("slide", fit.floor_slide, between(0.0, 1e6));
  fit.floor_scale = 1e-3 * floor.get("scale", 1e3 * fit.floor_scale, between(0.0, 1e6));
  fit.start_iterations = root.section("start").get("iterations", fit.start_iterations, between(1, 10000));
  read_surface(root.section("surface"), fit);
  config.dofs = DofChoice::read(root);
  config.smoothing = root.get("smoothing", config.smoothing, between(0.0, 1000.0));
  config.filter = root.get("filter", config.filter);
  root.finish();
  return config;
}

}  // namespace doppel
