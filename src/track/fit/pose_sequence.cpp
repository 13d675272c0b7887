#include "doppel/track/fit/pose_sequence.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "doppel/core/as_size.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

using Poses = std::vector<std::vector<double>>;

struct Segment {
  std::size_t begin, end;
};

std::vector<Segment> segments_of(std::size_t frames, const std::vector<long>& cuts) {
  std::vector<Segment> segments;
  std::size_t begin = 0;
  for (const long cut : cuts)
    if (cut > static_cast<long>(begin) && cut < static_cast<long>(frames)) {
      segments.push_back({begin, as_size(cut)});
      begin = as_size(cut);
    }
  if (begin < frames) segments.push_back({begin, frames});
  return segments;
}

/// Interpolates between poses: a at s = 0, b at s = 1.
std::vector<double> interpolated(const std::vector<double>& a, const std::vector<double>& b, double s,
                                 const std::optional<RootRotation>& root) {
  std::vector<double> pose = a;
  for (std::size_t d = 0; d < pose.size(); ++d) pose[d] += s * (b[d] - a[d]);
  if (!root) return pose;
  const Eigen::Matrix3d from = root->matrix(a);
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(root->matrix(b) * from.transpose()));
  root->set_matrix(pose, Eigen::AngleAxisd(s * turn.angle(), turn.axis()).toRotationMatrix() * from);
  return pose;
}

/// The found frame of the whole sequence that is nearest to a frame.
std::optional<std::size_t> nearest_found(const std::vector<bool>& found, std::size_t frame) {
  std::optional<std::size_t> best;
  const auto distance = [&](std::size_t f) { return f > frame ? f - frame : frame - f; };
  for (std::size_t f = 0; f < found.size(); ++f)
    if (found[f] && (!best || distance(f) < distance(*best))) best = f;
  return best;
}

void make_root_continuous(Poses& poses, const Segment& segment, const RootRotation& root) {
  for (std::size_t f = segment.begin + 1; f < segment.end; ++f) {
    const Eigen::Matrix3d rotation = root.matrix(poses[f]);
    for (const int dof : root.root().rotation) poses[f][dof] = poses[f - 1][dof];
    root.set_matrix(poses[f], rotation);
  }
}

/// Smoothing weights of the frames `first`..`last`, relative to the smoothed one. The weighted sum is the value at 0 of
/// the polynomial that fits best under the Gaussian: with basis b and weights w, W = w b^T (B^T w B)^-1 b(0).
Eigen::VectorXd smoothing_weights(long first, long last, double sigma, int degree) {
  const Eigen::Index count = last - first + 1, terms = std::min<Eigen::Index>(degree + 1, count);
  Eigen::VectorXd gaussian(count);
  Eigen::MatrixXd basis(count, terms);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double offset = static_cast<double>(first + i) / sigma;
    gaussian[i] = std::exp(-0.5 * offset * offset);
    for (Eigen::Index k = 0; k < terms; ++k) basis(i, k) = std::pow(offset, static_cast<double>(k));
  }
  const Eigen::MatrixXd weighted = gaussian.asDiagonal() * basis;
  const Eigen::MatrixXd moments = basis.transpose() * weighted;
  return weighted * solve_symmetric(moments, Eigen::VectorXd(Eigen::VectorXd::Unit(terms, 0)));
}

std::vector<double> averaged(const Poses& poses, const Segment& segment, std::size_t frame,
                             const std::optional<RootRotation>& root, double sigma, int degree) {
  const long radius = std::lround(std::ceil((degree > 0 ? 3.0 : 2.0) * sigma)), here = static_cast<long>(frame);
  const long first = std::max(-radius, static_cast<long>(segment.begin) - here);
  const long last = std::min(radius, static_cast<long>(segment.end) - 1 - here);
  const Eigen::VectorXd weights = smoothing_weights(first, last, sigma, degree);
  std::vector<double> mean(poses[frame].size(), 0.0);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Zero();
  for (long offset = first; offset <= last; ++offset) {
    const std::vector<double>& pose = poses[here + offset];
    for (std::size_t d = 0; d < mean.size(); ++d) mean[d] += weights[offset - first] * pose[d];
    if (root) rotation += weights[offset - first] * root->matrix(pose);
  }
  if (root) root->set_matrix(mean, nearest_rotation(rotation));
  return mean;
}

}  // namespace

void bridge_poses(Poses& poses, const std::vector<bool>& found, const std::vector<long>& cuts,
                  const std::optional<RootRotation>& root) {
  for (const Segment& segment : segments_of(poses.size(), cuts)) {
    std::vector<std::size_t> good;
    for (std::size_t f = segment.begin; f < segment.end; ++f)
      if (found[f]) good.push_back(f);
    for (std::size_t f = segment.begin; f < segment.end; ++f) {
      if (found[f]) continue;
      const auto after = std::lower_bound(good.begin(), good.end(), f);
      if (good.empty()) {
        if (const auto other = nearest_found(found, f)) poses[f] = poses[*other];
      } else if (after == good.begin()) {
        poses[f] = poses[*after];
      } else if (after == good.end()) {
        poses[f] = poses[good.back()];
      } else {
        const std::size_t a = *(after - 1), b = *after;
        poses[f] = interpolated(poses[a], poses[b], static_cast<double>(f - a) / static_cast<double>(b - a), root);
      }
    }
  }
}

void smooth_poses(Poses& poses, const std::vector<long>& cuts, const std::optional<RootRotation>& root, double sigma,
                  int degree) {
  for (const Segment& segment : segments_of(poses.size(), cuts)) {
    if (root) make_root_continuous(poses, segment, *root);
    if (!(sigma > 0.0)) continue;
    Poses smooth;
    for (std::size_t f = segment.begin; f < segment.end; ++f)
      smooth.push_back(averaged(poses, segment, f, root, sigma, degree));
    std::move(smooth.begin(), smooth.end(), poses.begin() + static_cast<std::ptrdiff_t>(segment.begin));
  }
}

}  // namespace doppel
