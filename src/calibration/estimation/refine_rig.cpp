#include "doppel/calibration/estimation/refine_rig.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "doppel/calibration/estimation/align_cameras.h"
#include "doppel/calibration/estimation/bundle_problem.h"
#include "doppel/calibration/estimation/epipolar.h"
#include "doppel/calibration/estimation/reprojection.h"
#include "doppel/core/error.h"
#include "doppel/core/statistics.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr long kMinObservations = 40;   // of a camera that is refined
constexpr std::size_t kMinPoints = 30;  // in space
constexpr double kMinSpread = 0.02;     // metres; root mean square distance of the points from their middle
constexpr double kScaleOfBundleMedian = 3.0;
constexpr int kMaxRounds = 10, kMaxRoundsOfOutlines = 25;
constexpr std::size_t kObservationsOfBin = 300, kMaxBins = 12;  // of similar confidence
constexpr double kMinMedian = 0.05;                             // pixels of an image 1024 wide
constexpr double kSettled = 0.05;                            // relative change of the kernel's scale in the last round
constexpr double kSettledTurn = 1e-5, kSettledShift = 1e-5;  // radians and metres of a camera in the last round
constexpr double kMaxTangentWeight = 4.0;                    // weight of a tangent's residual against that of a point
constexpr double kMinThreshold = 25.0;                       // pixels of an image 1024 wide; inliers of a triangulation
constexpr double kClippedDistance = 100.0;  // pixels of an image 1024 wide; as much as one distance adds to a mean
constexpr double kSecondsOfBundleStretch = 0.5;

void check_takes(const std::vector<Camera>& cameras, const std::vector<RigTake>& takes) {
  if (takes.empty()) fail<UsageError>("refining a rig: no take is given");
  for (const RigTake& take : takes) {
    check_tracks(cameras, take.tracks, 2, "refining a rig");
    if (take.tracks.points != takes.front().tracks.points)
      fail<UsageError>("refining a rig: the takes have different points of the person");
    check_outlines(cameras, take.outlines, "refining a rig");
  }
}

void check_refine_options(const std::vector<Camera>& cameras, const PointTracks& tracks, const RefineOptions& options) {
  if (!(options.kernel > 0.0) || !(options.limb_sigma > 0.0) || !(options.largest_start_error > 0.0))
    fail<UsageError>("refining a rig: kernel, limb_sigma and largest_start_error must be positive; they are {}, {}, {}",
                     options.kernel, options.limb_sigma, options.largest_start_error);
  for (const int camera : options.fixed)
    if (camera < 0 || camera >= static_cast<int>(cameras.size()))
      fail<UsageError>("refining a rig: camera {} is to be fixed; there are {} cameras, counted from 0", camera,
                       cameras.size());
  if (std::set<int>(options.fixed.begin(), options.fixed.end()).size() == cameras.size())
    fail<UsageError>("refining a rig: all {} cameras are fixed, so nothing is left to refine; fix fewer",
                     cameras.size());
  for (const Limb& limb : options.limbs)
    if (std::min(limb[0], limb[1]) < 0 || std::max(limb[0], limb[1]) >= tracks.num_points() || limb[0] == limb[1])
      fail<UsageError>("refining a rig: a limb joins the points {} and {}; there are {} points, counted from 0",
                       limb[0], limb[1], tracks.num_points());
}

/// A take, the times of it that are used, and the number of the first stretch of time (Bundle::Point::stretch).
struct TimedTake {
  const RigTake& recording;
  std::vector<double> times;
  int first_stretch;

  int stretch(double time) const {
    return first_stretch + static_cast<int>((time - times.front()) / kSecondsOfBundleStretch);
  }
};

std::vector<TimedTake> timed_takes(const std::vector<RigTake>& takes, std::size_t most_times) {
  const std::vector<std::vector<double>> times = times_of_takes(takes, most_times);
  std::vector<TimedTake> timed;
  int stretches = 0;
  for (std::size_t i = 0; i < takes.size(); ++i) {
    if (times[i].empty()) continue;
    timed.push_back({takes[i], times[i], stretches});
    stretches = timed.back().stretch(times[i].back()) + 1;
  }
  return timed;
}

