#include "doppel/rigging/body/girth_solver.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/body/proportions.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// The measures that need corrections. A girth of the trunk follows its breadth by about two thirds, because its depth
/// has a measure of its own.
struct Served {
  const char* measure;
  Factor factor;
  double exponent;
};
constexpr std::array<Served, 15> kServed{{{"head_breadth", kHeadBreadth, 1.0},
                                          {"head_depth", kHeadDepth, 1.0},
                                          {"neck_girth", kNeckGirth, 1.0},
                                          {"chest_girth", kChestBreadth, 1.35},
                                          {"chest_depth", kChestDepth, 1.0},
                                          {"waist_girth", kWaistBreadth, 1.35},
                                          {"belly_depth", kWaistDepth, 1.0},
                                          {"hip_girth", kHipGirth, 1.0},
                                          {"upper_arm_girth", kUpperArmGirth, 1.0},
                                          {"forearm_girth", kForearmGirth, 1.0},
                                          {"wrist_girth", kWristGirth, 1.0},
                                          {"thigh_girth", kThighGirth, 1.0},
                                          {"knee_girth", kKneeGirth, 1.0},
                                          {"calf_girth", kCalfGirth, 1.0},
                                          {"ankle_girth", kAnkleGirth, 1.0}}};

/// The first and the last point of a loop in a direction.
SurfaceLoop outermost(const SurfaceLoop& loop, const std::vector<Vector3d>& vertices, const Vector3d& direction) {
  const auto [low, high] = std::minmax_element(loop.begin(), loop.end(), [&](const EdgePoint& p, const EdgePoint& q) {
    return p.on(vertices).dot(direction) < q.on(vertices).dot(direction);
  });
  return {*low, *high};
}

}  // namespace

GirthSolver::GirthSolver(const TriangleMesh& mesh, const std::vector<SegmentWeights>& weights, const BodyWarp& warp)
    : warp_(warp), reference_(measure_body(mesh, warp.reference())) {
  std::map<int, int> position;  // of a vertex among those that are kept
  const auto keep = [&](int vertex) {
    const auto [entry, added] = position.emplace(vertex, static_cast<int>(vertices_.size()));
    if (added) {
      vertices_.push_back(mesh.vertices[vertex]);
      weights_.push_back(weights[vertex]);
    }
    return entry->second;
  };
  for (const GirthLevel& level : girth_levels(warp.reference())) {
    const auto served = std::find_if(kServed.begin(), kServed.end(),
                                     [&](const Served& s) { return measure_index(s.measure) == level.measure; });
    if (served == kServed.end()) continue;
    const bool is_girth = level.direction.isZero();
    SurfaceLoop points = nearest_section(mesh, level.origin, level.normal);
    if (!is_girth) points = outermost(points, mesh.vertices, level.direction);
    for (EdgePoint& point : points) point = {keep(point.a), keep(point.b), point.share};
    gauges_.push_back({level.measure, points, level.direction, served->factor, served->exponent});
  }
}

BodyFactors GirthSolver::factors(std::span<const double> measures) const {
  constexpr int kRounds = 10;
  BodyFactors factors = proportional_factors(measures, reference_);
  std::vector<Vector3d> moved(vertices_.size());
  for (int round = 0; round < kRounds; ++round) {
    const BodyWarp::Map map = warp_.map(factors);
    for (std::size_t v = 0; v < moved.size(); ++v) moved[v] = map.point(vertices_[v], weights_[v]);
    for (const Gauge& gauge : gauges_) {
      const double found = gauge.direction.isZero()
                               ? loop_length(gauge.points, moved)
                               : (gauge.points[1].on(moved) - gauge.points[0].on(moved)).dot(gauge.direction);
      factors[gauge.factor] *= std::pow(measures[gauge.measure] / found, gauge.exponent);
    }
  }
  return factors;
}

}  // namespace doppel
