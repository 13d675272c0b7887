#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "doppel/geometry/decompositions.h"
#include "doppel/io/figure_export/figure_clip.h"

namespace doppel {
namespace {

constexpr int kSnapshots = 512;
/// Damping of the inverse of a blended matrix, which is nearly singular where a limb is twisted by half a turn.
constexpr double kDamping = 1e-3;
/// Components below this share of the largest are noise.
constexpr double kMinShare = 1e-9;
/// A segment of the clip with a larger error is halved: metres.
constexpr double kMaxError = 0.005;
constexpr int kMaxTargets = 256;

Eigen::Vector3d vertex_of(const std::vector<float>& vertices, std::size_t v) {
  return {vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]};
}

/// The displacements d of the rest vertices b with M (b + d) = v, in the least-squares sense: [3N].
Eigen::VectorXf unposed_displacements(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                                      const std::vector<float>& vertices) {
  Eigen::VectorXf result(3 * static_cast<Eigen::Index>(blended.size()));
  for (std::size_t v = 0; v < blended.size(); ++v) {
    const Eigen::Matrix3d M = blended[v].linear();
    const Eigen::Vector3d residual = vertex_of(vertices, v) - blended[v] * figure.rest_vertices[v];
    const Eigen::Matrix3d normal = M.transpose() * M + kDamping * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d right = M.transpose() * residual;
    result.segment<3>(3 * static_cast<Eigen::Index>(v)) = solve_symmetric(normal, right).cast<float>();
  }
  return result;
}

/// [3N, K] orthonormal components of the snapshots, by the eigenvectors of their inner products.
Eigen::MatrixXf components_of(const Eigen::MatrixXf& snapshots, int count) {
  const Eigen::MatrixXd gram = (snapshots.transpose() * snapshots).cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  const Eigen::Index last = gram.rows() - 1;
  const double largest = std::max(solver.eigenvalues()(last), 0.0);
  int used = 0;
  while (used < count && used <= last && solver.eigenvalues()(last - used) > std::max(largest * kMinShare, 1e-12))
    ++used;
  Eigen::MatrixXf components(snapshots.rows(), used);
  for (int k = 0; k < used; ++k)
    components.col(k) = (snapshots * solver.eigenvectors().col(last - k).cast<float>()).normalized();
  return components;
}

/// The weights with the least squared distance between the blended vertices and those of the frame: [K].
Eigen::VectorXd frame_weights(const Figure& figure, const std::vector<Eigen::Affine3d>& blended,
                              const std::vector<float>& vertices, const Eigen::VectorXf& mean,
                              const Eigen::MatrixXf& components) {
  Eigen::MatrixXd moved(components.rows(), components.cols());
  Eigen::VectorXd residual(components.rows());
  for (std::size_t v = 0; v < blended.size(); ++v) {
    const auto row = 3 * static_cast<Eigen::Index>(v);
    moved.middleRows<3>(row) = blended[v].linear() * components.middleRows<3>(row).cast<double>();
    residual.segment<3>(row) =
        vertex_of(vertices, v) - blended[v] * (figure.rest_vertices[v] + mean.segment<3>(row).cast<double>());
  }
  Eigen::MatrixXd normal = moved.transpose() * moved;
  normal.diagonal().array() += 1e-9;
  return solve_symmetric(normal, Eigen::VectorXd(moved.transpose() * residual));
}

/// The displacements of the frames [first, last): mean + components * weights.
struct Segment {
  int first, last;
  Eigen::VectorXf mean;        ///< [3N]
  Eigen::MatrixXf components;  ///< [3N, K]
  Eigen::MatrixXd weights;     ///< [last - first, K]
  double worst = 0.0;          ///< distance of a vertex, metres
};

class SegmentFit {
 public:
  SegmentFit(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip)
      : figure_(figure), skeleton_(skeleton), clip_(clip) {}

