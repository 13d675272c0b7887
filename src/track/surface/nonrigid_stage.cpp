#include "doppel/track/surface/nonrigid_stage.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "doppel/track/surface/colour_pyramid.h"
#include "doppel/track/surface/edge_weights.h"
#include "doppel/track/surface/length_term.h"
#include "doppel/track/surface/outline_term.h"
#include "doppel/track/surface/photometric_term.h"
#include "doppel/track/surface/smoothness_term.h"
#include "doppel/track/surface/surface_problem.h"
#include "doppel/track/surface/surface_viewer.h"
#include "doppel/track/surface/target_term.h"
#include "doppel/track/surface/vertex_colours.h"

namespace doppel {
namespace {

using Eigen::Matrix3Xd;

// Gauss-Newton: almost no initial damping. It is raised only for a step that would not lower the cost.
constexpr double kDamping = 1e-6;

void check(const NonrigidOptions& o) {
  const std::pair<const char*, double> numbers[] = {{"photometric weight", o.photometric_weight},
                                                    {"colour threshold", o.colour_threshold},
                                                    {"silhouette weight", o.silhouette_weight},
                                                    {"silhouette scale", o.silhouette_scale},
                                                    {"largest rigidity of a snapped vertex", o.snapping.max_rigidity},
                                                    {"first share of snapping", o.snapping.first_share},
                                                    {"part growth", o.part_growth},
                                                    {"smoothness weight", o.smoothness_weight},
                                                    {"length weight", o.length_weight},
                                                    {"rigidity", o.rigidity},
                                                    {"velocity weight", o.velocity_weight},
                                                    {"acceleration weight", o.acceleration_weight},
                                                    {"skinned weight", o.skinned_weight},
                                                    {"largest isolated motion", o.max_isolated_motion}};
  for (const auto& [name, value] : numbers)
    if (!(value >= 0.0) || !std::isfinite(value))
      fail("the {} of the non-rigid stage is {}; it must be 0 or more", name, value);
  if (o.conjugate_gradients < 1 || o.window_pixels < 16)
    fail("the non-rigid stage needs at least 1 iteration of conjugate gradients and a window of at least 16 pixels");
  if (o.blur_kernels.empty()) fail("the non-rigid stage needs at least one level of the pyramid");
  for (const int size : o.blur_kernels)
    if (size < 1 || size % 2 == 0) fail("a kernel of the pyramid is {} pixels; it must be odd", size);
}

std::vector<double> rest_lengths(const TriangleMesh& mesh, const std::vector<Link>& edges) {
  std::vector<double> lengths;
  lengths.reserve(edges.size());
  for (const auto& [a, b] : edges) lengths.push_back((mesh.vertices[a] - mesh.vertices[b]).norm());
  return lengths;
}

std::vector<double> rigidity_of(const Character& character, const NonrigidOptions& options) {
  if (options.materials) return vertex_rigidity(character.labels, character.num_vertices(), RigidityPreset::livecap);
  return std::vector<double>(character.num_vertices(), options.rigidity);
}

/// The energy of one frame with the data of its terms.
struct FrameEnergy {
  SurfaceView view;
  ColourPyramid pyramid;
  Matrix3Xd colours, expected;
  std::vector<Matrix3Xd> last;  ///< up to two surfaces, newest first
  std::vector<std::unique_ptr<SurfaceTerm>> terms;
  PhotometricTerm* photometric = nullptr;  ///< one of the terms, or null

  template <typename Term, typename... Args>
  Term* add(double weight, Args&&... args) {
    if (weight == 0.0) return nullptr;
    auto term = std::make_unique<Term>(std::forward<Args>(args)...);
    Term* added = term.get();
    terms.push_back(std::move(term));
    return added;
  }
};

/// The part of the image that a surface covers, with a margin for its motion.
cv::Rect window_around(const Matrix3Xd& vertices, const PinholeCamera& camera) {
  constexpr double kAround = 24.0;  // pixels: 7 for the blur kernels, the rest for the motion of vertices
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9), high = -low;
  for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
    const auto projected = project_with_jacobian(camera, vertices.col(i));
    if (!projected) continue;
    low = low.min(projected->pixel.array());
    high = high.max(projected->pixel.array());
  }
  const Eigen::Array2d size(camera.width, camera.height);
  low = (low - kAround).max(0.0).min(size);
  high = (high + kAround).max(0.0).min(size);
  return {static_cast<int>(low.x()), static_cast<int>(low.y()), static_cast<int>((high - low).max(0.0).x()),
          static_cast<int>((high - low).max(0.0).y())};
}

