#include "doppel/detect/networks/network_config.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/networks/builtin_network_configs.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// The words of an enumeration, in the order of its values.
template <typename T>
struct Words {
  std::vector<std::string> words;

  T parse(const std::string& word) const {
    return static_cast<T>(std::find(words.begin(), words.end(), word) - words.begin());
  }
  const std::string& word(T value) const { return words[static_cast<std::size_t>(value)]; }
};

const Words<OutputKind> kOutputs{{"auto", "heatmaps", "simcc", "points", "mask", "boxes", "ssd", "yolox"}};
const Words<OutputGrid> kGrids{{"cells", "samples", "ends"}};
const Words<PeakRefinement> kRefinements{{"none", "quarter", "parabola", "dark"}};
const Words<MaskActivation> kActivations{{"auto", "sigmoid", "softmax", "none"}};
const std::vector<std::string> kValueWords{"x", "y", "score", "logit", "skip"};
constexpr double kMaxColour = 255.0;
constexpr int kMaxConfigs = 4;  ///< files that name each other as `config`, one after the other

template <typename T>
void read_word(const ConfigReader& reader, const std::string& key, const Words<T>& words, T& value) {
  value = words.parse(reader.choice(key, words.words, words.word(value)));
}

template <typename T>
void read_word(const ConfigReader& reader, const std::string& key, const Words<T>& words, std::optional<T>& value) {
  if (reader.has(key)) value = words.parse(reader.choice(key, words.words));
}

void read_input(const ConfigReader& reader, NetworkOptions& options) {
  if (reader.has("input")) {
    if (reader.has("input_height")) reader.fail_at_key("input", "excludes `input_height`; keep one of them");
    const std::vector<int> size = reader.list<int>("input");
    if (size.size() != 2 || std::min(size[0], size[1]) < 8 || std::max(size[0], size[1]) > 4096)
      reader.fail_at_key("input", "must be width and height of the network's input, 8 to 4096 each, as in [192, 256]");
    options.input = {size[0], size[1]};
  }
  if (reader.has("input_height")) options.input = {};
  options.input_height = reader.get("input_height", options.input_height, between(8, 4096));
  options.letterbox = reader.choice("fit", {"stretch", "letterbox"},
                                    std::string(options.letterbox ? "letterbox" : "stretch")) == "letterbox";
  options.border = reader.get("border", options.border, between(0.0, kMaxColour));
  options.rgb = reader.get("rgb", options.rgb);
}

std::array<double, 3> read_channels(const ConfigReader& reader, const std::string& key, double factor) {
  const std::vector<double> numbers = reader.list<double>(key);
  if (numbers.size() != 3)
    reader.fail_at_key(key, "must be three numbers, one for each channel of the network, as in [104, 117, 123]");
  return {numbers[0] * factor, numbers[1] * factor, numbers[2] * factor};
}

/// value = (colour - mean) * scale, or (colour - mean) / deviation; with `range: 1` mean and deviation are for colours
/// from 0 to 1.
void read_colours(const ConfigReader& reader, NetworkOptions& options) {
  const double range = reader.get("range", kMaxColour, between(1.0, kMaxColour));
  if (range != 1.0 && range != kMaxColour)
    reader.fail_at_key("range", "must be the largest colour value that `mean` and `deviation` count with, 1 or 255");
  if (reader.has("range") && reader.has("scale"))
    reader.fail_at_key("range", "belongs to `deviation`; `scale` multiplies colours of 0 to 255");
  if (reader.has("deviation") && reader.has("scale"))
    reader.fail_at_key("deviation", "excludes `scale`, which is one divided by the deviation; keep one of them");
  if (reader.has("scale")) options.deviation.fill(1.0 / reader.get<double>("scale", between(1e-9, 1e9)));
  if (reader.has("mean")) options.mean = read_channels(reader, "mean", kMaxColour / range);
  if (!reader.has("deviation")) return;
  options.deviation = read_channels(reader, "deviation", kMaxColour / range);
  if (!(*std::min_element(options.deviation.begin(), options.deviation.end()) > 0.0))
    reader.fail_at_key("deviation", "must be positive");
}

void read_output(const ConfigReader& reader, NetworkOptions& options) {
  read_word(reader, "output", kOutputs, options.output);
  if (reader.has("outputs")) options.outputs = reader.list<std::string>("outputs");
  options.threshold = reader.get("threshold", options.threshold, between(1e-6, 1.0));
  read_word(reader, "grid", kGrids, options.grid);
  read_word(reader, "refine", kRefinements, options.refine);
  options.blur = reader.get("blur", options.blur, between(0, 99));
  if (options.blur > 0 && options.blur % 2 == 0)
    reader.fail_at_key("blur", "must be 0 or odd, {} is even", options.blur);
  options.fractions = reader.choice("units", {"pixels", "fractions"},
                                    std::string(options.fractions ? "fractions" : "pixels")) == "fractions";
  if (reader.has("values")) options.values = reader.list<std::string>("values");
  for (const std::string& value : options.values)
    if (std::find(kValueWords.begin(), kValueWords.end(), value) == kValueWords.end())
      reader.fail_at_key("values", "has the word '{}'; allowed are {}", value, fmt::join(kValueWords, ", "));
  read_word(reader, "activation", kActivations, options.activation);
  if (reader.has("person")) options.person = reader.get<int>("person", between(0, 100000));
}

void read_keys(const ConfigReader& reader, NetworkOptions& options) {
  options.model = reader.get("model", options.model.string());
  options.weights = reader.get("weights", options.weights.string());
  read_input(reader, options);
  read_colours(reader, options);
  read_output(reader, options);
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
  read_keys(reader, options);
  if (options.model.empty()) reader.fail_at_key("model", "is missing: the network's .onnx file");
  return options;
}

CropOptions read_crop(const ConfigReader& reader, const CropOptions& base, int depth) {
  CropOptions crop = base;
  crop.padding = reader.get("padding", crop.padding, between(1.0, 10.0));
  crop.track = reader.get("track", crop.track);
  if (reader.has("boxes")) {
    NetworkOptions usual;
    usual.letterbox = true;
    usual.threshold = 0.3;
    crop.boxes = read_part(reader.section("boxes"), crop.boxes.value_or(usual), depth);
  }
  return crop;
}

PersonNetworkOptions read_all(const ConfigReader& reader, PersonNetworkOptions options, int depth) {
  read_keys(reader, options.network);
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
  node["output"] = kOutputs.word(options.output);
  if (!options.outputs.empty()) node["outputs"] = flow(YAML::Node(options.outputs));
  if (options.grid) node["grid"] = kGrids.word(*options.grid);
  if (options.refine) node["refine"] = kRefinements.word(*options.refine);
  if (options.blur != usual.blur) node["blur"] = options.blur;
  if (options.fractions) node["units"] = "fractions";
  if (!options.values.empty()) node["values"] = flow(YAML::Node(options.values));
  if (options.activation != usual.activation) node["activation"] = kActivations.word(options.activation);
  if (options.person) node["person"] = *options.person;
  return node;
}

}  // namespace

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
