#include "doppel/data/doctor/body_examination.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "doppel/calibration/estimation/stature.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr double kMinPerson = 0.6, kMaxPerson = 3.0;             ///< metres; beyond, the unit is wrong
constexpr double kMinUsualSize = 0.9, kMaxUsualSize = 2.35;      ///< beyond, the unit is doubtful
constexpr double kLying = 55.0, kUpsideDownAngle = 125.0;        ///< degrees between the trunk and up
constexpr double kCamerasAgree = 35.0;                           ///< degrees between the trunk and the cameras' up
constexpr double kMinInView = 0.7, kMinInViewWarning = 0.95;     ///< share of the body's points in the image
constexpr double kDetectedFault = 0.5, kDetectedWarning = 0.85;  ///< share of the instants
constexpr double kFlipFault = 0.4,
                 kFlipWarning = 0.12;   ///< share of the instants in which left and right are exchanged
constexpr double kClearlyBetter = 0.6;  ///< ratio of the residuals with sides as named and exchanged
constexpr double kMaxGap = 200.0;       ///< degrees without a camera

class BodyMeasurer {
 public:
  BodyMeasurer(const Sightings& seen, const BodyTrack& body) : seen_(seen), body_(body) {}

  /// NaN where a point is not known.
  Vector3d point(int instant, const char* key) const {
    const int k = seen_.point(key);
    return k < 0 ? Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()) : body_.at(instant, k);
  }
  Vector3d middle(int instant, const char* part) const {
    const std::string left = std::string("left_") + part, right = std::string("right_") + part;
    return 0.5 * (point(instant, left.c_str()) + point(instant, right.c_str()));
  }

  /// The median over all instants of a length; 0 when it is never known.
  template <typename Length>
  double typical(const Length& length) const {
    std::vector<double> values;
    for (int i = 0; i < seen_.num_instants(); ++i)
      if (const double value = length(i); std::isfinite(value)) values.push_back(value);
    return median(values);
  }

  double stature() const {
    std::vector<double> legs;
    for (const std::string side : {"left_", "right_"}) {
      const auto part = [&](const char* a, const char* b) {
        return typical([&](int i) { return (point(i, (side + a).c_str()) - point(i, (side + b).c_str())).norm(); });
      };
      const double thigh = part("hip", "knee"), shank = part("knee", "ankle");
      if (thigh > 0.0 && shank > 0.0) legs.push_back(thigh + shank);
    }
    const double trunk = typical([&](int i) { return (middle(i, "shoulder") - middle(i, "hip")).norm(); });
    return stature_by(median(legs), trunk) / seen_.scale;
  }

  /// From the feet, or else the hips, to the shoulders: the median direction.
  Vector3d upward() const {
    Vector3d up;
    for (int axis = 0; axis < 3; ++axis)
      up[axis] = typical([&](int i) { return (middle(i, "shoulder") - middle(i, "hip")).normalized()[axis]; });
    return up;
  }

  /// Share of the instants in which the face and the toes point to the other side than left and right say. Nothing
  /// when it cannot be seen.
  std::optional<double> facing_backwards() const {
    int against = 0, all = 0;
    for (int i = 0; i < seen_.num_instants(); ++i) {
      const Vector3d left =
          point(i, "left_shoulder") - point(i, "right_shoulder") + point(i, "left_hip") - point(i, "right_hip");
      const Vector3d up = middle(i, "shoulder") - middle(i, "hip");
      const Vector3d forward = left.cross(up).normalized();
      double votes = 0.0;
      const Vector3d face = point(i, "nose") - middle(i, "ear");
      const Vector3d left_foot = point(i, "left_bigtoe") - point(i, "left_ankle"),
                     right_foot = point(i, "right_bigtoe") - point(i, "right_ankle");
      for (const Vector3d& direction : {face, left_foot, right_foot})
        if (direction.allFinite() && forward.allFinite()) votes += direction.normalized().dot(forward);
      if (std::abs(votes) < 0.3) continue;
      ++all;
      against += votes < 0.0;
    }
    if (5 * all < seen_.num_instants() || all == 0) return std::nullopt;
    return static_cast<double>(against) / all;
  }

 private:
  const Sightings& seen_;
  const BodyTrack& body_;
};

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180.0 / M_PI;
}

