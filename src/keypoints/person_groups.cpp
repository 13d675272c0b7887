#include "doppel/keypoints/person_groups.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFewestShared = 4;                            ///< points of a body that a detection must show to agree
constexpr double kShareOfAgreement = 0.5;                   ///< of these points
constexpr double kSmallestSine = 0.03;                      ///< of the angle between two rays
constexpr double kNearestDepth = 0.05;                      ///< metres
constexpr double kSmallestBody = 0.03, kLargestBody = 3.0;  ///< metres; median distance of the points from the middle
constexpr std::size_t kMostGrown = 400;                     ///< proposals looked at in one frame
constexpr int kMostPairsOfPoint = 60;
constexpr int kAllPairsUpTo = 8;  ///< cameras

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The middle of the shortest line between two rays; nothing for rays that are nearly parallel.
std::optional<Vector3d> meeting_point(const Vector3d& a, const Vector3d& along_a, const Vector3d& b,
                                      const Vector3d& along_b) {
  const double cosine = along_a.dot(along_b), squared_sine = 1.0 - cosine * cosine;
  if (squared_sine < kSmallestSine * kSmallestSine) return std::nullopt;
  const Vector3d apart = b - a;
  const double s = (apart.dot(along_a) - cosine * apart.dot(along_b)) / squared_sine;
  const double t = (cosine * apart.dot(along_a) - apart.dot(along_b)) / squared_sine;
  return 0.5 * (a + s * along_a + b + t * along_b);
}

Vector3d middle_of(const std::vector<std::optional<Vector3d>>& body) {
  Vector3d middle = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto& point : body)
      if (point) values.push_back((*point)[axis]);
    if (!values.empty()) middle[axis] = median_of(values);
  }
  return middle;
}

/// Whether the points lie as closely together as those of a body.
bool has_size_of_body(const std::vector<std::optional<Vector3d>>& body) {
  const Vector3d middle = middle_of(body);
  std::vector<double> distances;
  for (const auto& point : body)
    if (point) distances.push_back((*point - middle).norm());
  if (static_cast<int>(distances.size()) < kFewestShared) return false;
  const double size = median_of(distances);
  return size >= kSmallestBody && size <= kLargestBody;
}

/// The distances in a ring of cameras at which pairs of cameras are compared.
std::vector<int> steps_between(int cameras) {
  std::set<int> steps;
  for (int step = 1; 2 * step <= cameras; ++step)
    if (cameras <= kAllPairsUpTo || step <= 3 || step == cameras / 4 || step == cameras / 3 || step == cameras / 2)
      steps.insert(step);
  return {steps.begin(), steps.end()};
}

bool is_better(const PersonGroup& a, const PersonGroup& b) {
  if (a.views != b.views) return a.views > b.views;
  if (a.support != b.support) return a.support > b.support;
  return a.residual < b.residual;
}

}  // namespace

bool PersonGrouper::Fit::better_than(const Fit& other) const {
  if (agreeing != other.agreeing) return agreeing > other.agreeing;
  return agreeing > 0 && sum / agreeing < other.sum / other.agreeing;
}

PersonGrouper::PersonGrouper(const std::vector<Camera>& cameras, std::vector<int> mirrored, double max_residual)
    : mirrored_(std::move(mirrored)), max_residual_(max_residual) {
  for (const Camera& camera : cameras) {
    if (camera.height <= 0) fail("following a person: the size of the images of camera '{}' is not known", camera.name);
    const double focal_length = 0.5 * (camera.K(0, 0) + camera.K(1, 1));
    views_.push_back({camera, camera.K.inverse(), camera.centre(), focal_length / camera.height});
  }
}

PersonGrouper::Frame PersonGrouper::seen(const std::vector<People>& people) const {
  Frame frame(views_.size());
  for (std::size_t c = 0; c < views_.size(); ++c)
    for (const Person& person : people.at(c)) {
      Detection detection(mirrored_.size());
      if (person.size() != mirrored_.size())
        fail("following a person: a person has {} points, the layout has {}", person.size(), mirrored_.size());
      for (std::size_t i = 0; i < person.size(); ++i) {
        if (person[i].confidence <= 0.0f) continue;
        const Vector3d plane = views_[c].pixel_to_plane * Vector3d(person[i].x, person[i].y, 1.0);
        const std::optional<Vector2d> straight = views_[c].camera.undistorted(plane.head<2>());
        if (!straight || !straight->allFinite()) continue;
        detection[i] = {true, *straight, (views_[c].camera.R.transpose() * straight->homogeneous()).normalized()};
      }
      frame[c].push_back(std::move(detection));
    }
  return frame;
}

