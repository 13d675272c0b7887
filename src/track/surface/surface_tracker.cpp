#include "doppel/track/surface/surface_tracker.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/track/energy/terms/arap_term.h"
#include "doppel/track/energy/terms/contour_term.h"
#include "doppel/track/energy/terms/keypoint_term.h"
#include "doppel/track/energy/terms/node_term.h"
#include "doppel/track/energy/terms/silhouette_term.h"

namespace doppel {
namespace {

void check(const SurfaceOptions& o) {
  const std::pair<const char*, double> weights[] = {
      {"keypoints", o.keypoint_weight}, {"silhouette", o.silhouette_weight}, {"contour", o.contour_weight},
      {"arap", o.arap_weight},          {"temporal", o.temporal_weight},     {"rest", o.rest_weight}};
  for (const auto& [name, weight] : weights)
    if (!(weight >= 0.0) || !std::isfinite(weight))
      fail("the weight of {} in the surface fit is {}; it must be 0 or more", name, weight);
  if (!(o.keypoint_scale >= 0.0) || !(o.silhouette_scale >= 0.0))
    fail("the scales of the surface fit are {} and {}; they must be 0 or more", o.keypoint_scale, o.silhouette_scale);
}

}  // namespace

SurfaceTracker::SurfaceTracker(const Character& character, const std::vector<Marker>& landmarks,
                               std::vector<PinholeCamera> cameras, const SurfaceOptions& options)
    : model_(character, landmarks),
      cameras_(std::move(cameras)),
      options_(options),
      outlines_(character, cameras_, options.outline_vertices) {
  check(options);
}

FitProblem<GraphModel>::Terms SurfaceTracker::terms(const FrameEvidence& frame,
                                                    const std::vector<OutlineVertex>& outline) const {
  const SurfaceOptions& o = options_;
  const auto kernel = RobustKernel::geman_mcclure_of;
  FitProblem<GraphModel>::Terms result;
  if (o.keypoint_weight > 0.0)
    result.push_back(
        std::make_unique<KeypointTerm<GraphModel>>(cameras_, frame, o.keypoint_weight, kernel(o.keypoint_scale)));
  if (o.silhouette_weight > 0.0)
    result.push_back(std::make_unique<SilhouetteTerm<GraphModel>>(cameras_, frame, outline, o.silhouette_weight, 1.0,
                                                                  kernel(o.silhouette_scale)));
  if (o.contour_weight > 0.0)
    result.push_back(std::make_unique<ContourTerm<GraphModel>>(
        cameras_, frame, outline, o.outline_vertices, o.contour_reach, o.contour_weight, kernel(o.silhouette_scale)));
  if (o.arap_weight > 0.0) result.push_back(std::make_unique<ArapTerm>(model_, o.arap_weight));
  if (last_ && o.temporal_weight > 0.0)
    result.push_back(std::make_unique<NodeTerm>("temporal", model_, *last_, o.temporal_weight));
  if (o.rest_weight > 0.0)
    result.push_back(std::make_unique<NodeTerm>("rest", model_, model_.undeformed(), o.rest_weight));
  return result;
}

SurfaceFrame SurfaceTracker::track(const FrameEvidence& frame, const std::vector<double>& dofs) {
  model_.set_pose(dofs);
  const auto surface = [&](const std::vector<double>& parameters) {
    return deformed_vertices(model_, model_.pose(parameters, false));
  };
  SurfaceFrame result;
  result.posed_overlap = outlines_.overlap(frame, surface(model_.undeformed()));
  result.parameters = last_.value_or(model_.undeformed());
  for (int round = 0; round < options_.rounds; ++round) {
    const std::vector<OutlineVertex> outline = outlines_.find(frame, surface(result.parameters));
    if (outline.empty()) break;  // no mask shows a person
    const SolverSummary summary = fit(model_, terms(frame, outline), result.parameters, options_.solver);
    result.iterations += summary.iterations;
    result.terms = summary.terms;
    result.reason = summary.reason;
  }
  result.overlap = outlines_.overlap(frame, surface(result.parameters));
  last_ = result.parameters;
  return result;
}

}  // namespace doppel
