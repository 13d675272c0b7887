#include "doppel/data/capture/capture.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <fstream>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/folder_path.h"
#include "doppel/core/path_pattern.h"
#include "doppel/core/text_reader.h"
#include "doppel/detect/networks/network_config.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kSchemaVersion = 1;
constexpr int kMaxPeople = 1000;
constexpr long kMaxFrame = 100'000'000;  // 46 days at 25 frames per second: larger numbers are mistakes

/// Names become keys of the store and parts of file names.
void check_name(const ConfigReader& reader, const std::string& key, const std::string& name) {
  const auto bad = [](char c) { return !(std::isalnum(static_cast<unsigned char>(c)) || std::strchr("_-.@", c)); };
  if (name.empty() || name.size() > 64 || name == "." || name == ".." || std::any_of(name.begin(), name.end(), bad))
    reader.fail_at_key(key, "'{}' is no usable name: 1 to 64 letters, digits, '_', '-', '.' or '@' are allowed",
                       excerpt(name));
}

/// Expands a pattern with arbitrary numbers, so that a mistake in its braces is reported at its line.
void check_pattern(const ConfigReader& reader, const std::string& key, const std::string& pattern) {
  try {
    expand_pattern(pattern, 0, "0", 0);
  } catch (const Error& e) {
    reader.fail_at_key(key, "{}", e.what());
  }
}

std::string read_pattern(const ConfigReader& reader, const std::string& key) {
  const std::string pattern = reader.get<std::string>(key);
  if (pattern.empty()) reader.fail_at_key(key, "is empty; a path is needed");
  check_pattern(reader, key, pattern);
  return pattern;
}

/// A path for all cameras, or a mapping from camera names to paths.
CameraPaths read_paths(const ConfigReader& reader, const std::string& key) {
  if (!reader.has_section(key)) return read_pattern(reader, key);
  const ConfigReader section = reader.section(key);
  std::map<std::string, std::string> paths;
  for (const std::string& camera : section.keys()) paths[camera] = read_pattern(section, camera);
  if (paths.empty()) reader.fail_at_key(key, "is an empty mapping; name the path of each camera");
  return CameraPaths(std::move(paths));
}

ChromaKey read_chroma_key(const ConfigReader& reader, bool has_background) {
  ChromaKey key;
  key.space =
      reader.choice("space", {"hsv", "ycrcb"}, "ycrcb") == "hsv" ? ChromaKey::Space::hsv : ChromaKey::Space::ycrcb;
  key.against_background = reader.choice("against", {"colour", "background"}, "colour") == "background";
  if (key.against_background && !has_background)
    reader.fail_at_key("against", "compares with the empty studio, but the capture names no `background` images");
  if (reader.has("colour")) key.colour = reader.list<int>("colour");
  const auto no_byte = [](int value) { return value < 0 || value > 255; };
  if (key.colour.size() != 3 || std::any_of(key.colour.begin(), key.colour.end(), no_byte))
    reader.fail_at_key("colour", "must be three numbers R, G, B from 0 to 255, as in [0, 177, 64]");
  key.tolerance = reader.get("tolerance", key.tolerance, between(0.0, 181.0));
  key.min_saturation = reader.get("min_saturation", key.min_saturation, between(0.0, 1.0));
  key.smooth = reader.get("smooth", key.smooth, between(1, 31));
  if (key.smooth % 2 == 0)
    reader.fail_at_key("smooth", "is {}; the diameter of the median filter must be odd", key.smooth);
  return key;
}

BackgroundSubtraction read_subtraction(const ConfigReader& reader) {
  BackgroundSubtraction subtraction;
  if (reader.has("empty")) subtraction.empty = read_paths(reader, "empty");
  if (reader.has("frames")) {
    const std::vector<long> frames = reader.list<long>("frames");
    if (frames.size() != 2 || frames[0] < 0 || frames[1] < frames[0] || frames[1] > kMaxFrame)
      reader.fail_at_key("frames", "must be the first and the last frame of the empty scene, as in [0, 19]");
    subtraction.first_frame = frames[0];
    subtraction.last_frame = frames[1];
  } else if (subtraction.empty.empty()) {
    reader.fail_at_key("frames",
                       "is missing: name the `empty` scene, or the frames of the sequence's own video in "
                       "which nobody is there, as in `frames: [0, 19]`");
  }
  BackgroundOptions& model = subtraction.model;
  model.threshold = reader.get("threshold", model.threshold, between(0.1, 100.0));
  model.shadow = reader.get("shadow", model.shadow, between(0.05, 1.0));
  model.refine = reader.get("refine", model.refine);
  return subtraction;
}