/// Scales the template's colours to the brightness of the image: one factor per channel, from the visible vertices.
Matrix3Xd as_bright_as_image(const Matrix3Xd& colours, const FrameEnergy& energy, const PinholeCamera& camera,
                             const Matrix3Xd& vertices) {
  Eigen::Vector3d seen = Eigen::Vector3d::Zero(), own = Eigen::Vector3d::Zero();
  ColourPyramid::Sample sample;
  for (Eigen::Index i = 0; i < colours.cols(); ++i) {
    if (!energy.view.visible[i]) continue;
    const auto projected = project_with_jacobian(camera, vertices.col(i));
    if (!projected || !energy.pyramid.at(0, projected->pixel, sample)) continue;
    seen += sample.colour.cwiseProduct(colours.col(i));
    own += colours.col(i).cwiseAbs2();
  }
  Eigen::Vector3d gain = Eigen::Vector3d::Ones();
  for (int c = 0; c < 3; ++c)
    if (own[c] > 0.0) gain[c] = seen[c] / own[c];
  return gain.asDiagonal() * colours;
}

}  // namespace

struct NonrigidStage::State {
  const Character& character;
  const PinholeCamera& camera;
  NonrigidOptions options;
  MeshTopology topology;
  std::vector<double> rigidity;                  // [N]
  std::vector<double> edge_weight, rest_length;  // [edges]
  Matrix3Xd colours;                             // [3,N], or none
  SurfaceViewer viewer;
  SurfaceProblem problem;
  // Up to two surfaces, newest first; with `carry` their displacements in the rest pose.
  std::vector<Matrix3Xd> history;
  std::vector<Eigen::Vector3d> displacements;  // [N] of the last frame, in the rest pose
  std::vector<char> was_outline;               // [N] in the last frame; empty without a last frame

  State(const Character& character_in, const PinholeCamera& camera_in, const NonrigidOptions& options_in)
      : character(character_in),
        camera(camera_in),
        options(options_in),
        topology(character.mesh),
        rigidity(rigidity_of(character, options)),
        edge_weight(edge_weights(topology, rigidity)),
        rest_length(rest_lengths(character.mesh, topology.edges())),
        colours(vertex_colours(character.mesh)),
        viewer(character, camera, options.window_pixels),
        problem(character.num_vertices(), topology.edges(), options.conjugate_gradients),
        displacements(character.mesh.vertices.size(), Eigen::Vector3d::Zero()) {}

  PosedSurface start(const PosedSurface& posed) const {
    PosedSurface surface = posed;
    for (std::size_t i = 0; i < displacements.size(); ++i)
      surface.vertices.col(static_cast<Eigen::Index>(i)) += posed.turns[i] * displacements[i];
    return surface;
  }

  std::vector<Matrix3Xd> last_surfaces(const PosedSurface& posed) const {
    std::vector<Matrix3Xd> last = history;
    for (Matrix3Xd& surface : last)
      for (Eigen::Index i = 0; options.carry && i < surface.cols(); ++i)
        surface.col(i) = posed.vertices.col(i) + posed.turns[i] * surface.col(i);
    return last;
  }

  void add_regularisers(FrameEnergy& energy, const PosedSurface& posed) const {
    const NonrigidOptions& o = options;
    energy.add<SmoothnessTerm>(o.smoothness_weight, posed.vertices, topology.edges(), edge_weight, o.smoothness_weight);
    energy.add<LengthTerm>(o.length_weight, topology.edges(), edge_weight, rest_length, o.length_weight);
    energy.add<TargetTerm>(o.skinned_weight, "skinned", posed.vertices, o.skinned_weight);
    energy.last = last_surfaces(posed);
    const std::vector<Matrix3Xd>& last = energy.last;
    if (!last.empty()) energy.add<TargetTerm>(o.velocity_weight, "velocity", last[0], o.velocity_weight);
    if (last.size() < 2) return;
    energy.expected = 2.0 * last[0] - last[1];
    energy.add<TargetTerm>(o.acceleration_weight, "acceleration", energy.expected, o.acceleration_weight);
  }

  OutlineTerm::Evidence evidence(const FrameEnergy& energy, const PosedSurface& start,
                                 const OutlineField& outline) const {
    return {camera, outline, energy.view.parts, viewer.vertex_parts(), start.normals};
  }

