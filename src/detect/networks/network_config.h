#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/core/options.h"
#include "doppel/detect/networks/network_options.h"

namespace doppel {

/// The keys of one network as a configuration writes them. The members after `options` stand for its members of the
/// same names, `scale` for the reciprocal of the deviation.
struct NetworkKeys {
  NetworkKeys() : NetworkKeys(NetworkOptions()) {}
  explicit NetworkKeys(const NetworkOptions& network);

  NetworkOptions options;
  std::string model, weights;
  std::vector<int> input;
  std::vector<double> mean, deviation;  ///< colours from 0 to `range`
  double range = 255.0;
  std::optional<double> scale;
};
void describe_keys(const Keys& keys, NetworkKeys& network);
/// Without `boxes`, whose keys are those of a network.
void describe_keys(const Keys& keys, CropOptions& crop);

/// Reads the keys of networks (docs/detect.md). Keys that are not given have the values of `config`, which is a name of
/// `builtin_network_configs` or a YAML file with the same keys, otherwise their defaults. Such a file may name another
/// one; at most 4 follow each other.
/// Paths of models are as written, those in a file named by `config` absolute.
/// @throws FileError with file:line:key for unknown keys, values out of range, and keys that exclude each other
PersonNetworkOptions read_person_network(const ConfigReader& reader);

/// Reads a file of such keys, or a built-in one. @throws UsageError when `name_or_path` is neither
PersonNetworkOptions load_person_network(const std::string& name_or_path);

/// The names of the files in configs/networks, which are compiled in: forms of public networks, without weights.
std::vector<std::string> builtin_network_configs();

/// The keys that `read_person_network` reads as the same options.
YAML::Node person_network_node(const PersonNetworkOptions& options);

/// Calls a function for each network of the options: that of the person, then those of boxes and mask.
void for_each_network(PersonNetworkOptions& options, const std::function<void(NetworkOptions&)>& change);

}  // namespace doppel
