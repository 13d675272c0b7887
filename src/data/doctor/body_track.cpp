#include "doppel/data/doctor/body_track.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "doppel/core/as_size.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInlierShare = 0.06;  ///< of the person's size: a view that agrees with a point
constexpr double kMinAngle = 0.05;     ///< radians between the rays of a point
constexpr int kMaxPairs = 8;
constexpr int kMinPoints = 3;  ///< in common, to judge a detection
constexpr double kNearestDepth = 1e-6;
constexpr int kUncertaintyStride = 4;  ///< instants

const Vector3d kUnknown = Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());

}  // namespace

BodyTrack::BodyTrack(int instants, int points)
    : points_(points), positions_(as_size(instants) * as_size(points), kUnknown) {}

std::size_t BodyTrack::index(int instant, int point) const {
  return as_size(instant) * as_size(points_) + as_size(point);
}

Vector3d BodyTrack::later(const Sightings& seen, int instant, double delay, int point) const {
  const int before = instant + static_cast<int>(std::floor(delay));
  const double share = delay - std::floor(delay);
  const int after = share > 0.0 ? before + 1 : before;
  if (before < 0 || after >= seen.num_instants()) return kUnknown;
  const int segment = seen.instants[instant].segment;
  if (seen.instants[before].segment != segment || seen.instants[after].segment != segment) return kUnknown;
  return (1.0 - share) * at(before, point) + share * at(after, point);
}

double SupposedView::delay_at(const Sightings& seen, int instant, int window) const {
  const double step = steps.empty() ? 0.0 : steps[window];
  return delay + drift * static_cast<double>(seen.instants[instant].row) + step;
}

std::optional<Vector2d> SupposedView::pixel(const Vector3d& point) const {
  if (camera.camera_from_world(point).z() < kNearestDepth) return std::nullopt;
  return Vector2d(turn * camera.project(point) + shift);
}

ChosenInstants instants_of(const Sightings& seen, const std::vector<int>& windows, int most) {
  int total = 0;
  for (const int window : windows) total += static_cast<int>(seen.windows[window].size());
  const double step = most > 0 && total > most ? static_cast<double>(total) / most : 1.0;
  ChosenInstants chosen;
  double next = 0.0;
  int number = 0;
  for (const int window : windows)
    for (const int instant : seen.windows[window])
      if (number++ >= next) {
        chosen.instants.push_back(instant);
        chosen.window.push_back(window);
        next += step;
      }
  return chosen;
}

ChosenInstants all_instants(const Sightings& seen, int most) {
  std::vector<int> windows(seen.windows.size());
  std::iota(windows.begin(), windows.end(), 0);
  return instants_of(seen, windows, most);
}

std::vector<double> ViewResiduals::by_window(std::size_t windows) const {
  std::vector<std::vector<double>> of(windows);
  for (std::size_t i = 0; i < shares.size(); ++i) of[window[i]].push_back(shares[i]);
  std::vector<double> medians;
  for (const auto& values : of) medians.push_back(values.empty() ? -1.0 : median(values));
  return medians;
}

double ViewResiduals::mean_of_windows(std::size_t windows) const {
  double sum = 0.0;
  int count = 0;
  for (const double value : by_window(windows)) {
    sum += value < 0.0 ? 0.0 : value;
    count += value >= 0.0;
  }
  return count == 0 ? kMaxShare : sum / count;
}

namespace {

/// Projections of the body for one instant. Points behind the camera have no pixel.
struct ProjectedPoint {
  bool known = false, in_front = false;
  Vector2d pixel = Vector2d::Zero();
};

std::vector<ProjectedPoint> projected_body(const Sightings& seen, const SupposedView& view, const BodyTrack& body,
                                           int instant, double delay) {
  std::vector<ProjectedPoint> points(seen.points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vector3d position =
        delay == 0.0 ? body.at(instant, static_cast<int>(k)) : body.later(seen, instant, delay, static_cast<int>(k));
    if (!position.allFinite()) continue;
    const auto pixel = view.pixel(position);
    ProjectedPoint& point = points[view.sides_swapped ? as_size(seen.mirrored[k]) : k];
    point.known = true;
    point.in_front = pixel && pixel->allFinite();
    if (point.in_front) point.pixel = *pixel;
  }
  return points;
}

}  // namespace