void read_masks(const ConfigReader& reader, bool has_background, SequenceEntry& sequence) {
  const int ways = reader.has("masks") + reader.has("chroma_key") + reader.has("background_subtraction");
  if (ways > 1)
    reader.fail_at_key("masks",
                       "a sequence has either `masks`, a `chroma_key` or a `background_subtraction`, only one of them");
  if (reader.has("masks")) sequence.masks = read_paths(reader, "masks");
  if (reader.has("chroma_key")) sequence.chroma_key = read_chroma_key(reader.section("chroma_key"), has_background);
  if (reader.has("background_subtraction"))
    sequence.subtraction = read_subtraction(reader.section("background_subtraction"));
  sequence.mask_threshold = reader.get("mask_threshold", sequence.mask_threshold, between(1, 255));
  sequence.largest_component = reader.get("largest_component", sequence.largest_component);
}

void read_range(const ConfigReader& reader, SequenceEntry& sequence) {
  const ConfigReader offsets = reader.section("frame_offset");
  for (const std::string& camera : offsets.keys())
    sequence.frame_offset[camera] =
        offsets.get<double>(camera, between<double>(static_cast<double>(-kMaxFrame), static_cast<double>(kMaxFrame)));
  sequence.first_frame = reader.get("first_frame", 0L, between(0L, kMaxFrame));
  if (reader.has("last_frame")) sequence.last_frame = reader.get<long>("last_frame", between(0L, kMaxFrame));
  if (sequence.last_frame && *sequence.last_frame < sequence.first_frame)
    reader.fail_at_key("last_frame", "is {}, before first_frame {}", *sequence.last_frame, sequence.first_frame);
  sequence.cuts = reader.list<long>("cuts");
  for (std::size_t i = 0; i < sequence.cuts.size(); ++i)
    if (sequence.cuts[i] < 0 || (i > 0 && sequence.cuts[i] <= sequence.cuts[i - 1]))
      reader.fail_at_key("cuts", "must be motion rows >= 0 in ascending order; {} is at index {}", sequence.cuts[i],
                         i + 1);
}

/// `person: 1`, or `person: {near: [x, y, z]}`.
PersonChoiceOptions read_person(const ConfigReader& reader) {
  PersonChoiceOptions person;
  if (!reader.has("person")) return person;
  if (!reader.has_section("person")) {
    person.person = reader.get<int>("person", between(0, kMaxPeople));
    return person;
  }
  const ConfigReader section = reader.section("person");
  const std::vector<double> near = section.list<double>("near");
  if (near.size() != 3)
    section.fail_at_key("near", "must be a position x, y, z in the world, metres, as in [0.2, 1.0, -0.5]");
  person.near = Eigen::Vector3d(near[0], near[1], near[2]);
  return person;
}

/// The number of video frame 0 in the files of each camera.
std::map<std::string, long> read_numbers(const ConfigReader& reader, const std::string& key) {
  std::map<std::string, long> numbers;
  const ConfigReader section = reader.section(key);
  for (const std::string& camera : section.keys())
    numbers[camera] = section.get<long>(camera, between(-kMaxFrame, kMaxFrame));
  return numbers;
}

long number_of(const std::map<std::string, long>& numbers, const std::string& camera) {
  const auto found = numbers.find(camera);
  return found == numbers.end() ? 0 : found->second;
}

SequenceEntry read_sequence(const ConfigReader& reader, bool has_background) {
  SequenceEntry sequence;
  sequence.name = reader.get<std::string>("name");
  check_name(reader, "name", sequence.name);
  sequence.split = parse_split(reader.choice("split", split_words()));
  sequence.videos = read_paths(reader, "videos");
  read_masks(reader, has_background, sequence);
  if (reader.has("keypoints")) sequence.keypoints = read_paths(reader, "keypoints");
  sequence.mask_offset = read_numbers(reader, "mask_offset");
  sequence.keypoint_offset = read_numbers(reader, "keypoint_offset");
  if (reader.has("person")) sequence.person = read_person(reader);
  if (reader.has("joints3d")) sequence.joints3d = read_pattern(reader, "joints3d");
  sequence.motion = reader.get("motion", "");
  read_range(reader, sequence);
  return sequence;
}

