#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include "doppel/core/as_size.h"
#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/rest_displacements.h"

namespace doppel {
namespace {

constexpr int kSnapshots = 512;
/// A group of frames with a larger error is divided: metres.
constexpr double kMaxError = 0.005;
constexpr int kMaxTargets = 256;
/// Targets that move at once, where the clip is near enough with them.
constexpr int kUsualCount = 8;
constexpr std::size_t kFramesAtOnce = 32;
/// Conjugate gradients: at most so many steps, and a squared gradient (metres^2) that needs none.
constexpr int kSteps = 8;
constexpr float kSmallGradient = 1e-12F;

Eigen::Vector3d vertex_of(const std::vector<float>& vertices, std::size_t v) {
  return {vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]};
}

/// Frames that may share targets. Vectors have an entry for each number of targets that may move at once.
struct Group {
  std::vector<int> frames;
  std::vector<int> targets;                       ///< that the group needs
  std::vector<double> worst;                      ///< distance of a vertex, metres
  std::array<std::vector<int>, 2> halves;         ///< on either side of the mean along the largest component
  std::array<std::unique_ptr<Group>, 2> divided;  ///< the groups of the halves, once they are asked for

  /// Whether a division can bring it nearer.
  bool is_far(std::size_t choice) const {
    return worst[choice] > kMaxError && targets[choice] < static_cast<int>(frames.size()) && !halves[0].empty() &&
           !halves[1].empty();
  }
};

class GroupFit {
 public:
  GroupFit(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip)
      : figure_(figure), skeleton_(skeleton), clip_(clip) {}

  /// @param counts rising numbers of targets
  Group fit(std::vector<int> frames, const std::vector<int>& counts) const {
    Group group;
    group.frames = std::move(frames);
    const LinearShapes basis =
        basis_of(group.frames, std::max(counts.back(), 2));  // one component says where to divide
    for (const int count : counts)
      group.targets.push_back(1 + std::min(count - 1, static_cast<int>(basis.components.cols())));
    group.worst.assign(counts.size(), 0.0);
    for (std::size_t first = 0; first < group.frames.size(); first += kFramesAtOnce) measure(basis, first, group);
    return group;
  }

  /// What linear targets make of a group of frames.
  LinearShapes basis_of(const std::vector<int>& frames, int count) const {
    const std::size_t used = std::min<std::size_t>(frames.size(), kSnapshots);
    std::vector<int> spread(used);
    for (std::size_t i = 0; i < used; ++i) spread[i] = frames[i * frames.size() / used];
    return linear_shapes(displacements(spread), count - 1);
  }

  /// The weights with the least squared distance between the blended vertices and those of the frame: [K]. Conjugate
  /// gradients from the projection; blended matrices are nearly rotations, so that a few steps suffice.
  Eigen::VectorXf frame_weights(int t, const LinearShapes& basis) const {
    const std::vector<Eigen::Affine3d> matrices = blended(t);
    const std::vector<float>& vertices = clip_.vertices[t];
    Eigen::VectorXf weights = basis.weights_of(unposed_displacements(figure_, matrices, vertices));
    Eigen::VectorXf residual(basis.mean.size());
    const Eigen::VectorXf displacement = basis.mean + basis.components * weights;
    for (std::size_t v = 0; v < matrices.size(); ++v)
      residual.segment<3>(3 * static_cast<Eigen::Index>(v)) =
          distance_of(matrices[v], vertices, v, displacement).cast<float>();
    Eigen::VectorXf gradient = basis.components.transpose() * turned(matrices, residual, true), step = gradient;
    float squared = gradient.squaredNorm();
    for (int i = 0; i < kSteps && squared > kSmallGradient; ++i) {
      const Eigen::VectorXf moved = turned(matrices, basis.components * step, false);
      const float length = squared / moved.squaredNorm();
      weights += length * step;
      residual -= length * moved;
      gradient = basis.components.transpose() * turned(matrices, residual, true);
      const float before = std::exchange(squared, gradient.squaredNorm());
      step = gradient + squared / before * step;
    }
    return weights;
  }

 private:
  std::vector<Eigen::Affine3d> blended(int t) const {
    return blend_transforms(figure_, pose_nodes(figure_, skeleton_, clip_.dofs[t]));
  }