ViewResiduals residuals_of(const Sightings& seen, int camera, const SupposedView& view, const BodyTrack& body,
                           const ChosenInstants& chosen) {
  ViewResiduals all;
  const double size = seen.size[camera];
  for (std::size_t i = 0; i < chosen.instants.size(); ++i) {
    const int instant = chosen.instants[i];
    const auto& people = seen.people[camera][instant];
    if (people.empty()) continue;
    const double delay = view.delay_at(seen, instant, chosen.window[i]);
    const std::vector<ProjectedPoint> points = projected_body(seen, view, body, instant, delay);
    double best = std::numeric_limits<double>::infinity();
    const SeenPerson* nearest = nullptr;
    const auto share_of = [&](const SeenPerson& person, std::size_t k) {
      return points[k].in_front ? std::min(kMaxShare, (person[k].pixel - points[k].pixel).norm() / size) : kMaxShare;
    };
    for (const SeenPerson& person : people) {
      std::vector<double> shares;
      for (std::size_t k = 0; k < points.size(); ++k)
        if (person[k].seen && points[k].known) shares.push_back(share_of(person, k));
      if (static_cast<int>(shares.size()) < kMinPoints) continue;
      if (const double middle = median(shares); middle < best) {
        best = middle;
        nearest = &person;
      }
    }
    if (!nearest) continue;
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (!(*nearest)[k].seen || !points[k].known) continue;
      all.shares.push_back(share_of(*nearest, k));
      all.window.push_back(chosen.window[i]);
      all.instant.push_back(instant);
      all.point.push_back(static_cast<int>(k));
      all.offset.push_back(points[k].in_front ? Vector2d((*nearest)[k].pixel - points[k].pixel)
                                              : Vector2d::Constant(size));
    }
  }
  return all;
}

SightTable::SightTable(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person,
                       const ChosenInstants& chosen)
    : seen_(seen), sights_(seen.cameras.size()) {
  const std::size_t points = seen.points.size();
  for (std::size_t c = 0; c < views.size(); ++c) {
    const SupposedView& view = views[c];
    const Eigen::Matrix2d back = view.turn.inverse();
    sights_[c].resize(as_size(seen.num_instants()) * points);
    for (const int i : chosen.instants) {
      const int index = person[c][i];
      if (index < 0) continue;
      const SeenPerson& body = seen.people[c][i][index];
      for (std::size_t k = 0; k < points; ++k) {
        if (!body[k].seen) continue;
        const std::size_t name = view.sides_swapped ? as_size(seen.mirrored[k]) : k;
        auto sight = sight_of(view.camera, back * (body[k].pixel - view.shift));
        if (sight) sight->unit_from_plane = view.turn * sight->unit_from_plane / seen.size[c];
        sights_[c][as_size(i) * points + name] = sight;
      }
    }
  }
}

const std::optional<Sight>& SightTable::sight(int camera, int instant, int point) const {
  return sights_[camera][as_size(instant) * seen_.points.size() + as_size(point)];
}

namespace {

/// d residual / d point.
Eigen::Matrix<double, 2, 3> slope_of(const Sight& sight, const Vector3d& point) {
  const Vector3d p = sight.R * point + sight.t;
  Eigen::Matrix<double, 2, 3> projection;
  projection << 1.0 / p.z(), 0.0, -p.x() / (p.z() * p.z()), 0.0, 1.0 / p.z(), -p.y() / (p.z() * p.z());
  return sight.unit_from_plane * projection * sight.R;
}

}  // namespace

std::optional<double> SightTable::uncertainty(const std::vector<int>& cameras, int camera,
                                              const BodyTrack& body) const {
  std::vector<double> values;
  for (int instant = 0; instant < seen_.num_instants(); instant += kUncertaintyStride)
    for (int k = 0; k < seen_.num_points(); ++k) {
      const auto& seen = sight(camera, instant, k);
      if (!seen || !body.known(instant, k)) continue;
      const Vector3d& point = body.at(instant, k);
      Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
      int views = 0;
      for (const int c : cameras) {
        const auto& other = sight(c, instant, k);
        if (!other) continue;
        const auto slope = slope_of(*other, point);
        information += slope.transpose() * slope;
        ++views;
      }
      if (views < 2) continue;
      const auto slope = slope_of(*seen, point);
      const double value = 0.5 * (slope * information.inverse() * slope.transpose()).trace();
      if (std::isfinite(value) && value > 0.0) values.push_back(value);
    }
  if (values.empty()) return std::nullopt;
  return median(values);
}

BodyTrack SightTable::triangulate(const std::vector<int>& cameras, const ChosenInstants& chosen) const {
  TriangulationOptions options;
  options.inlier_threshold = kInlierShare;
  options.smallest_angle = kMinAngle;
  options.most_pairs = kMaxPairs;
  options.refinement_steps = 2;
  BodyTrack body(seen_.num_instants(), seen_.num_points());
  std::vector<Sight> sights;
  for (const int instant : chosen.instants)
    for (int k = 0; k < seen_.num_points(); ++k) {
      sights.clear();
      for (const int c : cameras) {
        if (const auto& seen = sight(c, instant, k)) sights.push_back(*seen);
      }
      if (sights.size() < 2) continue;
      if (const auto point = doppel::triangulate(sights, options)) body.at(instant, k) = point->position;
    }
  return body;
}

}  // namespace doppel