/// Reads the landmarks, the keypoint map, the filter and the detector.
void read_evidence(const ConfigReader& reader, Capture& capture) {
  capture.landmarks = reader.get("landmarks", "");
  capture.keypoint_map = reader.get("keypoint_map", "");
  capture.person = read_person(reader);
  if (reader.has("detector")) capture.detector = read_person_network(reader.section("detector"));
  const ConfigReader filter = reader.section("keypoint_filter");
  KeypointFilter& options = capture.keypoint_filter;
  options.window = filter.get("window", options.window, between(0, 1000));
  options.outlier = filter.get("outlier", options.outlier, between(1e-4, 1.0));
  options.sigma = filter.get("sigma", options.sigma, between(0.0, 1000.0));
}

void read_rates(const ConfigReader& reader, Capture& capture) {
  const Range<double> rates = between(1e-3, 1e5);
  capture.fps = reader.get("fps", 25.0, rates);
  const ConfigReader own = reader.section("camera_fps");
  for (const std::string& camera : own.keys()) capture.camera_fps[camera] = own.get<double>(camera, rates);
}

void read_sequences(const ConfigReader& reader, Capture& capture) {
  std::set<std::string> names;
  for (const ConfigReader& section : reader.sections("sequences")) {
    capture.sequences.push_back(read_sequence(section, !capture.background.empty()));
    if (!names.insert(capture.sequences.back().name).second)
      section.fail_at_key("name", "two sequences are called '{}'", capture.sequences.back().name);
  }
  if (capture.sequences.empty()) reader.fail_at_key("sequences", "a capture needs at least one sequence");
}

fs::path read_root(const ConfigReader& reader, const fs::path& folder) {
  // Through symbolic links, as the file system goes: `..` of a link is the folder above its target.
  const fs::path root = folder_path(fs::weakly_canonical(folder / reader.get("root", ".")));
  if (!fs::is_directory(root)) reader.fail_at_key("root", "the folder {} does not exist", root.string());
  check_without_braces(root.string());
  return root;
}

YAML::Node paths_node(const CameraPaths& paths) {
  if (paths.by_camera().empty()) return YAML::Node(paths.sample());
  YAML::Node node;
  for (const auto& [camera, path] : paths.by_camera()) node[camera] = path;
  return node;
}

YAML::Node chroma_key_node(const ChromaKey& key) {
  YAML::Node node;
  node["space"] = key.space == ChromaKey::Space::hsv ? "hsv" : "ycrcb";
  node["against"] = key.against_background ? "background" : "colour";
  node["colour"] = key.colour;
  node["colour"].SetStyle(YAML::EmitterStyle::Flow);
  node["tolerance"] = key.tolerance;
  node["min_saturation"] = key.min_saturation;
  node["smooth"] = key.smooth;
  return node;
}

YAML::Node subtraction_node(const BackgroundSubtraction& subtraction) {
  YAML::Node node;
  if (!subtraction.empty.empty()) node["empty"] = paths_node(subtraction.empty);
  if (subtraction.last_frame) {
    node["frames"] = std::vector<long>{subtraction.first_frame, *subtraction.last_frame};
    node["frames"].SetStyle(YAML::EmitterStyle::Flow);
  }
  node["threshold"] = subtraction.model.threshold;
  node["shadow"] = subtraction.model.shadow;
  node["refine"] = subtraction.model.refine;
  return node;
}