/// The points of all times, triangulated from cameras that take part.
Bundle bundle_of(const std::vector<Camera>& cameras, const std::vector<TimedTake>& takes,
                 const std::vector<bool>& takes_part, double threshold, const std::vector<Limb>& limbs) {
  Bundle bundle;
  bundle.cameras = cameras;
  TriangulationOptions options;
  options.inlier_threshold = threshold;
  std::vector<std::vector<double>> limb_lengths(limbs.size());
  int group = 0;
  const auto add_time = [&](const TimedTake& take, double time) {
    const PointTracks& tracks = take.recording.tracks;
    std::vector<int> index(tracks.num_points(), -1);
    for (int k = 0; k < tracks.num_points(); ++k) {
      std::vector<SeenFrom> seen = seen_at(tracks, time, k);
      std::erase_if(seen, [&](const SeenFrom& view) { return !takes_part[view.camera]; });
      const auto point = triangulate(cameras, seen, options);
      if (!point || !point->position.allFinite()) continue;
      index[k] = static_cast<int>(bundle.points.size());
      bundle.points.push_back({point->position, group, take.stretch(time)});
      for (const SeenFrom& view : seen)
        bundle.observations.push_back({view.camera, index[k], view.seen.pixel, view.seen.confidence});
    }
    for (std::size_t l = 0; l < limbs.size(); ++l) {
      const int a = index[limbs[l][0]], b = index[limbs[l][1]];
      if (a < 0 || b < 0) continue;
      bundle.links.push_back({{a, b}, static_cast<int>(l)});
      limb_lengths[l].push_back((bundle.points[a].position - bundle.points[b].position).norm());
    }
    if (!bundle.points.empty() && bundle.points.back().group == group) ++group;
  };
  for (const TimedTake& take : takes)
    for (const double time : take.times) add_time(take, time);
  for (const std::vector<double>& lengths : limb_lengths) bundle.lengths.push_back(quantile(lengths, 0.5));
  return bundle;
}

/// Adds the frontier points of a pair of cameras, each seen by these two.
void add_frontier_points(Bundle& bundle, const std::vector<TimedTake>& takes, int a, int b, double threshold) {
  const FrontierFinder finder(bundle.cameras[a], bundle.cameras[b]);
  TriangulationOptions options;
  options.inlier_threshold = threshold;
  const auto add = [&](const TimedTake& take, double time, int side) {
    const auto find = [&](int which, int camera) {
      const double frame = take.recording.tracks.cameras[camera].frame_at(time);
      return finder.find(which, take.recording.outlines[camera], frame, side);
    };
    const auto in_a = find(0, a), in_b = find(1, b);
    if (!in_a || !in_b) return;
    const auto point = triangulate(bundle.cameras, {{a, {*in_a, 1.0}}, {b, {*in_b, 1.0}}}, options);
    if (!point || !point->position.allFinite()) return;
    const int index = static_cast<int>(bundle.points.size());
    bundle.points.push_back({point->position, bundle.points.back().group + 1, take.stretch(time)});
    bundle.observations.push_back({a, index, *in_a});
    bundle.observations.push_back({b, index, *in_b});
  };
  for (const TimedTake& take : takes) {
    if (take.recording.outlines.empty()) continue;
    for (const double time : take.times)
      for (const int side : {0, 1}) add(take, time, side);
  }
}

/// The distances of the observations from the points, pixels of an image 1024 wide times `scale`.
std::vector<double> residuals_of(const Bundle& bundle) {
  std::vector<double> residuals;
  for (const Bundle::Observation& seen : bundle.observations) {
    const Camera& camera = bundle.cameras[seen.camera];
    const Vector3d& point = bundle.points[seen.point].position;
    const bool in_front = camera.camera_from_world(point).z() > 0.0;
    residuals.push_back(in_front
                            ? seen.scale * rig_reference_pixels(camera) * (camera.project(point) - seen.pixel).norm()
                            : kRigReferenceWidth);
  }
  return residuals;
}

/// The distances as if each point in space were known: one that is fitted to n pixels takes up 3 of their 2 n
/// coordinates.
std::vector<double> errors_of(const Bundle& bundle) {
  std::vector<double> errors = residuals_of(bundle), views(bundle.points.size(), 0.0);
  for (const Bundle::Observation& seen : bundle.observations) views[seen.point] += 1.0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double coordinates = 2.0 * views[bundle.observations[i].point];
    errors[i] *= std::sqrt(coordinates / std::max(1.0, coordinates - 3.0));
  }
  return errors;
}

