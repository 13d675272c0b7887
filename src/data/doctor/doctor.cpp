#include "doppel/data/doctor/doctor.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/data/doctor/activity_examination.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

using nlohmann::ordered_json;

std::vector<std::string> camera_names(const Sightings& seen) {
  std::vector<std::string> names;
  for (const Camera& camera : seen.cameras) names.push_back(camera.name);
  return names;
}

void examine_keypoints(Examination& examination) {
  const Sightings& seen = examination.seen;
  if (!seen.has_people()) {
    const bool told = std::any_of(examination.findings.begin(), examination.findings.end(),
                                  [](const Finding& finding) { return finding.fault == faults::kNoKeypoints; });
    if (told) return;
    examination.findings.push_back({"", faults::kNoKeypoints, Severity::warning, "no keypoints",
                                    "Without keypoints, calibration and synchronisation cannot be examined. Run "
                                    "`doppel detect` or another detector, "
                                    "and name its files with `keypoints` in capture.yaml."});
    return;
  }
  if (seen.num_cameras() < 2) {
    examine_single_camera(seen, examination.findings);
    return;
  }
  examination.rig = examine_rig(seen, examination.findings);
  if (examination.rig && examination.rig->nominal.found)
    examination.body = examine_body(seen, *examination.rig, examination.findings);
}

/// The median of a measure over all images of a camera; null where it is not known.
template <typename Measure>
ordered_json typical_of(const Examination& examination, std::size_t camera, const Measure& measure) {
  std::vector<double> values;
  for (const SequenceFootage& sequence : examination.footage)
    for (const ImageFacts& facts : sequence[camera].images)
      if (const double value = measure(facts); std::isfinite(value)) values.push_back(value);
  return values.empty() ? ordered_json(nullptr) : ordered_json(median(values));
}

ordered_json camera_json(const Examination& examination, std::size_t c) {
  ordered_json json{{"camera", examination.seen.cameras[c].name}};
  if (examination.rig && examination.rig->nominal.found) {
    const Consensus& consensus = examination.rig->nominal;
    json["residual"] = consensus.residual[c];
    json["expected_residual"] = consensus.expected[c];
  }
  if (examination.body) {
    const CameraCoverage& coverage = examination.body->cameras[c];
    json["distance_m"] = coverage.distance;
    json["person_px"] = coverage.height;
    json["body_in_image"] = coverage.inside;
    json["frames_with_person"] = coverage.detected;
    json["azimuth_deg"] = coverage.azimuth;
  }
  if (examination.footage.empty()) return json;
  const auto known = [](double value) { return value < 0.0 ? NAN : value; };
  json["exposure_stops"] = typical_of(examination, c, [](const ImageFacts& f) { return f.exposure; });
  json["red_stops"] = typical_of(examination, c, [](const ImageFacts& f) { return f.red; });
  json["blue_stops"] = typical_of(examination, c, [](const ImageFacts& f) { return f.blue; });
  json["edge_px"] = typical_of(examination, c, [&](const ImageFacts& f) { return known(f.edge_width); });
  json["mask_area"] = typical_of(examination, c, [&](const ImageFacts& f) { return known(f.mask_area); });
  json["keypoints_on_mask"] = typical_of(examination, c, [&](const ImageFacts& f) { return known(f.points_on_mask); });
  return json;
}

/// What was measured of masks and views by keypoints says nothing when these are of other footage.
void forget_keypoints(Examination& examination) {
  std::erase_if(examination.findings, [](const Finding& finding) { return finding.fault == faults::kOutOfView; });
  for (SequenceFootage& sequence : examination.footage)
    for (FootageExamination& camera : sequence) {
      camera.shifted_bones.clear();
      for (ImageFacts& facts : camera.images) {
        facts.points_on_mask = facts.body_on_mask = facts.bones_on_mask = -1.0;
        facts.has_margins = false;
      }
    }
}

}  // namespace

Examination examine_capture(const Capture& capture, const DoctorOptions& options) {
  Examination examination;
  examination.capture = capture.name;
  examination.seen = read_sightings(capture, options.rows, examination.findings, options.footage);
  for (const SequenceEntry& sequence : capture.sequences) examination.sequences.push_back(sequence.name);
  examine_keypoints(examination);
  const RigExamination* rig = examination.rig ? &*examination.rig : nullptr;
  for (std::size_t s = 0; s < capture.sequences.size() && options.footage; ++s) {
    examination.footage.emplace_back();
    for (int c = 0; c < examination.seen.num_cameras(); ++c)
      examination.footage.back().push_back(examine_footage(capture, static_cast<int>(s), examination.seen, c, rig));
  }
  if (examination.rig) settle_exchanges(examination.seen, *examination.rig, examination.footage, examination.findings);
  if (!examine_images(examination.seen, rig, examination.footage, examination.findings)) forget_keypoints(examination);
  examine_masks(examination.seen, rig, examination.footage, examination.findings);
  examination.findings = sorted_findings(std::move(examination.findings), camera_names(examination.seen));
  return examination;
}

ordered_json to_json(const Examination& examination) {
  ordered_json json = findings_json(examination.findings);
  json["capture"] = examination.capture;
  if (examination.body) {
    const BodyExamination& body = *examination.body;
    json["body"] = {
        {"stature_m", body.stature},
        {"volume_m",
         {{body.lowest.x(), body.lowest.y(), body.lowest.z()}, {body.highest.x(), body.highest.y(), body.highest.z()}}},
        {"largest_gap_deg", body.largest_gap}};
  }
  json["cameras"] = ordered_json::array();
  for (std::size_t c = 0; c < examination.seen.cameras.size(); ++c)
    json["cameras"].push_back(camera_json(examination, c));
  return json;
}

}  // namespace doppel
