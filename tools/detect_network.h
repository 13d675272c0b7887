#pragma once

#include <filesystem>
#include <string>

#include "detect_camera.h"
#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/networks/person_network.h"

namespace doppel::tools {

/// A network of the user's choice, instead of BlazePose.
struct DetectNetwork {
  PersonNetworkOptions options;
  PointLayout layout;  ///< no points: the network finds masks only
};

/// @param model the .onnx file; empty: the configuration names it
/// @param config name of a built-in configuration, or a YAML file (detect/networks/network_config.h); empty: the
/// defaults
/// @param layout name of a built-in layout, or file of a keypoint map; empty: masks only
/// @param masks whether masks are asked for
/// @throws UsageError when neither model nor configuration names a network, or masks are asked for and no network of
/// the configuration finds them; the errors of the readers
DetectNetwork choose_network(const std::string& model, const std::string& config, const std::string& layout,
                             bool masks);

/// `detect_camera` with such a network. Only files that are named are written; there are no joints.
/// @throws Error as PersonNetwork; when the network does not find what the files are for
std::optional<DetectReport> detect_camera_with(const DetectNetwork& chosen, PersonNetwork& network,
                                               const DetectSource& source, const DetectFiles& files,
                                               std::optional<Eigen::Vector2d> person,
                                               const std::function<bool()>& advance);

}  // namespace doppel::tools