/// Scales the residuals by what the detector's confidence is worth: observations of similar confidence are as far off
/// as their median says. Frontier points, which follow the `points` observations of points, are scaled together.
void weigh(Bundle& bundle, std::size_t points) {
  for (Bundle::Observation& seen : bundle.observations) seen.scale = 1.0;
  const std::vector<double> errors = errors_of(bundle);
  std::vector<std::size_t> order(points);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return bundle.observations[a].confidence < bundle.observations[b].confidence;
  });
  const std::size_t bins = std::clamp<std::size_t>(order.size() / kObservationsOfBin, 1, kMaxBins);
  std::vector<double> medians;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    std::vector<double> of_bin;
    for (std::size_t i = bin * order.size() / bins; i < (bin + 1) * order.size() / bins; ++i)
      of_bin.push_back(errors[order[i]]);
    medians.push_back(std::max(kMinMedian, quantile(std::move(of_bin), 0.5)));
  }
  const double best = *std::min_element(medians.begin(), medians.end());
  for (std::size_t bin = 0; bin < bins; ++bin)
    for (std::size_t i = bin * order.size() / bins; i < (bin + 1) * order.size() / bins; ++i)
      bundle.observations[order[i]].scale = best / medians[bin];
  std::vector<double> of_tangents(errors.begin() + static_cast<std::ptrdiff_t>(points), errors.end());
  const double median = std::max(kMinMedian, quantile(std::move(of_tangents), 0.5));
  for (std::size_t i = points; i < errors.size(); ++i)
    bundle.observations[i].scale = std::min(kMaxTangentWeight, best / median);
}

/// The cameras that are tied to each other by points: the largest such set.
std::vector<bool> largest_set(const Bundle& bundle, const std::vector<long>& observations) {
  std::vector<int> parent(bundle.cameras.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int c) {
    while (parent[c] != c) c = parent[c];
    return c;
  };
  for (std::size_t i = 1; i < bundle.observations.size(); ++i) {
    const Bundle::Observation &a = bundle.observations[i - 1], &b = bundle.observations[i];
    if (a.point == b.point) parent[root(a.camera)] = root(b.camera);
  }
  std::map<int, long> sizes;
  for (std::size_t c = 0; c < parent.size(); ++c) sizes[root(static_cast<int>(c))] += observations[c];
  const auto largest =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<bool> inside;
  for (std::size_t c = 0; c < parent.size(); ++c) inside.push_back(root(static_cast<int>(c)) == largest->first);
  return inside;
}

std::vector<long> observations_per_camera(const Bundle& bundle) {
  std::vector<long> counts(bundle.cameras.size(), 0);
  for (const Bundle::Observation& seen : bundle.observations) ++counts[seen.camera];
  return counts;
}

void check_points(const Bundle& bundle) {
  if (bundle.points.size() < kMinPoints)
    fail(
        "refining a rig: only {} points were seen by two cameras at the same time, {} are needed; give more frames, "
        "or check the offsets of the cameras",
        bundle.points.size(), kMinPoints);
  Vector3d middle = Vector3d::Zero();
  const auto count = static_cast<double>(bundle.points.size());
  for (const Bundle::Point& point : bundle.points) middle += point.position / count;
  double spread = 0.0;
  for (const Bundle::Point& point : bundle.points) spread += (point.position - middle).squaredNorm() / count;
  if (!(std::sqrt(spread) >= kMinSpread))
    fail(
        "refining a rig: all points lie within {:.3f} m of one position; points all over a person who moves are needed",
        std::sqrt(spread));
}

/// Whether no camera turned or moved, apart from a similarity of the world.
bool are_settled(const std::vector<Camera>& cameras, const std::vector<Camera>& before) {
  const Similarity world = align_cameras(cameras, before);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Camera aligned = transformed(cameras[c], world);
    if (!(Eigen::AngleAxisd(aligned.R * before[c].R.transpose()).angle() <= kSettledTurn) ||
        !((aligned.centre() - before[c].centre()).norm() <= kSettledShift))
      return false;
  }
  return true;
}

/// The run of one refinement: rounds of least squares whose robust kernel narrows.
class Refinement {
 public:
  Refinement(const std::vector<Camera>& cameras, const std::vector<RigTake>& takes, const RefineOptions& options)
      : takes_(timed_takes(takes, options.most_times)),
        options_(options),
        cameras_(cameras),
        takes_part_(cameras.size(), true) {
    for (const RigTake& take : takes) has_outlines_ = has_outlines_ || !take.outlines.empty();
  }

  RigRefinement run() {
    const std::vector<Camera> initial = cameras_;
    Bundle bundle = first_bundle();
    double kernel = next_kernel(bundle);
    const int rounds = has_outlines_ ? kMaxRoundsOfOutlines : kMaxRounds;
    for (int round = 0; round < rounds; ++round) {
      const std::vector<Camera> before = cameras_;
      bundle = adjusted(std::move(bundle), kernel);
      const double narrower = std::min(kernel, next_kernel(bundle));
      const bool settled = kernel - narrower <= kSettled * kernel;
      kernel = narrower;
      if (settled && (!has_outlines_ || (round > 0 && are_settled(cameras_, before)))) break;
      if (round + 1 < rounds) bundle = next_bundle(kernel);
    }
    align(initial, bundle);
    return result(initial, std::move(bundle), kernel);
  }

