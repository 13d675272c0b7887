#include "doppel/calibration/estimation/world_by_person.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/calibration/estimation/stature.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/solver/residuals.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr double kMinPerson = 0.9, kMaxPerson = 2.35, kUsualStature = 1.7;              // metres
constexpr double kHeightOfAnkle = 0.047, kHeightOfHeel = 0.018, kHeightOfToes = 0.015;  // above the floor; of stature
constexpr double kRaisedFoot = 0.03;  // of stature; above the other foot
constexpr int kUprightSteps = 5;
constexpr std::size_t kMinTimes = 10;
constexpr double kMinUprightness = 0.5;   // length of the median direction
constexpr double kHeightNoise = 0.012;    // of the lower foot; of stature
constexpr double kDependentTimes = 10.0;  // whose errors are about the same
constexpr double kLeaning = 0.1;          // radians; of the upright direction against up
constexpr int kFloorSteps = 10;
constexpr double kRoomRadius = 3.0;  // metres; mean distance of cameras from their middle

/// A person's points at some times; NaN: not found.
class PersonInSpace {
 public:
  PersonInSpace(const std::vector<Camera>& cameras, const PointTracks& tracks, std::size_t most_times)
      : points_(as_size(tracks.num_points())) {
    for (const double time : tracks.times(most_times)) {
      for (int k = 0; k < tracks.num_points(); ++k) {
        const auto found = triangulate(cameras, seen_at(tracks, time, k), TriangulationOptions());
        points_[k].push_back(found ? found->position : nowhere());
      }
      ++times_;
    }
  }

  std::size_t times() const { return times_; }
  Vector3d at(std::size_t time, int point) const { return point < 0 ? nowhere() : points_[point][time]; }
  Vector3d middle(std::size_t time, const BodyPointIndices::Pair& pair) const {
    return 0.5 * (at(time, pair[0]) + at(time, pair[1]));
  }
  /// The median of a number over the times at which it is finite; 0: never.
  template <typename Number>
  double typical(const Number& number) const {
    std::vector<double> values;
    for (std::size_t t = 0; t < times_; ++t)
      if (const double value = number(t); std::isfinite(value)) values.push_back(value);
    return values.size() < kMinTimes ? 0.0 : median(std::move(values));
  }

 private:
  static Vector3d nowhere() { return Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()); }

  std::vector<std::vector<Vector3d>> points_;  ///< [K, T]
  std::size_t times_ = 0;
};

double stature_of(const PersonInSpace& person, const BodyPointIndices& points) {
  const auto length = [&](int a, int b) {
    return person.typical([&](std::size_t t) { return (person.at(t, a) - person.at(t, b)).norm(); });
  };
  std::vector<double> legs;
  for (const std::size_t side : {0U, 1U}) {
    const double thigh = length(points.hips[side], points.knees[side]);
    const double shank = length(points.knees[side], points.ankles[side]);
    if (thigh > 0.0 && shank > 0.0) legs.push_back(thigh + shank);
  }
  const double trunk = person.typical(
      [&](std::size_t t) { return (person.middle(t, points.shoulders) - person.middle(t, points.hips)).norm(); });
  return stature_by(mean_of(legs), trunk);
}

/// The lower ankle, or the middle of both where none is raised: the weight of the person is above.
Vector3d support(const PersonInSpace& person, const BodyPointIndices& points, std::size_t t, const Vector3d& up,
                 double stature) {
  const Vector3d left = person.at(t, points.ankles[0]), right = person.at(t, points.ankles[1]);
  const double higher = up.dot(left - right);
  if (std::abs(higher) < kRaisedFoot * stature) return 0.5 * (left + right);
  return higher > 0.0 ? right : left;
}

Vector3d upright_direction(const PersonInSpace& person, const BodyPointIndices& points, double stature) {
  Vector3d up = Vector3d::Zero();  // at first, both feet count
  for (int step = 0; step < kUprightSteps; ++step) {
    Vector3d next;
    for (int axis = 0; axis < 3; ++axis)
      next[axis] = person.typical([&](std::size_t t) {
        const Vector3d trunk = 0.5 * (person.middle(t, points.shoulders) + person.middle(t, points.hips));
        return (trunk - support(person, points, t, up, stature)).normalized()[axis];
      });
    if (!(next.norm() >= kMinUprightness))
      fail(
          "finding the world: shoulders and ankles were not seen together, or the person does not stand upright; give "
          "a recording of a person who walks, seen from head to foot");
    up = next.normalized();
  }
  return up;
}

/// The plane up . p = height.
struct Floor {
  Vector3d up;
  double height;
  double spread;  ///< root mean square distance of the standing feet
};

/// The position on the floor below the lower foot of each time, as if `up` were up.
std::vector<Vector3d> footprints(const PersonInSpace& person, const BodyPointIndices& points, const Vector3d& up,
                                 double stature) {
  std::vector<Vector3d> prints;
  for (std::size_t t = 0; t < person.times(); ++t) {
    std::optional<Vector3d> lowest;
    for (const auto& [pair, height] :
         {std::pair{points.ankles, kHeightOfAnkle}, {points.heels, kHeightOfHeel}, {points.toes, kHeightOfToes}})
      for (const int point : pair) {
        const Vector3d print = person.at(t, point) - height * stature * up;
        if (print.allFinite() && (!lowest || up.dot(print) < up.dot(*lowest))) lowest = print;
      }
    if (lowest) prints.push_back(*lowest);
  }
  return prints;
}

