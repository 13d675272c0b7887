#include "doppel/detect/keypoints/person_groups.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr int kMinShared = 4;                      ///< points of a body that a detection must show to agree
constexpr double kShareOfAgreement = 0.5;          ///< of these points
constexpr double kMinAngle = 0.03;                 ///< radians between two rays
constexpr double kMinBody = 0.03, kMaxBody = 3.0;  ///< metres; median distance of the points from the middle
constexpr std::size_t kMaxGrown = 400;             ///< proposals looked at in one frame
constexpr int kMaxPairsOfPoint = 60;
constexpr int kAllPairsUpTo = 8;  ///< cameras

/// Length of the residual; infinite behind the camera.
double distance(const Sight& sight, const Vector3d& position) {
  const auto residual = residual_of(sight, position);
  return residual ? residual->norm() : std::numeric_limits<double>::infinity();
}

Vector3d middle_of(const std::vector<std::optional<Vector3d>>& body) {
  Vector3d middle = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto& point : body)
      if (point) values.push_back((*point)[axis]);
    if (!values.empty()) middle[axis] = median(values);
  }
  return middle;
}

/// Whether the points lie as closely together as those of a body.
bool has_size_of_body(const std::vector<std::optional<Vector3d>>& body) {
  const Vector3d middle = middle_of(body);
  std::vector<double> distances;
  for (const auto& point : body)
    if (point) distances.push_back((*point - middle).norm());
  if (static_cast<int>(distances.size()) < kMinShared) return false;
  const double size = median(distances);
  return size >= kMinBody && size <= kMaxBody;
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
    : cameras_(cameras), mirrored_(std::move(mirrored)), max_residual_(max_residual) {
  for (const Camera& camera : cameras)
    if (camera.height <= 0) fail("following a person: the size of the images of camera '{}' is not known", camera.name);
}

PersonGrouper::Frame PersonGrouper::seen(const std::vector<People>& people) const {
  Frame frame(cameras_.size());
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    // From the plane at depth 1 to shares of the image's height.
    const double heights_per_unit = 0.5 * (cameras_[c].K(0, 0) + cameras_[c].K(1, 1)) / cameras_[c].height;
    for (const Person& person : people.at(c)) {
      Detection detection(mirrored_.size());
      if (person.size() != mirrored_.size())
        fail("following a person: a person has {} points, the layout has {}", person.size(), mirrored_.size());
      for (std::size_t i = 0; i < person.size(); ++i) {
        if (person[i].confidence <= 0.0f) continue;
        detection[i] = sight_of(cameras_[c], {person[i].x, person[i].y});
        if (detection[i]) detection[i]->unit_from_plane = heights_per_unit * Eigen::Matrix2d::Identity();
      }
      frame[c].push_back(std::move(detection));
    }
  }
  return frame;
}

/// Adds the body that two detections make, in the order of the first, if its points are near both.
void PersonGrouper::propose(const Frame& frame, Proposal proposal, std::vector<Proposal>& all) const {
  const Detection& first = frame[proposal.camera[0]][proposal.person[0]];
  const Detection& second = frame[proposal.camera[1]][proposal.person[1]];
  Proposal best;
  best.residual = std::numeric_limits<double>::infinity();
  for (const bool mirrored : {false, true}) {
    proposal.body.assign(first.size(), std::nullopt);
    std::vector<double> residuals;
    for (std::size_t i = 0; i < first.size(); ++i) {
      const SeenPoint& other = second[mirrored ? as_size(mirrored_[i]) : i];
      if (!first[i] || !other) continue;
      const auto position = meeting_point(*first[i], *other, kMinAngle);
      if (!position) continue;
      residuals.push_back(std::max(distance(*first[i], *position), distance(*other, *position)));
      if (residuals.back() <= max_residual_) proposal.body[i] = *position;
    }
    if (static_cast<int>(residuals.size()) < kMinShared) continue;
    proposal.residual = median(residuals);
    if (proposal.residual < best.residual) best = proposal;
  }
  if (best.residual <= max_residual_ && has_size_of_body(best.body)) all.push_back(std::move(best));
}

