#pragma once

#include <optional>
#include <string>
#include <vector>

#include "doppel/character/shape_family.h"
#include "doppel/track/multiview/multiview.h"
#include "doppel/track/multiview/shared_dofs_fit.h"

namespace doppel {

struct ShapeFitOptions {
  MultiviewOptions images;  ///< weights and kernels of keypoints and outlines
  /// Per squared deviation of a parameter and for each frame: the errors of a detector are alike in all frames, so many
  /// frames are not much surer than one.
  double prior_weight = 1.0;
  int rounds = 3;  ///< fits; each finds the outlines anew
};

/// Fits the shape of a body to keypoints and outlines of several frames. The poses of the frames stay fixed.
/// @param landmarks [M] names of markers, in the order of the keypoints @param cameras [C]
/// @param start [P] parameters @return [P] @throws Error without frames
std::vector<double> fit_shape(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                              const std::vector<PinholeCamera>& cameras, const std::vector<PosedEvidence>& frames,
                              const std::vector<double>& start, const ShapeFitOptions& options);

/// Landmarks of a person in space, [M] world metres; nothing: not found.
using SpaceLandmarks = std::vector<std::optional<Eigen::Vector3d>>;

/// A first shape from landmarks in space, without poses. Some pairs of landmarks have nearly the same distance in every
/// pose, for example elbow and wrist. The body gets the person's median distances of these pairs; a pair counts less
/// the more poses change its distance.
/// @param landmarks [M] names of markers @param frames [F] @return [P]
std::vector<double> shape_from_landmarks(const ShapeFamily& family, const std::vector<std::string>& landmarks,
                                         const std::vector<SpaceLandmarks>& frames);

/// Two landmarks whose distance poses change little.
struct SteadyPair {
  std::array<int, 2> landmarks{};
  double deviation = 0.0;  ///< standard deviation of the distance over poses within the limits, metres
};
/// @param tolerance largest deviation, as a share of the distance in the rest pose
std::vector<SteadyPair> steady_pairs(const Character& character, const std::vector<std::string>& landmarks,
                                     double tolerance);

}  // namespace doppel