/// One step of robust least squares for the slope of the floor and its height.
Floor next_floor(const std::vector<Vector3d>& prints, const Vector3d& upright, const Floor& floor, double noise) {
  const Vector3d a = upright.unitOrthogonal(), b = upright.cross(a);
  const RobustKernel kernel = RobustKernel::geman_mcclure_of(3.0 * noise);
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  double weights = 0.0, squares = 0.0;
  for (const Vector3d& print : prints) {
    const double off = floor.up.dot(print) - floor.height;
    const double weight = kernel.weight(off * off);
    weights += weight;
    squares += weight * off * off;
    // upright . p + slope_a a . p + slope_b b . p - height = 0
    const Vector3d row(a.dot(print), b.dot(print), -1.0);
    hessian += weight / (kDependentTimes * noise * noise) * row * row.transpose();
    right -= weight / (kDependentTimes * noise * noise) * upright.dot(print) * row;
  }
  hessian(0, 0) += 1.0 / (kLeaning * kLeaning);
  hessian(1, 1) += 1.0 / (kLeaning * kLeaning);
  const Vector3d found = solve_symmetric(hessian, right);
  const Vector3d normal = upright + found[0] * a + found[1] * b;
  return {normal.normalized(), found[2] / normal.norm(), std::sqrt(squares / std::max(weights, 1e-12))};
}

Floor floor_of(const PersonInSpace& person, const BodyPointIndices& points, const Vector3d& upright, double stature) {
  std::vector<double> heights;
  std::vector<Vector3d> prints = footprints(person, points, upright, stature);
  for (const Vector3d& print : prints) heights.push_back(upright.dot(print));
  if (heights.size() < kMinTimes)
    fail("finding the world: a foot was found at only {} times; {} are needed", heights.size(), kMinTimes);
  Floor floor{upright, median(std::move(heights)), 0.0};
  for (int step = 0; step < kFloorSteps; ++step) {
    prints = footprints(person, points, floor.up, stature);
    floor = next_floor(prints, upright, floor, kHeightNoise * stature);
  }
  return floor;
}

/// The factor after which the cameras stand as far from their middle as in a room: thresholds in metres then have their
/// meaning in a world of any unit.
double room_scale(const std::vector<Camera>& cameras) {
  const auto count = static_cast<double>(cameras.size());
  Vector3d middle = Vector3d::Zero();
  for (const Camera& camera : cameras) middle += camera.centre() / count;
  double spread = 0.0;
  for (const Camera& camera : cameras) spread += (camera.centre() - middle).norm() / count;
  return spread > 0.0 ? kRoomRadius / spread : 1.0;
}

void check_points(const BodyPointIndices& points) {
  for (const BodyPointIndices::Pair& pair : {points.shoulders, points.hips, points.ankles})
    if (std::min(pair[0], pair[1]) < 0)
      fail("finding the world: the detector must find shoulders, hips and ankles of both sides");
}

}  // namespace

WorldByPerson world_by_person(const std::vector<Camera>& cameras, const PointTracks& tracks,
                              const BodyPointIndices& points, const WorldOptions& options) {
  check_tracks(cameras, tracks, 2, "finding the world");
  check_points(points);
  if (options.stature && !(*options.stature > 0.0 && std::isfinite(*options.stature)))
    fail<UsageError>("finding the world: the person's height is {} m; it must be positive", *options.stature);
  Similarity room;
  room.scale = room_scale(cameras);
  std::vector<Camera> in_room;
  for (const Camera& camera : cameras) in_room.push_back(transformed(camera, room));
  const PersonInSpace person(in_room, tracks, options.most_times);
  const double stature = stature_of(person, points);
  if (!(stature > 0.0))
    fail("finding the world: neither legs nor trunk of the person were found by two cameras at {} times or more",
         kMinTimes);
  const Floor floor = floor_of(person, points, upright_direction(person, points, stature), stature);

  WorldByPerson found;
  const double old_stature = stature / room.scale;
  found.scaled = options.stature || old_stature < kMinPerson || old_stature > kMaxPerson;
  found.stature = found.scaled ? options.stature.value_or(kUsualStature) : old_stature;
  const double metres = found.stature / stature;  // per unit of the room
  found.world.scale = room.scale * metres;
  found.world.rotation = rotation_between(floor.up, Vector3d::UnitY()).toRotationMatrix();
  Vector3d middle;
  for (int axis = 0; axis < 3; ++axis)
    middle[axis] =
        person.typical([&](std::size_t t) { return (found.world.rotation * person.middle(t, points.hips))[axis]; });
  found.world.shift = -metres * Vector3d(middle.x(), floor.height, middle.z());
  found.turn = std::acos(std::clamp(floor.up.y(), -1.0, 1.0));
  found.floor_spread = metres * floor.spread;
  return found;
}

}  // namespace doppel