YAML::Node person_node(const PersonChoiceOptions& person) {
  if (person.person) return YAML::Node(*person.person);
  YAML::Node node;
  node["near"] = std::vector<double>{person.near->x(), person.near->y(), person.near->z()};
  node["near"].SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

YAML::Node filter_node(const KeypointFilter& filter) {
  YAML::Node node;
  node["window"] = filter.window;
  node["outlier"] = filter.outlier;
  node["sigma"] = filter.sigma;
  return node;
}

YAML::Node sequence_node(const SequenceEntry& sequence) {
  YAML::Node node;
  node["name"] = sequence.name;
  node["split"] = to_string(sequence.split);
  node["videos"] = paths_node(sequence.videos);
  if (sequence.chroma_key)
    node["chroma_key"] = chroma_key_node(*sequence.chroma_key);
  else if (sequence.subtraction)
    node["background_subtraction"] = subtraction_node(*sequence.subtraction);
  else if (!sequence.masks.empty())
    node["masks"] = paths_node(sequence.masks);
  for (const auto& [camera, offset] : sequence.mask_offset) node["mask_offset"][camera] = offset;
  const SequenceEntry usual;
  if (sequence.has_masks() || sequence.mask_threshold != usual.mask_threshold)
    node["mask_threshold"] = sequence.mask_threshold;
  if (sequence.has_masks() || sequence.largest_component != usual.largest_component)
    node["largest_component"] = sequence.largest_component;
  if (!sequence.keypoints.empty()) node["keypoints"] = paths_node(sequence.keypoints);
  for (const auto& [camera, offset] : sequence.keypoint_offset) node["keypoint_offset"][camera] = offset;
  if (sequence.person && sequence.person->names_person()) node["person"] = person_node(*sequence.person);
  if (!sequence.joints3d.empty()) node["joints3d"] = sequence.joints3d;
  if (!sequence.motion.empty()) node["motion"] = sequence.motion;
  for (const auto& [camera, offset] : sequence.frame_offset) node["frame_offset"][camera] = offset;
  node["first_frame"] = sequence.first_frame;
  if (sequence.last_frame) node["last_frame"] = *sequence.last_frame;
  if (!sequence.cuts.empty()) {
    node["cuts"] = sequence.cuts;
    node["cuts"].SetStyle(YAML::EmitterStyle::Flow);
  }
  return node;
}

/// `root` relative to `folder` when it is in or beside this folder; otherwise absolute.
fs::path portable_root(const fs::path& root, const fs::path& folder) {
  const fs::path relative = fs::weakly_canonical(root).lexically_relative(fs::weakly_canonical(folder));
  const auto ups = std::count(relative.begin(), relative.end(), fs::path(".."));
  return relative.empty() || ups > 1 ? fs::absolute(root).lexically_normal() : relative;
}

}  // namespace

const std::vector<std::string>& split_words() {
  static const std::vector<std::string> words{"train", "test", "validation"};  // in the order of the enumeration
  return words;
}

Split parse_split(const std::string& word) {
  const auto found = std::find(split_words().begin(), split_words().end(), word);
  if (found == split_words().end())
    fail<UsageError>("'{}' is not a split; the splits are train, validation and test", word);
  return static_cast<Split>(found - split_words().begin());
}

std::string to_string(Split split) { return split_words()[static_cast<int>(split)]; }

long SequenceEntry::mask_offset_of(const std::string& camera) const { return number_of(mask_offset, camera); }
long SequenceEntry::keypoint_offset_of(const std::string& camera) const { return number_of(keypoint_offset, camera); }

void SequenceEntry::require_masks(const std::string& command) const {
  if (has_masks()) return;
  fail(
      "sequence {} has no masks, which {} needs; name `masks`, or let them be computed by a `chroma_key`, or by a "
      "`background_subtraction` with images of the empty scene (docs/capture.md). `doppel detect CAPTURE --out DIR "
      "--masks` finds masks in the videos; DIR is then a capture with them",
      name, command);
}

fs::path Capture::resolve(const std::string& written) const {
  const fs::path path(written);
  return (path.is_absolute() ? path : root / path).lexically_normal();
}

std::string Capture::source(const CameraPaths& paths, int file_index, const std::string& camera) const {
  return resolve(expand_camera(paths.of(camera), file_index, camera)).string();
}

FrameClock Capture::clock(const SequenceEntry& sequence, const std::string& camera) const {
  const auto own_fps = camera_fps.find(camera);
  const auto offset = sequence.frame_offset.find(camera);
  return {own_fps == camera_fps.end() ? 1.0 : own_fps->second / fps,
          offset == sequence.frame_offset.end() ? 0.0 : offset->second};
}

fs::path Capture::character_path() const {
  if (character.empty())
    fail(
        "{} names no character, which this command needs; make one (`doppel character create`, `import`, `fit` or "
        "`build`, docs/character.md) and add `character: PATH` to {}",
        name, file.empty() ? "its capture.yaml" : file.string());
  return resolve(character);
}

