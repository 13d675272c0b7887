#include "doppel/io/figure_export/euler_tracks.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/io/figure_export/key_frames.h"
#include "doppel/io/scene/fbx_animation.h"

namespace doppel {
namespace {

/// Between two samples of a path, the rotation may leave the shortest way by this part of the turn.
constexpr double kMaxDetour = 0.125;
constexpr double kMinStep = 1.0 / 64;  // frames
constexpr double kNoTurn = 1e-5;       // radians
constexpr double kAtPole = 1e-7;       // cosine of the angle about y

constexpr double degrees_of(double radians) { return radians * (180.0 / M_PI); }

/// The angles that differ by full turns from `angles` and are nearest to `previous`, degrees.
Eigen::Vector3d unrolled(const Eigen::Vector3d& angles, const Eigen::Vector3d& previous) {
  return angles + 360.0 * ((previous - angles) / 360.0).array().round().matrix();
}

/// Of all Euler angles of a rotation, those nearest to `previous`, degrees.
Eigen::Vector3d nearest_angles(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& previous) {
  const Eigen::Matrix3d m = rotation.normalized().toRotationMatrix();
  const double cosine = std::hypot(m(0, 0), m(1, 0)), y = degrees_of(std::atan2(-m(2, 0), cosine));
  if (cosine < kAtPole) {
    // Only the difference, or the sum, of the other two angles counts.
    const double side = m(2, 0) < 0 ? 1.0 : -1.0, turn = degrees_of(std::atan2(side * m(0, 1), m(1, 1)));
    return unrolled({previous.x(), y, side * (previous.x() - turn)}, previous);
  }
  const double x = degrees_of(std::atan2(m(2, 1), m(2, 2))), z = degrees_of(std::atan2(m(1, 0), m(0, 0)));
  const Eigen::Vector3d one = unrolled({x, y, z}, previous), other = unrolled({x + 180, 180 - y, z + 180}, previous);
  return (one - previous).squaredNorm() <= (other - previous).squaredNorm() ? one : other;
}

/// A rotation at a time, and its angles.
struct EulerSample {
  double frame = 0.0;
  Eigen::Quaterniond rotation;
  Eigen::Vector3d degrees;
};

/// How far straight lines between two samples are off at a time between them, radians: the larger one of that of the
/// angles and that of the quaternions.
double line_error(const EulerSample& a, const EulerSample& b, double frame, const Eigen::Quaterniond& wanted) {
  const double share = (frame - a.frame) / (b.frame - a.frame);
  const Eigen::Vector3d angles = a.degrees + share * (b.degrees - a.degrees);
  const double sign = a.rotation.dot(b.rotation) < 0 ? -1.0 : 1.0;
  Eigen::Quaterniond mixed((1 - share) * a.rotation.coeffs() + share * sign * b.rotation.coeffs());
  mixed.normalize();
  return std::max(wanted.angularDistance(fbx_rotation(0, angles)), wanted.angularDistance(mixed));
}

/// The angles of all frames, each those nearest to the sample before, with samples between the frames where the angles
/// of two frames are far apart although the rotations are not.
class EulerPath {
 public:
  /// @param rotation [T]
  explicit EulerPath(const std::vector<Eigen::Quaterniond>& rotation) : rotation_(rotation) {
    append(sample(0.0, Eigen::Vector3d::Zero()));
    for (std::size_t t = 0; t < rotation.size(); ++t) {
      sample_of_frame_.push_back(static_cast<int>(samples_.size()) - 1);
      if (t + 1 < rotation.size()) step_to(static_cast<double>(t + 1));
    }
  }

  /// @param keys frames that stay
  EulerTrack thinned(const std::vector<int>& keys, double tolerance) const {
    EulerTrack track;
    const auto keep = [&](int index) {
      track.frames.push_back(samples_[as_size(index)].frame);
      track.degrees.push_back(samples_[as_size(index)].degrees);
    };
    keep(sample_of_frame_[as_size(keys[0])]);
    for (std::size_t k = 1; k < keys.size(); ++k) {
      const int first = sample_of_frame_[as_size(keys[k - 1])], last = sample_of_frame_[as_size(keys[k])];
      const auto error = [&](int a, int b, int i) {
        const EulerSample& wanted = samples_[as_size(first + i)];
        return line_error(samples_[as_size(first + a)], samples_[as_size(first + b)], wanted.frame, wanted.rotation);
      };
      const std::vector<int> kept = key_frames(last - first + 1, tolerance, error);
      for (std::size_t i = 1; i < kept.size(); ++i) keep(first + kept[i]);
    }
    return track;
  }