 private:
  Bundle first_bundle() {
    const auto make = [&] {
      return bundle_of(cameras_, takes_, takes_part_, options_.largest_start_error, options_.limbs);
    };
    Bundle bundle = make();
    check_points(bundle);
    reasons_.assign(cameras_.size(), "");
    const std::vector<long> counts = observations_per_camera(bundle);
    const std::vector<bool> tied = largest_set(bundle, counts);
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (counts[c] < kMinObservations)
        reasons_[c] = fmt::format("it saw only {} points together with another camera", counts[c]);
      else if (!tied[c])
        reasons_[c] = "it shares no points with the other cameras";
      takes_part_[c] = reasons_[c].empty();
    }
    if (std::count(takes_part_.begin(), takes_part_.end(), true) < 2)
      fail("refining a rig: no two cameras saw the same {} points; check the offsets and the calibration",
           kMinObservations);
    check_free_cameras();
    bundle = make();
    check_points(bundle);
    num_points_ = bundle.observations.size();
    weigh(bundle, num_points_);
    return bundle;
  }

  /// Without a camera that may move there is no unknown.
  void check_free_cameras() const {
    std::string reasons;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (std::count(options_.fixed.begin(), options_.fixed.end(), static_cast<int>(c)) > 0) continue;
      if (takes_part_[c]) return;
      reasons += fmt::format("{}{}: {}", reasons.empty() ? "" : "; ", cameras_[c].name, reasons_[c]);
    }
    fail<UsageError>("refining a rig: no camera that is not fixed can be refined ({}); fix fewer", reasons);
  }

  /// The points and frontier points by the cameras of the last round.
  Bundle next_bundle(double kernel) {
    const double threshold = std::max(kMinThreshold, 2.0 * kernel);
    Bundle bundle = bundle_of(cameras_, takes_, takes_part_, threshold, options_.limbs);
    check_points(bundle);
    num_points_ = bundle.observations.size();
    if (has_outlines_)
      for (const auto& [a, b] : pairs_to_compare(cameras_))
        if (takes_part_[a] && takes_part_[b]) add_frontier_points(bundle, takes_, a, b, threshold);
    weigh(bundle, num_points_);
    return bundle;
  }

  double next_kernel(const Bundle& bundle) const {
    std::vector<double> residuals = residuals_of(bundle);
    residuals.resize(num_points_);
    return std::max(options_.kernel, kScaleOfBundleMedian * quantile(std::move(residuals), 0.5));
  }

  BundleOptions bundle_options(double kernel) const {
    BundleOptions options{options_.focal, options_.principal_point, {}, kernel, options_.limb_sigma};
    for (const bool takes_part : takes_part_) options.fixed.push_back(!takes_part);
    for (const int camera : options_.fixed) options.fixed[camera] = true;
    return options;
  }

  Bundle adjusted(Bundle bundle, double kernel) {
    BundleProblem problem(std::move(bundle), bundle_options(kernel));
    Eigen::VectorXd state = problem.initial_state();
    SolverOptions solver;
    solver.iterations = 30;
    solver.function_tolerance = 1e-6;
    summary_ = minimise(problem, state, solver);
    Bundle result = problem.bundle(state);
    cameras_ = result.cameras;
    return result;
  }

  /// Brings the cameras that took part back to where they were as a whole.
  void align(const std::vector<Camera>& initial, Bundle& bundle) {
    if (!options_.fixed.empty()) return;
    std::vector<Camera> from, to;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      if (!takes_part_[c]) continue;
      from.push_back(cameras_[c]);
      to.push_back(initial[c]);
    }
    const Similarity world = align_cameras(from, to);
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      if (takes_part_[c]) cameras_[c] = transformed(cameras_[c], world);
    bundle.cameras = cameras_;
    for (Bundle::Point& point : bundle.points)
      point.position = world.scale * world.rotation * point.position + world.shift;
    for (double& length : bundle.lengths) length *= world.scale;
  }

  RigRefinement result(const std::vector<Camera>& initial, Bundle bundle, double kernel) {
    RigRefinement result;
    result.cameras = cameras_;
    result.points = bundle.observations[num_points_ - 1].point + 1;
    result.summary = summary_;
    result.reports.resize(cameras_.size());
    const std::vector<double> residuals = residuals_of(bundle);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      CameraRefinement& report = result.reports[bundle.observations[i].camera];
      if (i >= num_points_) {
        ++report.tangents;
        continue;
      }
      ++report.observations;
      if (residuals[i] <= kernel) report.inliers += 1.0;
    }
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      CameraRefinement& report = result.reports[c];
      report.name = cameras_[c].name;
      if (report.observations > 0) report.inliers /= static_cast<double>(report.observations);
      report.refined = takes_part_[c];
      report.reason = reasons_[c];
      report.rotation_change = Eigen::AngleAxisd(cameras_[c].R * initial[c].R.transpose()).angle();
      report.centre_change = (cameras_[c].centre() - initial[c].centre()).norm();
      report.focal_change = cameras_[c].K(0, 0) / initial[c].K(0, 0) - 1.0;
    }
    add_distances(initial, result);
    add_sigmas(std::move(bundle), kernel, result);
    return result;
  }

  /// [C] the distances of the points of all takes.
  std::vector<std::vector<double>> distances(const std::vector<Camera>& cameras) const {
    std::vector<std::vector<double>> all(cameras.size());
    for (const TimedTake& take : takes_) {
      const auto of_take = reprojection_distances(cameras, take.recording.tracks, take.times);
      for (std::size_t c = 0; c < all.size(); ++c) all[c].insert(all[c].end(), of_take[c].begin(), of_take[c].end());
    }
    return all;
  }

  void add_distances(const std::vector<Camera>& initial, RigRefinement& result) const {
    const auto before = distances(initial), after = distances(cameras_);
    std::vector<double> all_before, all_after;
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      CameraRefinement& report = result.reports[c];
      const auto clipped_mean = [&](std::vector<double> distances) {
        for (double& distance : distances)
          distance = std::min(distance, kClippedDistance / rig_reference_pixels(cameras_[c]));
        return mean_of(distances);
      };
      report.median_before = quantile(before[c], 0.5);
      report.median_after = quantile(after[c], 0.5);
      report.mean_before = clipped_mean(before[c]);
      report.mean_after = clipped_mean(after[c]);
      all_before.insert(all_before.end(), before[c].begin(), before[c].end());
      all_after.insert(all_after.end(), after[c].begin(), after[c].end());
    }
    result.median_before = quantile(all_before, 0.5);
    result.median_after = quantile(all_after, 0.5);
  }

  void add_sigmas(Bundle bundle, double kernel, RigRefinement& result) const {
    BundleProblem problem(std::move(bundle), bundle_options(kernel));
    problem.linearise(problem.initial_state());
    const Eigen::MatrixXd covariance = problem.covariance();
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const int at = problem.camera_index(static_cast<int>(c));
      if (at < 0) continue;
      CameraRefinement& report = result.reports[c];
      report.rotation_sigma = std::sqrt(std::max(0.0, covariance.diagonal().segment<3>(at).sum()));
      report.centre_sigma = std::sqrt(std::max(0.0, covariance.diagonal().segment<3>(at + 3).sum()));
      if (options_.focal) report.focal_sigma = std::sqrt(std::max(0.0, covariance(at + 6, at + 6)));
    }
  }

  std::vector<TimedTake> takes_;
  bool has_outlines_ = false;
  const RefineOptions& options_;
  std::size_t num_points_ = 0;  ///< observations of points in the last bundle; those of frontier points follow
  std::vector<Camera> cameras_;
  std::vector<bool> takes_part_;
  std::vector<std::string> reasons_;
  SolverSummary summary_;
};

}  // namespace

std::vector<std::vector<double>> times_of_takes(const std::vector<RigTake>& takes, std::size_t most) {
  std::vector<std::vector<double>> times;
  std::size_t all = 0;
  for (const RigTake& take : takes) all += times.emplace_back(take.tracks.times()).size();
  if (most == 0 || all <= most) return times;
  for (std::size_t i = 0; i < takes.size(); ++i)
    if (!times[i].empty()) times[i] = takes[i].tracks.times(std::max<std::size_t>(1, times[i].size() * most / all));
  return times;
}

RigRefinement refine_rig(const std::vector<Camera>& cameras, const std::vector<RigTake>& takes,
                         const RefineOptions& options) {
  check_takes(cameras, takes);
  check_refine_options(cameras, takes.front().tracks, options);
  std::vector<RigTake> usable = takes;
  for (RigTake& take : usable) drop_unusable(take.tracks, 0.0);
  return Refinement(cameras, usable, options).run();
}

RigRefinement refine_rig(const std::vector<Camera>& cameras, const PointTracks& tracks, const RefineOptions& options) {
  return refine_rig(cameras, std::vector<RigTake>{{tracks, {}}}, options);
}

}  // namespace doppel