bool Capture::has_keypoints() const {
  return detector || std::any_of(sequences.begin(), sequences.end(),
                                 [](const SequenceEntry& sequence) { return !sequence.keypoints.empty(); });
}

Capture read_capture(const fs::path& file_or_folder) {
  const fs::path file = fs::is_directory(file_or_folder) ? file_or_folder / "capture.yaml" : file_or_folder;
  const ConfigDocument document = ConfigDocument::load(file);
  const ConfigReader reader = document.root();
  if (!reader.has("doppel_capture"))
    reader.fail_at_key("", "is not a capture description: the key `doppel_capture: {}` is missing", kSchemaVersion);
  const long version = reader.get<long>("doppel_capture");
  if (version != kSchemaVersion)
    reader.fail_at_key("doppel_capture", "has version {}; this program reads version {}", version, kSchemaVersion);

  Capture capture;
  capture.file = fs::absolute(file).lexically_normal();
  capture.root = read_root(reader, capture.file.parent_path());
  capture.name = reader.get("name", capture.root.filename().string());
  check_name(reader, "name", capture.name);
  capture.character = reader.get("character", "");
  capture.calibration = reader.get<std::string>("calibration");
  if (reader.has("unit")) capture.calibration_options.unit = reader.choice("unit", {"m", "cm", "mm"}, "m");
  if (reader.has("up"))
    capture.calibration_options.up = reader.choice("up", {"+x", "-x", "+y", "-y", "+z", "-z"}, "+y");
  capture.calibration_options.subject = reader.get("subject", "");
  read_rates(reader, capture);
  capture.cameras = reader.list<std::string>("cameras");
  if (std::set<std::string>(capture.cameras.begin(), capture.cameras.end()).size() != capture.cameras.size())
    reader.fail_at_key("cameras", "names a camera twice");
  if (reader.has("background")) capture.background = read_pattern(reader, "background");
  read_evidence(reader, capture);
  read_sequences(reader, capture);
  reader.finish();
  return capture;
}

void check_capture_out(const fs::path& path) {
  static const std::string kMark = "# Written by `doppel ";
  if (!fs::exists(path)) return;
  std::string line;
  std::ifstream file(path);
  std::getline(file, line);
  if (!line.starts_with(kMark))
    fail<UsageError>(
        "{} exists, and its first line does not say that doppel wrote it; choose another name with --out, or remove it",
        path.string());
}

void write_capture(const fs::path& path, const Capture& capture, const std::vector<std::string>& comments) {
  YAML::Node node;
  node["doppel_capture"] = kSchemaVersion;
  node["name"] = capture.name;
  node["root"] = portable_root(capture.root, fs::absolute(path).parent_path()).string();
  if (!capture.character.empty()) node["character"] = capture.character;
  node["calibration"] = capture.calibration;
  if (!capture.calibration_options.unit.empty()) node["unit"] = capture.calibration_options.unit;
  if (!capture.calibration_options.up.empty()) node["up"] = capture.calibration_options.up;
  if (!capture.calibration_options.subject.empty()) node["subject"] = capture.calibration_options.subject;
  node["fps"] = capture.fps;
  for (const auto& [camera, fps] : capture.camera_fps) node["camera_fps"][camera] = fps;
  if (!capture.cameras.empty()) {
    node["cameras"] = capture.cameras;
    node["cameras"].SetStyle(YAML::EmitterStyle::Flow);
  }
  if (!capture.background.empty()) node["background"] = capture.background;
  if (!capture.landmarks.empty()) node["landmarks"] = capture.landmarks;
  if (!capture.keypoint_map.empty()) node["keypoint_map"] = capture.keypoint_map;
  if (capture.person.names_person()) node["person"] = person_node(capture.person);
  if (capture.detector) node["detector"] = person_network_node(*capture.detector);
  if (!(capture.keypoint_filter == KeypointFilter())) node["keypoint_filter"] = filter_node(capture.keypoint_filter);
  for (const SequenceEntry& sequence : capture.sequences) node["sequences"].push_back(sequence_node(sequence));
  YAML::Emitter emitter;
  emitter << node;
  std::string text;
  for (std::string comment : comments) {
    std::replace(comment.begin(), comment.end(), '\n', ' ');
    text += "# " + comment + "\n";
  }
  write_atomically(path, text + emitter.c_str() + "\n");
}

}  // namespace doppel