  /// [3N, frames]
  Eigen::MatrixXf displacements(std::span<const int> frames) const {
    Eigen::MatrixXf columns(3 * static_cast<Eigen::Index>(figure_.node.size()),
                            static_cast<Eigen::Index>(frames.size()));
    for (std::size_t i = 0; i < frames.size(); ++i)
      columns.col(static_cast<Eigen::Index>(i)) =
          unposed_displacements(figure_, blended(frames[i]), clip_.vertices[frames[i]]);
    return columns;
  }

  /// From a vertex that is moved with its displacement to that of the clip, metres.
  Eigen::Vector3d distance_of(const Eigen::Affine3d& matrix, const std::vector<float>& vertices, std::size_t v,
                              const Eigen::VectorXf& displacement) const {
    return vertex_of(vertices, v) - matrix * (figure_.rest_vertices[v] +
                                              displacement.segment<3>(3 * static_cast<Eigen::Index>(v)).cast<double>());
  }

  /// The vectors [3N], each by the linear part of its matrix, or by its transpose.
  static Eigen::VectorXf turned(const std::vector<Eigen::Affine3d>& matrices, Eigen::VectorXf vectors, bool back) {
    for (std::size_t v = 0; v < matrices.size(); ++v) {
      Eigen::Matrix3f M = matrices[v].linear().cast<float>();
      if (back) M.transposeInPlace();
      const Eigen::Vector3f vector = vectors.segment<3>(3 * static_cast<Eigen::Index>(v));
      vectors.segment<3>(3 * static_cast<Eigen::Index>(v)) = M * vector;
    }
    return vectors;
  }

  /// Takes some frames of a group into account, from the `first` on: the errors of their projections on the basis, and
  /// the half that each belongs to.
  void measure(const LinearShapes& basis, std::size_t first, Group& group) const {
    const std::span<const int> frames =
        std::span(group.frames).subspan(first, std::min(kFramesAtOnce, group.frames.size() - first));
    const Eigen::MatrixXf wanted = displacements(frames).colwise() - basis.mean;
    const Eigen::MatrixXf weights = basis.components.transpose() * wanted;
    Eigen::MatrixXf found = basis.mean.replicate(1, wanted.cols());
    Eigen::Index used = 0;
    for (std::size_t c = 0; c < group.targets.size(); ++c) {
      const Eigen::Index more = group.targets[c] - 1 - used;
      if (more > 0 || c == 0) {
        found += basis.components.middleCols(used, more) * weights.middleRows(used, more);
        used += more;
      }
      for (std::size_t i = 0; i < frames.size(); ++i)
        group.worst[c] = std::max(group.worst[c], worst_distance(frames[i], found.col(static_cast<Eigen::Index>(i))));
    }
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool above = weights.rows() > 0 && weights(0, static_cast<Eigen::Index>(i)) > 0.0F;
      group.halves[above ? 1 : 0].push_back(frames[i]);
    }
  }

  double worst_distance(int t, const Eigen::VectorXf& displacement) const {
    const std::vector<Eigen::Affine3d> matrices = blended(t);
    double worst = 0.0;
    for (std::size_t v = 0; v < matrices.size(); ++v)
      worst = std::max(worst, distance_of(matrices[v], clip_.vertices[t], v, displacement).squaredNorm());
    return std::sqrt(worst);
  }

  const Figure& figure_;
  const Skeleton& skeleton_;
  const FigureClip& clip_;
};

/// Groups that hold each frame once.
struct Division {
  std::vector<Group*> groups;
  bool exhausted = false;  ///< some are far, and the targets do not suffice to divide them
  double worst = 0.0;      ///< distance of a vertex, metres
};