  Segment fit(int first, int last, int count) const {
    const int frames = last - first, used = std::min(frames, kSnapshots);
    Eigen::MatrixXf snapshots(3 * static_cast<Eigen::Index>(figure_.node.size()), used);
    for (int i = 0; i < used; ++i) {
      const int t = first + static_cast<int>(static_cast<long>(i) * frames / used);
      snapshots.col(i) = unposed_displacements(figure_, blended(t), clip_.vertices[t]);
    }
    const Eigen::VectorXf mean = snapshots.rowwise().mean();
    snapshots.colwise() -= mean;
    Segment segment{first, last, mean, components_of(snapshots, count - 1), {}};
    segment.weights.resize(frames, segment.components.cols());
    for (int t = first; t < last; ++t) {
      const Eigen::VectorXd weights = frame_weights(figure_, blended(t), clip_.vertices[t], mean, segment.components);
      segment.weights.row(t - first) = weights;
      segment.worst = std::max(segment.worst, worst_distance(t, mean + segment.components * weights.cast<float>()));
    }
    return segment;
  }

 private:
  std::vector<Eigen::Affine3d> blended(int t) const {
    return blend_transforms(figure_, pose_nodes(figure_, skeleton_, clip_.dofs[t]));
  }

  double worst_distance(int t, const Eigen::VectorXf& displacement) const {
    const std::vector<Eigen::Affine3d> matrices = blended(t);
    double worst = 0.0;
    for (std::size_t v = 0; v < matrices.size(); ++v) {
      const Eigen::Vector3d moved =
          matrices[v] *
          (figure_.rest_vertices[v] + displacement.segment<3>(3 * static_cast<Eigen::Index>(v)).cast<double>());
      worst = std::max(worst, (moved - vertex_of(clip_.vertices[t], v)).norm());
    }
    return worst;
  }

  const Figure& figure_;
  const Skeleton& skeleton_;
  const FigureClip& clip_;
};

Eigen::MatrixX3f rows_of(const Eigen::VectorXf& values) {
  Eigen::MatrixX3f rows(values.size() / 3, 3);
  for (Eigen::Index v = 0; v < rows.rows(); ++v) rows.row(v) = values.segment<3>(3 * v).transpose();
  return rows;
}

/// Adds the targets of a segment. Their weights are 0 to 1, because programs clamp others: the smallest weight of each
/// component goes into the mean, which becomes a target with weight 1.
void add_targets(const Segment& segment, MorphTargets& morphs) {
  const Eigen::Index before = morphs.weights.cols(), added = segment.components.cols() + 1;
  const Eigen::Index first = segment.first, frames = segment.last - segment.first;
  morphs.weights.conservativeResize(Eigen::NoChange, before + added);
  morphs.weights.rightCols(added).setZero();
  Eigen::VectorXf constant = segment.mean;
  for (Eigen::Index k = 0; k + 1 < added; ++k) {
    const double least = segment.weights.col(k).minCoeff(), most = segment.weights.col(k).maxCoeff();
    const double range = std::max(most - least, 1e-12);
    constant += static_cast<float>(least) * segment.components.col(k);
    morphs.weights.col(before + k).segment(first, frames) = (segment.weights.col(k).array() - least) / range;
    morphs.targets.push_back(rows_of(static_cast<float>(range) * segment.components.col(k)));
  }
  morphs.weights.col(before + added - 1).segment(first, frames).setOnes();
  morphs.targets.push_back(rows_of(constant));
}

}  // namespace

MorphTargets fit_morphs(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip, int count) {
  MorphTargets morphs;
  morphs.weights.resize(clip.num_frames(), 0);
  if (count == 0 || clip.num_frames() == 0) return morphs;
  const SegmentFit fit(figure, skeleton, clip);
  std::vector<std::pair<int, int>> open{{0, clip.num_frames()}};  // the last one is the earliest
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    const Segment segment = fit.fit(first, last, count);
    const int planned = morphs.count() + count * static_cast<int>(open.size() + 2);
    if (segment.worst > kMaxError && last - first > count && planned <= kMaxTargets) {
      const int middle = (first + last) / 2;
      open.emplace_back(middle, last);
      open.emplace_back(first, middle);
    } else {
      add_targets(segment, morphs);
    }
  }
  return morphs;
}

}  // namespace doppel