  void add_data_terms(FrameEnergy& energy, const PosedSurface& start, const OutlineField& outline,
                      const cv::Mat& image) {
    const NonrigidOptions& o = options;
    const CropBox& box = outline.box();
    energy.view = viewer.look(start, box, o.part_growth / reference_pixels(camera));
    if (!o.part_mask) energy.view.parts = PartMask();
    if (!o.own_distance) drop_own_distances(energy.view.outline);
    energy.add<OutlineTerm>(o.silhouette_weight, evidence(energy, start, outline), energy.view.outline,
                            o.silhouette_weight, o.silhouette_scale);
    if (o.photometric_weight == 0.0 || image.empty() || colours.cols() == 0) return;
    energy.pyramid = ColourPyramid(image, window_around(start.vertices, camera), o.blur_kernels, o.halve_levels);
    if (energy.pyramid.num_levels() == 0) return;
    energy.colours = o.match_exposure ? as_bright_as_image(colours, energy, camera, start.vertices) : colours;
    energy.photometric = energy.add<PhotometricTerm>(o.photometric_weight, camera, energy.pyramid, energy.view.visible,
                                                     energy.colours, o.photometric_weight, o.colour_threshold);
  }

  /// Takes a Gauss-Newton step on each level of the pyramid.
  NonrigidSurface minimised(const FrameEnergy& energy, const Matrix3Xd& start) {
    SolverOptions solver;
    solver.iterations = 1;
    solver.initial_damping = kDamping;
    std::vector<SurfaceTerm*> terms;
    for (const auto& term : energy.terms) terms.push_back(term.get());
    Eigen::VectorXd vertices = Eigen::Map<const Eigen::VectorXd>(start.data(), start.size());
    NonrigidSurface result;
    for (int level = 0; level < static_cast<int>(options.blur_kernels.size()); ++level) {
      if (energy.photometric) energy.photometric->set_level(level);
      problem.set_terms(terms);
      result.terms = minimise(problem, vertices, solver).terms;
    }
    result.vertices = Eigen::Map<const Matrix3Xd>(vertices.data(), 3, start.cols());
    result.outline_vertices = static_cast<int>(energy.view.outline.size());
    if (energy.photometric) result.coloured_vertices = energy.photometric->num_used();
    return result;
  }

  /// Snaps the outline and clamps isolated motion.
  void finish(NonrigidSurface& surface, const FrameEnergy& energy, const PosedSurface& start,
              const OutlineField& outline) {
    if (options.snap) {
      snap_outline(surface.vertices, evidence(energy, start, outline), energy.view.outline, topology, rigidity,
                   was_outline, options.snapping);
      was_outline.assign(rigidity.size(), 0);
      for (const OutlineVertex& vertex : energy.view.outline) was_outline[vertex.vertex] = 1;
    }
    if (options.max_isolated_motion > 0.0 && !energy.last.empty())
      clamp_isolated_motion(surface.vertices, energy.last[0], topology, options.max_isolated_motion);
  }

  void remember(const PosedSurface& posed, const Matrix3Xd& vertices) {
    Matrix3Xd moved(3, vertices.cols());
    for (Eigen::Index i = 0; i < vertices.cols(); ++i)
      moved.col(i) = posed.turns[i].transpose() * (vertices.col(i) - posed.vertices.col(i));
    for (std::size_t i = 0; options.warp_displacements && i < displacements.size(); ++i)
      displacements[i] = moved.col(static_cast<Eigen::Index>(i));
    history.insert(history.begin(), options.carry ? std::move(moved) : vertices);
    if (history.size() > 2) history.pop_back();
  }
};

NonrigidStage::NonrigidStage(const Character& character, const PinholeCamera& camera, const NonrigidOptions& options) {
  check(options);
  state_ = std::make_unique<State>(character, camera, options);
}
NonrigidStage::~NonrigidStage() = default;

void NonrigidStage::cut() {
  state_->history.clear();
  state_->was_outline.clear();
  std::fill(state_->displacements.begin(), state_->displacements.end(), Eigen::Vector3d::Zero());
}

std::vector<Eigen::Vector3d> NonrigidStage::rest_vertices() const {
  std::vector<Eigen::Vector3d> vertices = state_->character.mesh.vertices;
  for (std::size_t i = 0; i < vertices.size(); ++i) vertices[i] += state_->displacements[i];
  return vertices;
}

NonrigidSurface NonrigidStage::fit(const PosedSurface& posed, const OutlineField& outline, const cv::Mat& image) {
  const PosedSurface start = state_->start(posed);
  FrameEnergy energy;
  state_->add_data_terms(energy, start, outline, image);
  state_->add_regularisers(energy, posed);
  NonrigidSurface result = state_->minimised(energy, start.vertices);
  state_->finish(result, energy, start, outline);
  state_->remember(posed, result.vertices);
  return result;
}

}  // namespace doppel
