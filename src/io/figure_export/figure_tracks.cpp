#include <algorithm>
#include <cmath>

#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/key_frames.h"

namespace doppel {
namespace {

double share(int a, int b, int i) { return static_cast<double>(i - a) / (b - a); }

using Parts = std::vector<ClipPart>;

/// The keys of each part of a track. Calls `fill(a, b, i)` for each frame i between two neighbouring keys a and b.
/// @param error as for key_frames
template <typename Error, typename Fill>
std::vector<int> thinned(const Parts& parts, double tolerance, const Error& error, const Fill& fill) {
  std::vector<int> all;
  for (const ClipPart& part : parts) {
    std::vector<int> keys = key_frames(part.frames, tolerance, [&, first = part.first](int a, int b, int i) {
      return error(first + a, first + b, first + i);
    });
    for (int& key : keys) key += part.first;
    for (std::size_t k = 1; k < keys.size(); ++k)
      for (int i = keys[k - 1] + 1; i < keys[k]; ++i) fill(keys[k - 1], keys[k], i);
    all.insert(all.end(), keys.begin(), keys.end());
  }
  return all;
}

std::vector<int> thin_rotations(std::vector<Eigen::Quaterniond>& values, const Parts& parts, double tolerance) {
  const auto at = [&](int a, int b, int i) { return values[a].slerp(share(a, b, i), values[b]); };
  return thinned(
      parts, tolerance, [&](int a, int b, int i) { return values[i].angularDistance(at(a, b, i)); },
      [&](int a, int b, int i) { values[i] = at(a, b, i); });
}

std::vector<int> thin_translations(std::vector<Eigen::Vector3d>& values, const Parts& parts, double tolerance) {
  const auto at = [&](int a, int b, int i) -> Eigen::Vector3d {
    return values[a] + share(a, b, i) * (values[b] - values[a]);
  };
  return thinned(
      parts, tolerance, [&](int a, int b, int i) { return (values[i] - at(a, b, i)).norm(); },
      [&](int a, int b, int i) { values[i] = at(a, b, i); });
}

std::vector<int> thin_weights(Eigen::MatrixXd& weights, const MorphTargets& morphs, const Parts& parts,
                              double tolerance) {
  if (weights.rows() == 0 || weights.cols() == 0) return {};
  Eigen::RowVectorXd reach(morphs.count());  // the largest displacement of each target
  for (int k = 0; k < morphs.count(); ++k)
    reach(k) = static_cast<double>(morphs.targets[k].rowwise().norm().maxCoeff());
  const auto at = [&](int a, int b, int i) -> Eigen::RowVectorXd {
    return weights.row(a) + share(a, b, i) * (weights.row(b) - weights.row(a));
  };
  return thinned(
      parts, tolerance,
      [&](int a, int b, int i) { return (weights.row(i) - at(a, b, i)).cwiseAbs().cwiseProduct(reach).sum(); },
      [&](int a, int b, int i) { weights.row(i) = at(a, b, i).eval(); });
}

/// The transforms of the nodes that the tracks give in frame t, node to world.
std::vector<Eigen::Affine3d> nodes_at(const Figure& figure, const FigureTracks& tracks, std::size_t t) {
  std::vector<Eigen::Affine3d> world(figure.nodes.size());
  for (std::size_t i = 0; i < world.size(); ++i) {
    const Eigen::Affine3d local = Eigen::Translation3d(tracks.translation[i][t]) * tracks.rotation[i][t];
    const int parent = figure.nodes[i].parent;
    world[i] = parent < 0 ? local : world[parent] * local;
  }
  return world;
}

}  // namespace

std::vector<ClipPart> FigureClip::animations(const std::string& name) const {
  if (!parts.empty() || num_frames() == 0) return parts;
  return {{name, 0, num_frames(), frames_per_second}};
}

std::size_t FigureTracks::num_keys() const {
  std::size_t sum = weight_keys.size();
  for (const auto* lists : {&rotation_keys, &translation_keys})
    for (const std::vector<int>& keys : *lists) sum += keys.size();
  return sum;
}

FigureTracks thin_tracks(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip,
                         const MorphTargets& morphs, double tolerance) {
  FigureTracks tracks;
  tracks.rotation.resize(figure.nodes.size());
  tracks.translation.resize(figure.nodes.size());
  for (int t = 0; t < clip.num_frames(); ++t) {
    const auto world = pose_nodes(figure, skeleton, clip.dofs[t]);
    for (std::size_t i = 0; i < world.size(); ++i) {
      const int parent = figure.nodes[i].parent;
      const Eigen::Affine3d local = parent < 0 ? world[i] : world[parent].inverse() * world[i];
      Eigen::Quaterniond turn(local.linear());
      turn.normalize();
      // q and -q are the same rotation; neighbours with the same sign interpolate the short way.
      if (t > 0 && turn.dot(tracks.rotation[i].back()) < 0.0) turn.coeffs() = -turn.coeffs();
      tracks.rotation[i].push_back(turn);
      tracks.translation[i].push_back(local.translation());
    }
  }
  const Parts parts = clip.animations("");
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    tracks.rotation_keys.push_back(thin_rotations(tracks.rotation[i], parts, tolerance));
    tracks.translation_keys.push_back(thin_translations(tracks.translation[i], parts, tolerance));
  }
  tracks.weights = morphs.weights;
  tracks.weight_keys = thin_weights(tracks.weights, morphs, parts, tolerance);
  return tracks;
}

FigureError figure_error(const Figure& figure, const FigureClip& clip, const MorphTargets& morphs,
                         const FigureTracks& tracks) {
  FigureError error;
  const std::size_t vertices = figure.node.size();
  for (std::size_t t = 0; t < clip.vertices.size(); ++t) {
    const auto blended = blend_transforms(figure, nodes_at(figure, tracks, t));
    double sum = 0.0;
    for (std::size_t v = 0; v < vertices; ++v) {
      Eigen::Vector3d rest = figure.rest_vertices[v];
      for (int k = 0; k < morphs.count(); ++k)
        rest += tracks.weights(static_cast<Eigen::Index>(t), k) *
                morphs.targets[k].row(static_cast<Eigen::Index>(v)).cast<double>().transpose();
      const float* ground_truth = &clip.vertices[t][3 * v];
      const double distance =
          1000.0 * (blended[v] * rest - Eigen::Vector3d(ground_truth[0], ground_truth[1], ground_truth[2])).norm();
      sum += distance;
      error.worst = std::max(error.worst, distance);
    }
    error.mean += sum / static_cast<double>(vertices * clip.vertices.size());
  }
  return error;
}

}  // namespace doppel