void add_finding(std::vector<Finding>& findings, const std::string& camera, const char* fault, Severity severity,
                 std::string figure, std::string advice) {
  findings.push_back({camera, fault, severity, std::move(figure), std::move(advice)});
}

/// The usual factor between units that makes a person of this size normal.
std::string unit_hint(double stature) {
  for (const auto& [factor, text] : {std::pair(1000.0, "metres where millimetres are"),
                                     {100.0, "metres where centimetres are"},
                                     {10.0, "centimetres where millimetres are"},
                                     {39.37, "metres where inches are"},
                                     {3.2808, "metres where feet are"},
                                     {0.001, "millimetres where metres are"},
                                     {0.01, "centimetres where metres are"},
                                     {0.1, "millimetres where centimetres are"},
                                     {0.3048, "feet where metres are"},
                                     {0.0254, "inches where metres are"}})
    if (stature / factor > 1.2 && stature / factor < 2.2)
      return fmt::format(" The lengths seem to be read as {}.", text);
  return "";
}

void examine_size(double stature, bool other_unit_found, std::vector<Finding>& findings) {
  if (stature <= 0.0 || other_unit_found || (stature > kMinUsualSize && stature < kMaxUsualSize)) return;
  const bool sure = stature < kMinPerson || stature > kMaxPerson;
  add_finding(
      findings, "", faults::kWrongUnit, sure ? Severity::fault : Severity::warning,
      fmt::format("the person is {:.3g} m tall", stature),
      "State the unit of the calibration with `unit: mm`, `cm` or `m` in capture.yaml, or correct its lengths." +
          unit_hint(stature));
}

void examine_up(const Sightings& seen, const Vector3d& body_up, std::vector<Finding>& findings) {
  if (body_up.norm() < 0.5) return;  // no usual direction, as in acrobatics
  const double angle = degrees_between(body_up, Vector3d::UnitY());
  if (angle < kLying) return;
  Vector3d cameras_up = Vector3d::Zero();
  for (const Camera& camera : seen.cameras) cameras_up -= camera.R.row(1).transpose();
  cameras_up /= seen.num_cameras();
  const bool cameras_agree = cameras_up.norm() > 0.4 && degrees_between(body_up, cameras_up) < kCamerasAgree;
  add_finding(
      findings, "", faults::kWrongUp, cameras_agree || angle > kUpsideDownAngle ? Severity::fault : Severity::warning,
      fmt::format("the trunk leans by {:.0f} degrees against the world's up axis{}", angle,
                  cameras_agree ? ", and so do the cameras" : ""),
      "Name the axis of the calibration that points up with `up` in capture.yaml (+x ... -z). If the person really "
      "lies, ignore this.");
}

/// The share of the instants in which a camera's detections fit clearly better with left and right exchanged.
double share_of_flips(const Sightings& seen, int camera, const SupposedView& view, const BodyTrack& body) {
  SupposedView exchanged = view;
  exchanged.sides_swapped = !view.sides_swapped;
  int flips = 0, all = 0;
  for (int i = 0; i < seen.num_instants(); ++i) {
    const ChosenInstants one{{i}, {0}};
    const auto lateral = [&](const SupposedView& supposed) {
      const ViewResiduals residuals = residuals_of(seen, camera, supposed, body, one);
      std::vector<double> shares;
      for (std::size_t r = 0; r < residuals.shares.size(); ++r)
        if (seen.mirrored[residuals.point[r]] != residuals.point[r]) shares.push_back(residuals.shares[r]);
      return shares.size() < 4 ? -1.0 : median(shares);
    };
    const double as_named = lateral(view), other = lateral(exchanged);
    if (as_named < 0.0 || other < 0.0) continue;
    ++all;
    flips += other < kClearlyBetter * as_named && as_named > 2.0 * kAgreementShare;
  }
  return all == 0 ? 0.0 : static_cast<double>(flips) / all;
}