double PersonGrouper::residual(const View& view, const SeenPoint& point, const Vector3d& position) const {
  const Vector3d in_camera = view.camera.camera_from_world(position);
  if (in_camera.z() < kNearestDepth) return std::numeric_limits<double>::infinity();
  return view.heights_per_unit * (in_camera.hnormalized() - point.at).norm();
}

/// Adds the body that two detections make, in the order of the first, if its points are near both.
void PersonGrouper::propose(const Frame& frame, Proposal proposal, std::vector<Proposal>& all) const {
  const View &a = views_[as_size(proposal.camera[0])], &b = views_[as_size(proposal.camera[1])];
  const Detection& first = frame[as_size(proposal.camera[0])][as_size(proposal.person[0])];
  const Detection& second = frame[as_size(proposal.camera[1])][as_size(proposal.person[1])];
  Proposal best;
  best.residual = std::numeric_limits<double>::infinity();
  for (const bool mirrored : {false, true}) {
    proposal.body.assign(first.size(), std::nullopt);
    std::vector<double> residuals;
    for (std::size_t i = 0; i < first.size(); ++i) {
      const SeenPoint& other = second[mirrored ? as_size(mirrored_[i]) : i];
      if (!first[i].seen || !other.seen) continue;
      const auto position = meeting_point(a.centre, first[i].direction, b.centre, other.direction);
      if (!position) continue;
      residuals.push_back(std::max(residual(a, first[i], *position), residual(b, other, *position)));
      if (residuals.back() <= max_residual_) proposal.body[i] = *position;
    }
    if (static_cast<int>(residuals.size()) < kFewestShared) continue;
    proposal.residual = median_of(residuals);
    if (proposal.residual < best.residual) best = proposal;
  }
  if (best.residual <= max_residual_ && has_size_of_body(best.body)) all.push_back(std::move(best));
}

std::vector<PersonGrouper::Proposal> PersonGrouper::proposals(const Frame& frame) const {
  std::vector<Proposal> all;
  const int cameras = static_cast<int>(views_.size());
  for (const int step : steps_between(cameras))
    for (int a = 0; a < cameras; ++a) {
      const int b = (a + step) % cameras;
      if (2 * step == cameras && a >= b) continue;  // this pair was seen from the other side
      for (std::size_t p = 0; p < frame[as_size(a)].size(); ++p)
        for (std::size_t q = 0; q < frame[as_size(b)].size(); ++q)
          propose(frame, {0.0, {a, b}, {static_cast<int>(p), static_cast<int>(q)}, {}}, all);
    }
  std::sort(all.begin(), all.end(), [](const Proposal& x, const Proposal& y) { return x.residual < y.residual; });
  return all;
}

PersonGrouper::Fit PersonGrouper::fit(const View& view, const Detection& detection, const Body& body, double limit,
                                      bool mirrored) const {
  Fit result;
  result.mirrored = mirrored;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const SeenPoint& point = detection[mirrored ? as_size(mirrored_[i]) : i];
    if (!body[i] || !point.seen) continue;
    ++result.shared;
    const double distance = residual(view, point, *body[i]);
    if (!(distance <= limit)) continue;
    ++result.agreeing;
    result.sum += distance;
  }
  const bool agrees = result.shared >= kFewestShared && result.agreeing >= kShareOfAgreement * result.shared;
  if (!agrees) result.agreeing = 0;
  return result;
}

