#pragma once

#include <vector>

#include "doppel/data/doctor/body_track.h"

namespace doppel {

/// The detections that show the person: by the agreement of the cameras (follow_people) where a camera found several
/// people; where this fails, and where there is one person, the largest detection.
PersonOfCamera choose_detections(const Sightings& seen);

/// The largest share of the person's size by which cameras differ that agree. Detectors of keypoints differ by 0.5 to
/// 2 %.
inline constexpr double kAgreementShare = 0.03;

/// Cameras that agree on the body, and how far each camera is from what the others see.
struct Consensus {
  bool found = false;            ///< false: no cameras agree
  std::vector<int> members;      ///< cameras that agree
  BodyTrack body;                ///< by the members
  double noise = 0.0;            ///< of one view, as a share of the person's size: estimated from the members
  double quality = kMaxShare;    ///< median share of the worst of the cameras that had to agree
  std::vector<double> residual;  ///< [C] of a camera's points from the body of the other members; mean of windows
  std::vector<double> expected;  ///< [C] what `noise` lets expect for it
  std::vector<std::vector<double>> by_window;  ///< [C][windows] the same by window; -1: no points
};

/// Finds the consensus. Small groups of cameras (pairs of up to three, triples of more) propose a body; the group on
/// which most cameras agree best wins, so one or two faulty cameras of many do no harm. @param views [C]
Consensus find_consensus(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person);

/// The quality of the best group alone: less work, on fewer instants.
double consensus_quality(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person);

/// The residual that a camera should have from the body of others, over the noise of a view.
double expected_factor(const SightTable& sights, const std::vector<int>& others, int camera, const BodyTrack& body);

/// The cameras as the calibration has them.
std::vector<SupposedView> calibrated_views(const Sightings& seen);

}  // namespace doppel
