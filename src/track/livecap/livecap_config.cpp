#include "doppel/track/livecap/livecap_config.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/track/fit/thesis_units.h"

namespace doppel {
namespace {

constexpr ConfigUnits kThesisUnits{"pixels of an image 540 wide", "squared millimetre", per_squared_thesis_pixel,
                                   thesis_pixels, per_squared_millimetre};
const Range<double> kWeights = between(0.0, kMaxWeight);

void describe_photometric(const Keys& keys, NonrigidOptions& surface) {
  keys("weight", surface.photometric_weight, kWeights,
       "colour of a vertex to that of the image, per squared difference");
  keys("threshold", surface.colour_threshold, between(0.0, 2.0), "a vertex with a larger colour difference is ignored");
  keys("kernels", surface.blur_kernels, "sizes of the blur kernels, pixels, odd; one Gauss-Newton step for each");
  const auto usable = [](int size) { return size >= 1 && size <= 255 && size % 2 == 1; };
  const auto& kernels = surface.blur_kernels;
  keys.require("kernels", std::all_of(kernels.begin(), kernels.end(), usable),
               fmt::format("the kernels are [{}] pixels; each must be odd, 1 to 255", fmt::join(kernels, ", ")));
  keys.require("kernels", !kernels.empty(), "the list of kernels is empty; each gives a step");
  keys("halve_levels", surface.halve_levels, "halve the image with each coarser level before the blur");
  keys("match_exposure", surface.match_exposure, "scale the vertex colours to the brightness of the image first");
}

void describe_outline(const Keys& keys, NonrigidOptions& surface) {
  keys("weight", surface.silhouette_weight, kWeights, "outline vertices to the outline of the mask, per squared pixel",
       per_squared_thesis_pixel);
  keys("scale", surface.silhouette_scale, between(0.0, 1e6),
       "scale of the Geman-McClure kernel, pixels of an image 540 wide; 0: squared distances", thesis_pixels);
  keys("own_distance", surface.own_distance,
       "subtract from a vertex's distance to the outline of the mask its distance to that of the drawn surface; false: "
       "the first alone, as in 4.10 and 4.6.6");
  keys("parts", surface.part_mask, "ignore vertices that project onto another body part");
  keys("growth", surface.part_growth, between(0.0, 1000.0),
       "by which the masks of body parts are grown, pixels of an image 540 wide", thesis_pixels);
  keys("pixels", surface.window_pixels, between(16, 4096), "side of the window for outline and visibility");
}

void describe_surface(const Keys& keys, LivecapOptions& fit) {
  NonrigidOptions& surface = fit.nonrigid;
  keys("enabled", fit.surface, "false: the surface is the skinned template");
  describe_photometric(keys.section("photometric"), surface);
  describe_outline(keys.section("silhouette"), surface);
  keys("smoothness.weight", surface.smoothness_weight, kWeights, "edges to the skinned edges, per squared millimetre",
       per_squared_millimetre);
  keys("length.weight", surface.length_weight, kWeights,
       "edge lengths to those of the template, per squared millimetre", per_squared_millimetre);
  keys("velocity.weight", surface.velocity_weight, kWeights, "vertices to the last surface, per squared millimetre",
       per_squared_millimetre);
  keys("acceleration.weight", surface.acceleration_weight, kWeights,
       "vertices to the extrapolation of the last two surfaces, per squared millimetre", per_squared_millimetre);
  keys("carry", surface.carry, "the last surfaces move with the pose; false: they stay in the world");
  keys("skinned.weight", surface.skinned_weight, kWeights, "vertices to the skinned template, per squared millimetre",
       per_squared_millimetre);
  keys("materials", surface.materials, "rigidity by the labels of the character (Table 4.1)");
  keys("rigidity", surface.rigidity, between(0.0, 1e6), "of every vertex, with `materials: false`");
  keys("warp", surface.warp_displacements, "start from the displacements of the last frame");
  keys("snap", surface.snap, "move outline vertices onto the outline of the mask at the end");
  keys("snap_max_rigidity", surface.snapping.max_rigidity, between(0.0, 1e6),
       "largest rigidity of a vertex that is snapped");
  keys("snap_first_share", surface.snapping.first_share, between(0.0, 1.0),
       "share of the motion for a vertex that was not on the outline in the last frame");
  keys("max_isolated_motion", surface.max_isolated_motion, between(0.0, 1e6),
       "largest ratio of the motion of a vertex to the mean of its neighbours; 0: no limit");
  keys("conjugate_gradients", surface.conjugate_gradients, between(1, 10000), "iterations of each Gauss-Newton step");
}

void describe_pose(const Keys& keys, LivecapOptions& fit) {
  describe_pose_fit(keys, fit, kThesisUnits);
  keys("keypoints.faces", fit.faces, "false: keypoints of the face do not count");
  keys("keypoints.confidence", fit.ignore_confidence, {"weigh", "ignore"},
       "keypoints count by their confidence, or equally, as in 4.3");
  keys("keypoints.min_confidence", fit.min_confidence, between(0.0, 1.0),
       "keypoints with a lower confidence do not count in the fit; 0: all that were detected, as in 4.3");
  keys("silhouette.remove_depth", fit.remove_depth,
       "fit the pose with displacements that do not move the outline towards the camera or away from it");
  keys("silhouette.level", fit.level_silhouette, "the mean distance between the outlines of template and mask is free");
  keys("silhouette.own_distance", fit.own_distance,
       "subtract from a vertex's distance to the outline of the mask its distance to that of the drawn surface; false: "
       "the first alone, as in 4.5");
  keys("joints.weight", fit.joint_weight, kWeights,
       "landmarks to 3D joints with an error of 25 mm, per squared millimetre", per_squared_millimetre);
  keys("motion.turn", fit.motion.turn_weight, kWeights,
       "inverse variance of the change of a velocity from frame to frame, per squared radian; 0: no filter");
  keys("motion.shift", fit.motion.shift_weight, between(1e-3, kMaxWeight),
       "the same of the position, per squared metre");
  keys("usual.weight", fit.usual_weight, kWeights, "of the squared distance from the poses of `--prior-motion`");
  keys("usual.spread", fit.usual_spread, between(1e-3, 10.0),
       "added to the standard deviations of these poses, radians");
  keys("floor.weight", fit.floor_weight, kWeights, "height of standing feet above the floor, per squared millimetre",
       per_squared_millimetre);
  keys("floor.slide", fit.floor_slide, between(0.0, 1e6), "weight of their sliding, relative to that of their height");
  keys("floor.scale", fit.floor_scale, between(0.0, 1e6), "scale of the Geman-McClure kernel, millimetres",
       millimetres);
  keys("start.iterations", fit.start_iterations, between(1, 10000),
       "largest number of steps from a start pose, for a frame without a history");
}

}  // namespace

void describe_keys(const Keys& keys, LivecapConfig& config) {
  describe_pose(keys, config.fit);
  describe_keys(keys, config.dofs);
  keys("smoothing", config.smoothing, between(0.0, 1000.0), "sigma of the smoothing of poses, frames; 0: none");
  keys("filter", config.filter, "average written vertices with the frames before and after, weights 0.15, 0.7, 0.15");
  describe_surface(keys.section("surface"), config.fit);
}

LivecapConfig read_livecap_config(const ConfigDocument& document) {
  LivecapConfig config;
  const ConfigReader root = document.root();
  read_keys(root, config);
  root.finish();
  return config;
}

}  // namespace doppel
