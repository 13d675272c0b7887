#pragma once

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/mask_values.h"
#include "doppel/data/doctor/rig_examination.h"

namespace doppel {

/// What was measured in one image, and in its mask. Light is NaN where there is no image, or no person in it.
struct ImageFacts {
  long row = 0;
  bool after_previous = false;   ///< the entry before is the row before, by the usual number of frames
  double exposure = NAN;         ///< mean of the linear light on the person, as its logarithm to base 2 (stops)
  double scene_exposure = NAN;   ///< the same of the image around the person
  double red = NAN, blue = NAN;  ///< on the person: log2 of red/green and blue/green, linear light
  double scene_red = NAN, scene_blue = NAN;
  double overexposed = 0.0;       ///< share of the person's pixels at the brightest values
  double edge_width = -1.0;       ///< sigma of the sharpest edges, pixels; -1: not measured
  double change = -1.0;           ///< mean difference from the image before, grey levels of 255; -1: none
  std::optional<double> seconds;  ///< time stamp of the video
  // Of the mask; -1 where there is none.
  double mask_area = -1.0;  ///< share of the image
  bool mask_at_border = false;
  double points_on_mask = -1.0;  ///< share of the camera's keypoints
  double body_on_mask = -1.0;    ///< share of the projected body's points
  double bones_on_mask = -1.0;   ///< share of the lines between neighbouring keypoints
  /// As body_on_mask, by the camera as calibrated; only of RigExamination::exchanged.
  double calibrated_on_mask = -1.0;
  double flicker = -1.0;  ///< pixels that differ from both neighbours in time, per mask area; -1: no neighbours
  std::array<double, 4> margins{};  ///< of the mask's box around the keypoints' box: left, top, right, bottom, sizes
  bool has_margins = false;
};

/// The largest number of rows by which keypoints are tried on the masks of other rows.
inline constexpr int kMaxKeypointShift = 30;

/// Shares of several images.
struct SharesSum {
  double sum = 0.0;
  int count = 0;
  double mean() const { return count == 0 ? 0.0 : sum / count; }
};

/// What was measured of one camera in one sequence.
struct FootageExamination {
  std::vector<ImageFacts> images;
  long frames = -1;  ///< of the video; -1: not readable
  long rows = -1;    ///< that last as long as the video, by its rate
  double start = 0;  ///< row of the video's first frame; below 0: it starts before the sequence
  long mask_frames = -1;
  std::optional<MaskValues> mask_values;  ///< of mask files
  int mask_threshold = 0;                 ///< in use
  std::string error;        ///< of the first image that could not be read; empty: none. A video is read no further
  long missing_images = 0;  ///< of files per frame: images that could not be read
  std::string mask_error;
  /// [2 kMaxKeypointShift + 1] of the bones by the keypoints of s rows later, s from -kMaxKeypointShift on; empty: no
  /// masks
  std::vector<SharesSum> shifted_bones;
  const SharesSum& bones_at(int shift) const {
    return shifted_bones[static_cast<std::size_t>(shift + kMaxKeypointShift)];
  }
  cv::Mat sample, sample_mask;  ///< an image from the middle, and its mask
  int sample_instant = -1;
  std::vector<cv::Mat> small;  ///< small grey images of some instants
  std::vector<int> small_instants;
};

/// All cameras of one sequence.
using SequenceFootage = std::vector<FootageExamination>;  ///< [C]

/// Reads the images and masks of one camera in the rows of the sightings, and measures them.
/// @param rig nothing: no consensus, so the projected body is not compared with masks
FootageExamination examine_footage(const Capture& capture, int sequence, const Sightings& seen, int camera,
                                   const RigExamination* rig);

}  // namespace doppel