/// The detections that agree with a body, at most one of each camera. @param mirrored [C] set to their orders
PersonGroup PersonGrouper::assign(const Frame& frame, const Body& body, double limit,
                                  std::vector<bool>& mirrored) const {
  PersonGroup group;
  group.body = body;
  group.chosen.assign(views_.size(), -1);
  mirrored.assign(views_.size(), false);
  double sum = 0.0;
  int agreeing = 0;
  for (std::size_t c = 0; c < views_.size(); ++c) {
    Fit best;
    for (std::size_t p = 0; p < frame[c].size(); ++p)
      for (const bool swapped : {false, true}) {
        const Fit found = fit(views_[c], frame[c][p], body, limit, swapped);
        if (found.agreeing == 0 || !found.better_than(best)) continue;
        best = found;
        group.chosen[c] = static_cast<int>(p);
      }
    if (group.chosen[c] < 0) continue;
    mirrored[c] = best.mirrored;
    ++group.views;
    group.support += static_cast<double>(best.agreeing) / static_cast<double>(body.size());
    sum += best.sum;
    agreeing += best.agreeing;
  }
  group.residual = agreeing > 0 ? sum / agreeing : 0.0;
  return group;
}

/// Each point from the pair of views with the most inliers among all views of the group; among equals, the pair with
/// the smaller error.
PersonGrouper::Body PersonGrouper::triangulated(const Frame& frame, const PersonGroup& group,
                                                const std::vector<bool>& mirrored) const {
  Body body(mirrored_.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    std::vector<std::pair<const View*, const SeenPoint*>> rays;
    for (std::size_t c = 0; c < views_.size(); ++c) {
      if (group.chosen[c] < 0) continue;
      const SeenPoint& point = frame[c][as_size(group.chosen[c])][mirrored[c] ? as_size(mirrored_[i]) : i];
      if (point.seen) rays.emplace_back(&views_[c], &point);
    }
    const int pairs = static_cast<int>(rays.size() * (rays.size() - 1) / 2), stride = 1 + pairs / kMostPairsOfPoint;
    int most = 1, pair = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < rays.size(); ++a)
      for (std::size_t b = a + 1; b < rays.size(); ++b) {
        if (pair++ % stride != 0) continue;
        const auto position = meeting_point(rays[a].first->centre, rays[a].second->direction, rays[b].first->centre,
                                            rays[b].second->direction);
        if (!position) continue;
        int inliers = 0;
        double sum = 0.0;
        for (const auto& [view, point] : rays) {
          const double distance = residual(*view, *point, *position);
          if (distance > max_residual_) continue;
          ++inliers;
          sum += distance;
        }
        if (inliers < 2 || inliers < most || (inliers == most && sum >= least)) continue;
        most = inliers;
        least = sum;
        body[i] = *position;
      }
  }
  return body;
}

PersonGroup PersonGrouper::grow(const Frame& frame, const Body& body) const {
  std::vector<bool> mirrored;
  PersonGroup group = assign(frame, body, max_residual_, mirrored);
  if (group.views < 2) return group;
  group = assign(frame, triangulated(frame, group, mirrored), max_residual_, mirrored);
  group.middle = middle_of(group.body);
  return group;
}

std::vector<PersonGroup> PersonGrouper::find(const std::vector<People>& people) const {
  const Frame frame = seen(people);
  std::vector<PersonGroup> grown;
  for (const Proposal& proposal : proposals(frame)) {
    const bool known = std::any_of(grown.begin(), grown.end(), [&](const PersonGroup& group) {
      return group.views > 2 && group.chosen[as_size(proposal.camera[0])] == proposal.person[0] &&
             group.chosen[as_size(proposal.camera[1])] == proposal.person[1];
    });
    if (known) continue;
    PersonGroup group = grow(frame, proposal.body);
    if (group.views >= 2 && has_size_of_body(group.body)) grown.push_back(std::move(group));
    if (grown.size() >= kMostGrown) break;
  }
  std::stable_sort(grown.begin(), grown.end(), is_better);
  std::vector<PersonGroup> found;
  std::set<std::pair<std::size_t, int>> taken;
  for (const PersonGroup& group : grown) {
    bool is_free = true;
    for (std::size_t c = 0; c < views_.size(); ++c) is_free &= taken.count({c, group.chosen[c]}) == 0;
    if (!is_free) continue;
    for (std::size_t c = 0; c < views_.size(); ++c)
      if (group.chosen[c] >= 0) taken.emplace(c, group.chosen[c]);
    found.push_back(group);
  }
  return found;
}

PersonGroup PersonGrouper::match(const std::vector<People>& people, const Body& body, double tolerance) const {
  std::vector<bool> mirrored;
  return assign(seen(people), body, tolerance * max_residual_, mirrored);
}

}  // namespace doppel