 private:
  EulerSample sample(double frame, const Eigen::Vector3d& previous) const {
    const std::size_t t = as_size(frame), next = std::min(t + 1, rotation_.size() - 1);
    const Eigen::Quaterniond turn = rotation_[t].slerp(frame - static_cast<double>(t), rotation_[next]);
    return {frame, turn, nearest_angles(turn, previous)};
  }
  void append(const EulerSample& next) { samples_.push_back(next); }

  bool detours(const EulerSample& a, const EulerSample& b) const {
    const double middle = (a.frame + b.frame) / 2, turn = a.rotation.angularDistance(b.rotation);
    return line_error(a, b, middle, sample(middle, a.degrees).rotation) > std::max(kMaxDetour * turn, kNoTurn);
  }

  void step_to(double frame) {
    while (samples_.back().frame < frame) {
      const EulerSample last = samples_.back();
      double step = frame - last.frame;
      EulerSample next = sample(frame, last.degrees);
      for (; step > kMinStep && detours(last, next); next = sample(last.frame + step, last.degrees)) step /= 2;
      append(next);
    }
  }

  const std::vector<Eigen::Quaterniond>& rotation_;
  std::vector<EulerSample> samples_;
  std::vector<int> sample_of_frame_;
};

}  // namespace

Eigen::Vector3d EulerTrack::at(double frame) const {
  const auto next = std::upper_bound(frames.begin(), frames.end(), frame);
  if (next == frames.begin()) return degrees.front();
  if (next == frames.end()) return degrees.back();
  const std::size_t k = as_size(next - frames.begin());
  const double share = (frame - frames[k - 1]) / (frames[k] - frames[k - 1]);
  return degrees[k - 1] + share * (degrees[k] - degrees[k - 1]);
}

Eigen::Vector3d euler_angles(const Eigen::Quaterniond& rotation) {
  return nearest_angles(rotation, Eigen::Vector3d::Zero());
}

std::vector<Eigen::Affine3d> rest_to_parent(const Figure& figure) {
  std::vector<Eigen::Affine3d> local;
  for (std::size_t i = 0; i < figure.nodes.size(); ++i) {
    const int parent = figure.nodes[i].parent;
    local.push_back(parent < 0 ? figure.rest[i] : figure.rest[as_size(parent)].inverse() * figure.rest[i]);
  }
  return local;
}

std::vector<EulerTrack> euler_tracks(const Figure& figure, const FigureTracks& tracks, double tolerance) {
  const auto rest = rest_to_parent(figure);
  std::vector<EulerTrack> turns;
  for (std::size_t i = 0; i < tracks.rotation.size() && !tracks.rotation[i].empty(); ++i) {
    const Eigen::Quaterniond back = Eigen::Quaterniond(rest[i].linear()).normalized().conjugate();
    std::vector<Eigen::Quaterniond> relative;
    for (const Eigen::Quaterniond& turn : tracks.rotation[i]) relative.push_back(back * turn);
    turns.push_back(EulerPath(relative).thinned(tracks.rotation_keys[i], tolerance));
  }
  return turns;
}

FigureTracks with_euler_rotations(const Figure& figure, FigureTracks tracks, const std::vector<EulerTrack>& turns) {
  const auto rest = rest_to_parent(figure);
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const Eigen::Quaterniond still = Eigen::Quaterniond(rest[i].linear()).normalized();
    for (std::size_t t = 0; t < tracks.rotation[i].size(); ++t)
      tracks.rotation[i][t] = still * fbx_rotation(0, turns[i].at(static_cast<double>(t)));
  }
  return tracks;
}

}  // namespace doppel
