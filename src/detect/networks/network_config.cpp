#include "doppel/detect/networks/network_config.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/detect/networks/builtin_network_configs.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kOutputs{"auto", "heatmaps", "simcc", "points", "mask", "boxes", "ssd", "yolox"};
const std::vector<std::string> kGrids{"cells", "samples", "ends"};
const std::vector<std::string> kRefinements{"none", "quarter", "parabola", "dark"};
const std::vector<std::string> kActivations{"auto", "sigmoid", "softmax", "none"};
const std::vector<std::string> kValueWords{"x", "y", "score", "logit", "skip"};
constexpr double kMaxColour = 255.0;
constexpr int kMaxConfigs = 4;  ///< files that name each other as `config`, one after the other

void check_input(const ConfigReader& reader, const std::vector<int>& size) {
  if (reader.has("input_height")) reader.fail_at_key("input", "excludes `input_height`; keep one of them");
  if (size.size() != 2 || std::min(size[0], size[1]) < 8 || std::max(size[0], size[1]) > 4096)
    reader.fail_at_key("input", "must be width and height of the network's input, 8 to 4096 each, as in [192, 256]");
}

void check_colours(const ConfigReader& reader, double range) {
  if (range != 1.0 && range != kMaxColour)
    reader.fail_at_key("range", "must be the largest colour value that `mean` and `deviation` count with, 1 or 255");
  if (reader.has("range") && reader.has("scale"))
    reader.fail_at_key("range", "belongs to `deviation`; `scale` multiplies colours of 0 to 255");
  if (reader.has("deviation") && reader.has("scale"))
    reader.fail_at_key("deviation", "excludes `scale`, which is one divided by the deviation; keep one of them");
}

std::array<double, 3> channels(const ConfigReader& reader, const std::string& key, const std::vector<double>& numbers,
                               double factor) {
  if (numbers.size() != 3)
    reader.fail_at_key(key, "must be three numbers, one for each channel of the network, as in [104, 117, 123]");
  return {numbers[0] * factor, numbers[1] * factor, numbers[2] * factor};
}

/// Sets the options whose keys have another form.
void convert(const ConfigReader& reader, const NetworkKeys& keys, NetworkOptions& options) {
  options.model = keys.model;
  options.weights = keys.weights;
  if (reader.has("input")) {
    check_input(reader, keys.input);
    options.input = {keys.input[0], keys.input[1]};
  }
  if (reader.has("input_height")) options.input = {};
  check_colours(reader, keys.range);
  const double factor = kMaxColour / keys.range;
  if (keys.scale) options.deviation.fill(1.0 / *keys.scale);
  if (reader.has("mean")) options.mean = channels(reader, "mean", keys.mean, factor);
  if (!reader.has("deviation")) return;
  options.deviation = channels(reader, "deviation", keys.deviation, factor);
  if (!(*std::min_element(options.deviation.begin(), options.deviation.end()) > 0.0))
    reader.fail_at_key("deviation", "must be positive");
}

void read_network_keys(const ConfigReader& reader, NetworkOptions& options) {
  NetworkKeys keys{options};
  read_keys(reader, keys);
  options = keys.options;
  convert(reader, keys, options);
  for (const std::string& value : options.values)
    if (std::find(kValueWords.begin(), kValueWords.end(), value) == kValueWords.end())
      reader.fail_at_key("values", "has the word '{}'; allowed are {}", value, fmt::join(kValueWords, ", "));
}

const BuiltinFile* find_builtin(const std::string& name) {
  const auto found = std::find_if(kBuiltinNetworkConfigs.begin(), kBuiltinNetworkConfigs.end(),
                                  [&](const BuiltinFile& config) { return name == config.name; });
  return found == kBuiltinNetworkConfigs.end() ? nullptr : &*found;
}

PersonNetworkOptions load_network(const std::string& name_or_path, int depth);

/// What `config` names, or the defaults. @param depth number of files that led here
PersonNetworkOptions read_base(const ConfigReader& reader, int depth) {
  if (!reader.has("config")) return {};
  const std::string name = reader.get<std::string>("config");
  if (find_builtin(name)) return load_network(name, depth);
  const fs::path file = reader.path("config");
  if (!fs::is_regular_file(file))
    reader.fail_at_key("config", "'{}' is neither a file nor one of {}", name,
                       fmt::join(builtin_network_configs(), ", "));
  if (fs::equivalent(file, reader.where().file)) reader.fail_at_key("config", "names the file itself");
  if (depth >= kMaxConfigs)
    reader.fail_at_key("config",
                       "'{}' is file {} in a row that names another one, allowed are {}; do they form a circle?", name,
                       depth + 1, kMaxConfigs);
  return load_network(file.string(), depth);
}

