#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/doctor/body_examination.h"
#include "doppel/data/doctor/finding.h"
#include "doppel/data/doctor/image_examination.h"
#include "doppel/data/doctor/rig_examination.h"
#include "doppel/data/doctor/sightings.h"

namespace doppel {

struct DoctorOptions {
  long rows = 480;      ///< rows that are examined, over all sequences; of longer ones, pieces of consecutive rows
  bool footage = true;  ///< also read the images and masks
};

/// Everything that was measured, and what was found.
struct Examination {
  std::string capture;            ///< its name
  std::vector<Finding> findings;  ///< sorted
  Sightings seen;
  std::optional<RigExamination> rig;
  std::optional<BodyExamination> body;
  std::vector<std::string> sequences;    ///< names
  std::vector<SequenceFootage> footage;  ///< [sequences] of [C]; empty without `footage`

  Verdict verdict() const { return verdict_of(findings); }
};

/// Examines a capture before there is a motion or a character: calibration, keypoints, synchronisation, images and
/// masks. Each camera is measured against the consensus of the others. docs/doctor.md lists the faults.
/// @throws Error when there is nothing to examine: no sequences, no calibration that can be read
Examination examine_capture(const Capture& capture, const DoctorOptions& options = {});

/// findings_json, and `cameras` and `body` with what was measured.
nlohmann::ordered_json to_json(const Examination& examination);

/// The report as one HTML page: the verdict, the findings, a plan of the cameras, images with keypoints, masks and
/// the projected body, and curves.
std::string doctor_page(const Examination& examination);

}  // namespace doppel