std::vector<PersonGrouper::Proposal> PersonGrouper::proposals(const Frame& frame) const {
  std::vector<Proposal> all;
  const int cameras = static_cast<int>(cameras_.size());
  for (const int step : steps_between(cameras))
    for (int a = 0; a < cameras; ++a) {
      const int b = (a + step) % cameras;
      if (2 * step == cameras && a >= b) continue;  // this pair was seen from the other side
      for (std::size_t p = 0; p < frame[a].size(); ++p)
        for (std::size_t q = 0; q < frame[b].size(); ++q)
          propose(frame, {0.0, {a, b}, {static_cast<int>(p), static_cast<int>(q)}, {}}, all);
    }
  std::sort(all.begin(), all.end(), [](const Proposal& x, const Proposal& y) { return x.residual < y.residual; });
  return all;
}

PersonGrouper::Fit PersonGrouper::fit(const Detection& detection, const Body& body, double limit, bool mirrored) const {
  Fit result;
  result.mirrored = mirrored;
  for (std::size_t i = 0; i < body.size(); ++i) {
    const SeenPoint& point = detection[mirrored ? as_size(mirrored_[i]) : i];
    if (!body[i] || !point) continue;
    ++result.shared;
    const double apart = distance(*point, *body[i]);
    if (!(apart <= limit)) continue;
    ++result.agreeing;
    result.sum += apart;
  }
  const bool agrees = result.shared >= kMinShared && result.agreeing >= kShareOfAgreement * result.shared;
  if (!agrees) result.agreeing = 0;
  return result;
}

/// The detections that agree with a body, at most one of each camera. @param mirrored [C] set to their orders
PersonGroup PersonGrouper::assign(const Frame& frame, const Body& body, double limit,
                                  std::vector<bool>& mirrored) const {
  PersonGroup group;
  group.body = body;
  group.chosen.assign(cameras_.size(), -1);
  mirrored.assign(cameras_.size(), false);
  double sum = 0.0;
  int agreeing = 0;
  for (std::size_t c = 0; c < cameras_.size(); ++c) {
    Fit best;
    for (std::size_t p = 0; p < frame[c].size(); ++p)
      for (const bool swapped : {false, true}) {
        const Fit found = fit(frame[c][p], body, limit, swapped);
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

/// The points of a group, each from the views that agree.
PersonGrouper::Body PersonGrouper::triangulated(const Frame& frame, const PersonGroup& group,
                                                const std::vector<bool>& mirrored) const {
  TriangulationOptions options;
  options.inlier_threshold = max_residual_;
  options.smallest_angle = kMinAngle;
  options.most_pairs = kMaxPairsOfPoint;
  Body body(mirrored_.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    std::vector<Sight> sights;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (group.chosen[c] < 0) continue;
      const SeenPoint& point = frame[c][group.chosen[c]][mirrored[c] ? as_size(mirrored_[i]) : i];
      if (point) sights.push_back(*point);
    }
    if (const auto point = triangulate(sights, options)) body[i] = point->position;
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
      return group.views > 2 && group.chosen[proposal.camera[0]] == proposal.person[0] &&
             group.chosen[proposal.camera[1]] == proposal.person[1];
    });
    if (known) continue;
    PersonGroup group = grow(frame, proposal.body);
    if (group.views >= 2 && has_size_of_body(group.body)) grown.push_back(std::move(group));
    if (grown.size() >= kMaxGrown) break;
  }
  std::stable_sort(grown.begin(), grown.end(), is_better);
  std::vector<PersonGroup> found;
  std::set<std::pair<std::size_t, int>> taken;
  for (const PersonGroup& group : grown) {
    bool is_free = true;
    for (std::size_t c = 0; c < cameras_.size(); ++c) is_free &= taken.count({c, group.chosen[c]}) == 0;
    if (!is_free) continue;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
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