/// A network for boxes or masks, with a `config` of its own. @param base used without one
NetworkOptions read_part(const ConfigReader& reader, const NetworkOptions& base, int depth) {
  NetworkOptions options = reader.has("config") ? read_base(reader, depth).network : base;
  read_network_keys(reader, options);
  if (options.model.empty()) reader.fail_at_key("model", "is missing: the network's .onnx file");
  return options;
}

CropOptions read_crop(const ConfigReader& reader, const CropOptions& base, int depth) {
  CropOptions crop = base;
  read_keys(reader, crop);
  if (reader.has("boxes")) {
    NetworkOptions usual;
    usual.letterbox = true;
    usual.threshold = 0.3;
    crop.boxes = read_part(reader.section("boxes"), crop.boxes.value_or(usual), depth);
  }
  return crop;
}

PersonNetworkOptions read_all(const ConfigReader& reader, PersonNetworkOptions options, int depth) {
  read_network_keys(reader, options.network);
  if (reader.has("crop")) options.crop = read_crop(reader.section("crop"), options.crop.value_or(CropOptions()), depth);
  if (reader.has("mask"))
    options.mask = read_part(reader.section("mask"), options.mask.value_or(NetworkOptions()), depth);
  if (options.crop && options.network.input.empty())
    reader.fail_at_key("crop", "needs the size of the network's input: `input: [width, height]`");
  return options;
}

/// @param depth number of files that name this one as `config`, one after the other
PersonNetworkOptions load_network(const std::string& name_or_path, int depth) {
  if (const BuiltinFile* const builtin = find_builtin(name_or_path)) {
    const ConfigDocument document = ConfigDocument::parse(builtin->text, name_or_path);
    const ConfigReader root = document.root();
    PersonNetworkOptions options = read_all(root, {}, depth + 1);
    root.finish();
    return options;
  }
  if (!fs::is_regular_file(name_or_path))
    fail<UsageError>("the configuration of a network, '{}', is neither a file nor one of {}", name_or_path,
                     fmt::join(builtin_network_configs(), ", "));
  const ConfigDocument document = ConfigDocument::load(name_or_path);
  const ConfigReader root = document.root();
  PersonNetworkOptions options = read_all(root, read_base(root, depth + 1), depth + 1);
  root.finish();
  const fs::path folder = fs::absolute(name_or_path).parent_path();
  for_each_network(options, [&](NetworkOptions& network) {
    for (fs::path* const path : {&network.model, &network.weights})
      if (!path->empty()) *path = (folder / *path).lexically_normal();
  });
  return options;
}

YAML::Node flow(YAML::Node node) {
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

template <typename T>
const std::string& word(const std::vector<std::string>& words, T value) {
  return words[static_cast<std::size_t>(value)];
}

YAML::Node network_node(const NetworkOptions& options) {
  const NetworkOptions usual;
  YAML::Node node;
  node["model"] = options.model.string();
  if (!options.weights.empty()) node["weights"] = options.weights.string();
  if (options.input.empty())
    node["input_height"] = options.input_height;
  else
    node["input"] = flow(YAML::Node(std::vector<int>{options.input.width, options.input.height}));
  node["fit"] = options.letterbox ? "letterbox" : "stretch";
  node["border"] = options.border;
  node["mean"] = flow(YAML::Node(std::vector<double>(options.mean.begin(), options.mean.end())));
  node["deviation"] = flow(YAML::Node(std::vector<double>(options.deviation.begin(), options.deviation.end())));
  node["rgb"] = options.rgb;
  node["threshold"] = options.threshold;
  node["output"] = word(kOutputs, options.output);
  if (!options.outputs.empty()) node["outputs"] = flow(YAML::Node(options.outputs));
  if (options.grid) node["grid"] = word(kGrids, *options.grid);
  if (options.refine) node["refine"] = word(kRefinements, *options.refine);
  if (options.blur != usual.blur) node["blur"] = options.blur;
  if (options.fractions) node["units"] = "fractions";
  if (!options.values.empty()) node["values"] = flow(YAML::Node(options.values));
  if (options.activation != usual.activation) node["activation"] = word(kActivations, options.activation);
  if (options.person) node["person"] = *options.person;
  return node;
}

}  // namespace

NetworkKeys::NetworkKeys(const NetworkOptions& network)
    : options(network),
      model(network.model.string()),
      weights(network.weights.string()),
      mean(network.mean.begin(), network.mean.end()),
      deviation(network.deviation.begin(), network.deviation.end()) {
  if (!network.input.empty()) input = {network.input.width, network.input.height};
}