void examine_sides(const Sightings& seen, const RigExamination& rig, const BodyMeasurer& measurer,
                   std::vector<Finding>& findings) {
  for (int c = 0; c < seen.num_cameras(); ++c) {
    const auto unexplained = std::find_if(findings.begin(), findings.end(), [&](const Finding& finding) {
      return finding.camera == seen.cameras[c].name && finding.fault == faults::kDisagrees;
    });
    if (rig.faulty[c] && unexplained == findings.end()) continue;
    const double share = share_of_flips(seen, c, rig.views[c], rig.nominal.body);
    if (share < kFlipWarning) continue;
    if (unexplained != findings.end()) findings.erase(unexplained);  // this explains it
    add_finding(findings, seen.cameras[c].name, faults::kLeftRight,
                share > kFlipFault ? Severity::fault : Severity::warning,
                fmt::format("left and right are exchanged in {:.0f} % of the frames", 100.0 * share),
                "Exchange the left and right points in these frames, or use a detector that confuses them less.");
  }
  const auto backwards = measurer.facing_backwards();
  if (backwards && *backwards > 0.8)
    add_finding(
        findings, "", faults::kLeftRight, Severity::fault,
        fmt::format("face and feet point backwards in {:.0f} % of the frames", 100.0 * *backwards),
        "Left and right of the keypoints are exchanged in all cameras: check `keypoint_map`, and that the videos "
        "are not mirrored.");
}

CameraCoverage coverage_of(const Sightings& seen, const RigExamination& rig, int c, const Vector3d& person) {
  CameraCoverage coverage;
  const SupposedView& view = rig.views[c];
  long inside = 0, all = 0;
  int known = 0, detected = 0;
  std::vector<double> distances;
  for (int i = 0; i < seen.num_instants(); ++i) {
    int points = 0;
    for (int k = 0; k < seen.num_points(); ++k) {
      if (!rig.nominal.body.known(i, k)) continue;
      const auto pixel = view.pixel(rig.nominal.body.at(i, k));
      ++points;
      ++all;
      inside += pixel && pixel->x() >= 0.0 && pixel->y() >= 0.0 && pixel->x() <= seen.cameras[c].width &&
                pixel->y() <= seen.cameras[c].height;
      if (points == 1) distances.push_back(view.camera.camera_from_world(rig.nominal.body.at(i, k)).norm());
    }
    known += points > 0;
    detected += points > 0 && !seen.people[c][i].empty();
  }
  coverage.distance = median(distances) / seen.scale;
  coverage.height = seen.size[c];
  coverage.inside = all == 0 ? 0.0 : static_cast<double>(inside) / static_cast<double>(all);
  coverage.detected = known == 0 ? 0.0 : static_cast<double>(detected) / known;
  const Vector3d away = view.camera.centre() - person;
  coverage.azimuth = std::atan2(away.x(), away.z()) * 180.0 / M_PI;
  return coverage;
}

void examine_view(const Sightings& seen, const RigExamination& rig, const std::vector<CameraCoverage>& cameras,
                  std::vector<Finding>& findings) {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const CameraCoverage& coverage = cameras[c];
    if (rig.faulty[c]) continue;
    const bool out = coverage.inside < kMinInViewWarning, unseen = coverage.detected < kDetectedWarning;
    if (!out && !unseen) continue;
    const bool fault = coverage.inside < kMinInView || coverage.detected < kDetectedFault;
    add_finding(
        findings, seen.cameras[c].name, faults::kOutOfView, fault ? Severity::fault : Severity::warning,
        fmt::format("{:.0f} % of the body lies within its image, and it shows somebody in {:.0f} % of the frames",
                    100.0 * coverage.inside, 100.0 * coverage.detected),
        out ? "Aim the camera at the person, zoom out, or mark with `first_frame` and `last_frame` when the person is "
              "in view."
            : "The person should be in view, but nobody was detected: is something in the way, or is the detector "
              "at fault?");
  }
}