/// Divides the farthest group until all are near or the most targets are used up.
Division divide(const GroupFit& fit, Group& all, const std::vector<int>& counts, std::size_t choice) {
  Division division{{&all}};
  int targets = all.targets[choice];
  const auto nearer = [choice](const Group* a, const Group* b) {
    return std::pair(a->is_far(choice), a->worst[choice]) < std::pair(b->is_far(choice), b->worst[choice]);
  };
  for (;;) {
    const auto farthest = std::max_element(division.groups.begin(), division.groups.end(), nearer);
    Group& group = **farthest;
    int added = -group.targets[choice];
    for (const std::vector<int>& half : group.halves) added += std::min(counts[choice], static_cast<int>(half.size()));
    division.exhausted = group.is_far(choice) && targets + added > kMaxTargets;
    if (!group.is_far(choice) || division.exhausted) {
      for (const Group* each : division.groups) division.worst = std::max(division.worst, each->worst[choice]);
      return division;
    }
    targets -= group.targets[choice];
    for (std::size_t side = 0; side < 2; ++side) {
      if (!group.divided[side]) group.divided[side] = std::make_unique<Group>(fit.fit(group.halves[side], counts));
      targets += group.divided[side]->targets[choice];
    }
    *farthest = group.divided[0].get();
    division.groups.push_back(group.divided[1].get());
  }
}

/// Adds the targets of a group. Their weights are 0 to 1, because programs clamp others: the smallest weight of each
/// component goes into the mean, which becomes a target with weight 1.
/// @param count largest number of targets @param group number of the group, for the names
void add_targets(const GroupFit& fit, const std::vector<int>& frames, int count, std::size_t group,
                 MorphTargets& morphs) {
  const LinearShapes basis = fit.basis_of(frames, count);
  const Eigen::Index before = morphs.weights.cols(), added = basis.components.cols() + 1;
  Eigen::MatrixXf weights(added - 1, static_cast<Eigen::Index>(frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i)
    weights.col(static_cast<Eigen::Index>(i)) = fit.frame_weights(frames[i], basis);
  morphs.at_once = std::max(morphs.at_once, static_cast<int>(added));
  morphs.weights.conservativeResize(Eigen::NoChange, before + added);
  morphs.weights.rightCols(added).setZero();
  Eigen::VectorXf constant = basis.mean;
  for (Eigen::Index k = 0; k + 1 < added; ++k) {
    const float least = weights.row(k).minCoeff(), range = std::max(weights.row(k).maxCoeff() - least, 1e-12F);
    constant += least * basis.components.col(k);
    for (std::size_t i = 0; i < frames.size(); ++i)
      morphs.weights(frames[i], before + k) =
          static_cast<double>(weights(k, static_cast<Eigen::Index>(i)) - least) / static_cast<double>(range);
    morphs.targets.push_back(target_rows(range * basis.components.col(k)));
    morphs.names.push_back(fmt::format("Frames{}_Way{}", group, k + 1));
  }
  for (const int frame : frames) morphs.weights(frame, before + added - 1) = 1.0;
  morphs.targets.push_back(target_rows(constant));
  morphs.names.push_back(fmt::format("Frames{}_Base", group));
}

/// The numbers of targets to try that may move at once, rising.
std::vector<int> counts_to_try(std::optional<int> count) {
  if (count) return {*count};
  std::vector<int> counts;
  for (int tried = kUsualCount; tried <= kMaxTargets; tried *= 2) counts.push_back(tried);
  return counts;
}

}  // namespace

MorphTargets fit_morphs(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip,
                        std::optional<int> count) {
  MorphTargets morphs;
  morphs.weights.resize(clip.num_frames(), 0);
  const std::vector<int> counts = counts_to_try(count);
  if (counts.back() == 0 || clip.num_frames() == 0) return morphs;
  const GroupFit fit(figure, skeleton, clip);
  std::vector<int> frames(as_size(clip.num_frames()));
  std::iota(frames.begin(), frames.end(), 0);
  Group all = fit.fit(std::move(frames), counts);
  Division best;
  int at_once = 0;
  for (std::size_t c = 0; c < counts.size() && (c == 0 || best.exhausted); ++c) {
    Division division = divide(fit, all, counts, c);
    if (c > 0 && division.exhausted && division.worst >= best.worst) continue;
    best = std::move(division);
    at_once = counts[c];
  }
  morphs.exhausted = best.exhausted;
  for (std::size_t g = 0; g < best.groups.size(); ++g) add_targets(fit, best.groups[g]->frames, at_once, g + 1, morphs);
  return morphs;
}

}  // namespace doppel
