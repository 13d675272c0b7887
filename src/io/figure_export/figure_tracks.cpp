#include <algorithm>
#include <cmath>

#include "doppel/io/figure_export/figure_clip.h"
#include "doppel/io/figure_export/key_frames.h"

namespace doppel {
namespace {

double share(int a, int b, int i) { return static_cast<double>(i - a) / (b - a); }

/// Calls `fill(a, b, i)` for each frame i between two neighbouring keys a and b.
template <typename Fill>
void between_keys(const std::vector<int>& keys, const Fill& fill) {
  for (std::size_t k = 1; k < keys.size(); ++k)
    for (int i = keys[k - 1] + 1; i < keys[k]; ++i) fill(keys[k - 1], keys[k], i);
}

Eigen::Quaterniond turn_at(const std::vector<Eigen::Quaterniond>& values, int a, int b, int i) {
  return values[a].slerp(share(a, b, i), values[b]);
}

Eigen::Vector3d offset_at(const std::vector<Eigen::Vector3d>& values, int a, int b, int i) {
  return values[a] + share(a, b, i) * (values[b] - values[a]);
}

Eigen::RowVectorXd weights_at(const Eigen::MatrixXd& weights, int a, int b, int i) {
  return weights.row(a) + share(a, b, i) * (weights.row(b) - weights.row(a));
}

using Parts = std::vector<ClipPart>;

/// The keys of a track, of each part by itself. @param error as for key_frames
template <typename Error>
std::vector<int> keys_of_parts(const Parts& parts, double tolerance, const Error& error) {
  std::vector<int> all;
  for (const ClipPart& part : parts)
    for (const int key : key_frames(part.frames, tolerance, [&, first = part.first](int a, int b, int i) {
           return error(first + a, first + b, first + i);
         }))
      all.push_back(part.first + key);
  return all;
}

std::vector<int> rotation_keys(const std::vector<Eigen::Quaterniond>& values, const Parts& parts, double tolerance) {
  return keys_of_parts(parts, tolerance,
                       [&](int a, int b, int i) { return values[i].angularDistance(turn_at(values, a, b, i)); });
}

std::vector<int> translation_keys(const std::vector<Eigen::Vector3d>& values, const Parts& parts, double tolerance) {
  return keys_of_parts(parts, tolerance,
                       [&](int a, int b, int i) { return (values[i] - offset_at(values, a, b, i)).norm(); });
}

std::vector<int> weight_keys(const Eigen::MatrixXd& weights, const MorphTargets& morphs, const Parts& parts,
                             double tolerance) {
  if (weights.rows() == 0 || weights.cols() == 0) return {};
  Eigen::RowVectorXd reach(morphs.count());  // the largest displacement of each target
  for (int k = 0; k < morphs.count(); ++k)
    reach(k) = static_cast<double>(morphs.targets[k].rowwise().norm().maxCoeff());
  return keys_of_parts(parts, tolerance, [&](int a, int b, int i) {
    return (weights.row(i) - weights_at(weights, a, b, i)).cwiseAbs().cwiseProduct(reach).sum();
  });
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

std::size_t FigureTracks::num_keys() const {
  std::size_t sum = weight_keys.size();
  for (const auto* lists : {&rotation_keys, &translation_keys})
    for (const std::vector<int>& keys : *lists) sum += keys.size();
  return sum;
}

std::vector<ClipPart> FigureClip::animations(const std::string& name) const {
  if (!parts.empty() || num_frames() == 0) return parts;
  return {{name, 0, num_frames(), frames_per_second}};
}

FigureTracks thin_tracks(const Figure& figure, const Skeleton& skeleton, const FigureClip& clip,
                         const MorphTargets& morphs, double tolerance) {
  std::vector<std::vector<Eigen::Affine3d>> posed;
  for (const std::vector<double>& dofs : clip.dofs) posed.push_back(pose_nodes(figure, skeleton, dofs));
  return thin_tracks(figure, posed, clip, morphs, tolerance);
}

FigureTracks thin_tracks(const Figure& figure, const std::vector<std::vector<Eigen::Affine3d>>& posed,
                         const FigureClip& clip, const MorphTargets& morphs, double tolerance) {
  FigureTracks tracks;
  tracks.rotation.resize(figure.nodes.size());
  tracks.translation.resize(figure.nodes.size());
  for (const std::vector<Eigen::Affine3d>& world : posed) {
    for (std::size_t i = 0; i < world.size(); ++i) {
      const int parent = figure.nodes[i].parent;
      const Eigen::Affine3d local = parent < 0 ? world[i] : world[parent].inverse() * world[i];
      Eigen::Quaterniond turn(local.linear());
      turn.normalize();
      // q and -q are the same rotation; neighbours with the same sign interpolate the short way.
      if (!tracks.rotation[i].empty() && turn.dot(tracks.rotation[i].back()) < 0.0) turn.coeffs() = -turn.coeffs();
      tracks.rotation[i].push_back(turn);
      tracks.translation[i].push_back(local.translation());
    }
  }
  const Parts parts = clip.animations("");
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    tracks.rotation_keys.push_back(rotation_keys(tracks.rotation[i], parts, tolerance));
    tracks.translation_keys.push_back(translation_keys(tracks.translation[i], parts, tolerance));
  }
  tracks.weights = morphs.weights;
  tracks.weight_keys = weight_keys(tracks.weights, morphs, parts, tolerance);
  interpolate_between_keys(tracks);
  return tracks;
}

void interpolate_between_keys(FigureTracks& tracks) {
  for (std::size_t n = 0; n < tracks.rotation.size(); ++n) {
    auto& turns = tracks.rotation[n];
    auto& offsets = tracks.translation[n];
    between_keys(tracks.rotation_keys[n], [&](int a, int b, int i) { turns[i] = turn_at(turns, a, b, i); });
    between_keys(tracks.translation_keys[n], [&](int a, int b, int i) { offsets[i] = offset_at(offsets, a, b, i); });
  }
  Eigen::MatrixXd& weights = tracks.weights;
  between_keys(tracks.weight_keys, [&](int a, int b, int i) { weights.row(i) = weights_at(weights, a, b, i); });
}

std::vector<Eigen::Vector3d> figure_surface(const Figure& figure, const MorphTargets& morphs,
                                            const FigureTracks& tracks, std::size_t t) {
  const auto blended = blend_transforms(figure, nodes_at(figure, tracks, t));
  std::vector<Eigen::Vector3d> surface = figure.rest_vertices;
  for (int k = 0; k < morphs.count(); ++k) {
    const double weight = tracks.weights(static_cast<Eigen::Index>(t), k);
    if (weight == 0.0) continue;
    for (std::size_t v = 0; v < surface.size(); ++v)
      surface[v] += weight * morphs.targets[k].row(static_cast<Eigen::Index>(v)).cast<double>().transpose();
  }
  for (std::size_t v = 0; v < surface.size(); ++v) surface[v] = blended[v] * surface[v];
  return surface;
}

FigureError figure_error(const Figure& figure, const FigureClip& clip, const MorphTargets& morphs,
                         const FigureTracks& tracks) {
  FigureError error;
  const std::size_t vertices = figure.node.size();
  for (std::size_t t = 0; t < clip.vertices.size(); ++t) {
    const std::vector<Eigen::Vector3d> surface = figure_surface(figure, morphs, tracks, t);
    double sum = 0.0;
    for (std::size_t v = 0; v < vertices; ++v) {
      const float* ground_truth = &clip.vertices[t][3 * v];
      const double distance =
          1000.0 * (surface[v] - Eigen::Vector3d(ground_truth[0], ground_truth[1], ground_truth[2])).norm();
      sum += distance;
      error.worst = std::max(error.worst, distance);
    }
    error.mean += sum / static_cast<double>(vertices * clip.vertices.size());
  }
  return error;
}

}  // namespace doppel