void describe_keys(const Keys& keys, NetworkKeys& network) {
  NetworkOptions& options = network.options;
  keys("model", network.model, "`.onnx`, or the `.prototxt` of a Caffe model with its `weights`");
  keys("weights", network.weights, "the `.caffemodel` of a `.prototxt`");
  keys("input", network.input,
       "width and height of the network's input, 8 to 4096 each; empty: as `input_height` says");
  keys("input_height", options.input_height, between(8, 4096),
       "for networks for images of any size: the width follows from the image, both are multiples of 8");
  keys("fit", options.letterbox, {"stretch", "letterbox"},
       "a whole image is stretched to the input, or keeps its aspect ratio in the middle of it; `letterbox` is the "
       "default of `boxes`");
  keys("border", options.border, between(0.0, kMaxColour), "colour of what lies beyond the image");
  keys("rgb", options.rgb, "true: the first channel is red, otherwise blue");
  keys("mean", network.mean, "value = (colour - mean) / deviation, one number for each channel of the network");
  keys("deviation", network.deviation, "as `mean`");
  keys("range", network.range, between(1.0, kMaxColour),
       "the largest colour that `mean` and `deviation` count with: 255 or 1");
  keys("scale", network.scale, between(1e-9, 1e9), "instead of `deviation`: value = (colour - mean) * scale");
  keys("output", options.output, kOutputs, "how the outputs are read; `auto`: by their shapes");
  keys("outputs", options.outputs,
       "names of the outputs to read, in the order of the form; empty: all, sorted by name");
  keys("threshold", options.threshold, between(1e-6, 1.0),
       "points and boxes of lower scores are not seen; 0.3 is the default of `boxes`");
  keys("grid", options.grid, kGrids, "where the entries lie, see below; without: `cells`, for `simcc` `samples`");
  keys("refine", options.refine, kRefinements,
       "below the grid: a quarter of an entry towards the larger neighbour, a parabola through the neighbours, or a "
       "quadratic fit of the logarithm (`dark`); without: `parabola`, for `simcc` `none`");
  keys("blur", options.blur, between(0, 99), "side of the Gaussian before `dark`, entries, odd; 0: none");
  keys.require("blur", options.blur % 2 == 1 || options.blur == 0,
               fmt::format("must be 0 or odd, {} is even", options.blur));
  keys("units", options.fractions, {"pixels", "fractions"}, "coordinates in pixels of the input or in fractions of it");
  keys("values", options.values,
       "meaning of each number of a point: `x`, `y`, `score`, `logit`, `skip`; empty: by the shapes");
  keys("activation", options.activation, kActivations,
       "of masks; `none`: the network gives probabilities; `auto`: `none` if it ends in Sigmoid, Softmax or Clip, "
       "otherwise by the number of channels");
  keys("person", options.person, between(0, 100000),
       "index of the class of people; without: none for masks of several classes, 0 for boxes");
}

void describe_keys(const Keys& keys, CropOptions& crop) {
  keys("padding", crop.padding, between(1.0, 10.0), "sides of the crop by sides of the person's box");
  keys("track", crop.track,
       "the box follows from the points (enlarged by a quarter) or the mask of the frame before, until the person is "
       "lost");
}

PersonNetworkOptions read_person_network(const ConfigReader& reader) {
  const PersonNetworkOptions options = read_all(reader, read_base(reader, 0), 0);
  if (options.network.model.empty()) reader.fail_at_key("model", "is missing: the network's .onnx file");
  return options;
}

PersonNetworkOptions load_person_network(const std::string& name_or_path) { return load_network(name_or_path, 0); }

std::vector<std::string> builtin_network_configs() {
  std::vector<std::string> names;
  for (const BuiltinFile& config : kBuiltinNetworkConfigs) names.emplace_back(config.name);
  return names;
}

YAML::Node person_network_node(const PersonNetworkOptions& options) {
  YAML::Node node = network_node(options.network);
  if (options.crop) {
    node["crop"]["padding"] = options.crop->padding;
    node["crop"]["track"] = options.crop->track;
    if (options.crop->boxes) node["crop"]["boxes"] = network_node(*options.crop->boxes);
  }
  if (options.mask) node["mask"] = network_node(*options.mask);
  return node;
}

void for_each_network(PersonNetworkOptions& options, const std::function<void(NetworkOptions&)>& change) {
  change(options.network);
  if (options.crop && options.crop->boxes) change(*options.crop->boxes);
  if (options.mask) change(*options.mask);
}

}  // namespace doppel