double largest_gap(const std::vector<CameraCoverage>& cameras) {
  std::vector<double> angles;
  for (const CameraCoverage& camera : cameras) angles.push_back(camera.azimuth);
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 360.0 - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
  return gap;
}

bool has_unit_fault(const std::vector<Finding>& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.fault == faults::kWrongUnit; });
}

}  // namespace

BodyExamination examine_body(const Sightings& seen, const RigExamination& rig, std::vector<Finding>& findings) {
  BodyExamination found;
  const BodyTrack& body = rig.nominal.body;
  const BodyMeasurer measurer(seen, body);
  found.stature = measurer.stature();
  examine_size(found.stature, has_unit_fault(findings), findings);
  examine_up(seen, measurer.upward(), findings);
  examine_sides(seen, rig, measurer, findings);
  std::array<std::vector<double>, 3> along;
  for (int i = 0; i < seen.num_instants(); ++i)
    for (int k = 0; k < seen.num_points(); ++k)
      for (std::size_t axis = 0; axis < 3 && body.known(i, k); ++axis)
        along[axis].push_back(body.at(i, k)[static_cast<int>(axis)] / seen.scale);
  Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    found.lowest[axis] = quantile(along[axis], 0.01);
    found.highest[axis] = quantile(along[axis], 0.99);
    middle[axis] = median(along[axis]) * seen.scale;
  }
  for (int c = 0; c < seen.num_cameras(); ++c) found.cameras.push_back(coverage_of(seen, rig, c, middle));
  examine_view(seen, rig, found.cameras, findings);
  found.largest_gap = largest_gap(found.cameras);
  if (found.largest_gap > kMaxGap && seen.num_cameras() > 2)
    add_finding(findings, "", faults::kFewCameras, Severity::note,
                fmt::format("no camera stands in {:.0f} degrees around the person", found.largest_gap),
                "The side that no camera sees will be guessed. Set a camera there if it matters.");
  return found;
}

void examine_single_camera(const Sightings& seen, std::vector<Finding>& findings) {
  add_finding(findings, "", faults::kFewCameras, Severity::note, "the capture has one camera",
              "Without a second camera, calibration and synchronisation cannot be examined.");
  const int hips[2] = {seen.point("left_hip"), seen.point("right_hip")},
            shoulders[2] = {seen.point("left_shoulder"), seen.point("right_shoulder")};
  if (seen.cameras.empty() || std::min(hips[0], shoulders[0]) < 0) return;
  const Camera& camera = seen.cameras[0];
  const Eigen::Vector2d up(camera.R(0, 1), camera.R(1, 1));  // of the world, in the image
  std::vector<double> cosines;
  for (const auto& people : seen.people[0])
    for (const SeenPerson& person : people)
      for (int side = 0; side < 2; ++side) {
        const SeenPoint &hip = person[hips[side]], &shoulder = person[shoulders[side]];
        if (hip.seen && shoulder.seen)
          cosines.push_back((shoulder.pixel - hip.pixel).normalized().dot(up.normalized()));
      }
  if (cosines.empty() || up.norm() < 0.3 || median(cosines) > -0.7) return;
  add_finding(findings, camera.name, faults::kUpsideDown, Severity::fault,
              "the person stands on the head in the images, by the calibration's up axis",
              "Turn the videos, masks and keypoints by 180 degrees, or correct `up` in capture.yaml.");
}

}  // namespace doppel
