#include "doppel/data/capture/capture_layouts.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <climits>
#include <functional>
#include <map>
#include <regex>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/core/text_reader.h"
#include "doppel/data/capture/dataset_layouts.h"
#include "doppel/data/capture/name_words.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// Files of one folder whose names differ only in a number, e.g. stream000.mp4, stream001.mp4.
struct NumberedFiles {
  std::string pattern;  ///< file name with {camera} or {camera:03}
  std::set<long> numbers;
};

std::vector<fs::path> sorted_entries(const fs::path& folder) {
  std::vector<fs::path> entries;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder)) entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  return entries;
}

/// The numbered files of `folder` with this prefix and one of the extensions (the first that occurs), or nothing.
std::optional<NumberedFiles> numbered_files(const fs::path& folder, const std::string& prefix,
                                            const std::vector<std::string>& extensions) {
  for (const std::string& extension : extensions) {
    const std::regex form("^" + prefix + "([0-9]{1,6})\\." + extension + "$");
    NumberedFiles files;
    std::size_t shortest = 6, longest = 0;
    for (const fs::path& path : sorted_entries(folder)) {
      std::smatch match;
      const std::string name = path.filename().string();
      if (!std::regex_match(name, match, form)) continue;
      files.numbers.insert(std::stol(match[1]));
      shortest = std::min<std::size_t>(shortest, match[1].length());
      longest = std::max<std::size_t>(longest, match[1].length());
    }
    if (files.numbers.empty()) continue;
    const bool padded = shortest == longest && longest > 1;
    files.pattern = prefix + (padded ? fmt::format("{{camera:0{}}}", longest) : "{camera}") + "." + extension;
    return files;
  }
  return std::nullopt;
}

const std::vector<std::string> kVideoExtensions{"mp4", "avi", "mkv", "mov"};
const std::vector<std::string> kMaskExtensions{"mkv", "mp4", "avi", "mov"};

/// A layout of videos and masks below training/ and testing/ in the public releases.
struct Layout {
  std::string name, video_folder, mask_folder, prefix;
};
const std::vector<Layout> kLayouts{
    {"ASH/TriHuman", "videos", "foregroundSegmentation", "stream"},
    {"ASH/TriHuman", "images", "foregroundSegmentation", "stream"},
    {"ASH/TriHuman", ".", "foregroundSegmentation", "stream"},
    {"ASH/TriHuman", "videos", "segmentation_videos", "stream"},
    {"DynaCap", "img", "fg", "c_"},
};

std::string relative_to(const fs::path& path, const fs::path& root) { return path.lexically_relative(root).string(); }

/// Files below `folder` (at most `depth` levels) that `wanted` accepts, the upper levels first.
std::vector<fs::path> find_files(const fs::path& folder, int depth,
                                 const std::function<bool(const fs::path&)>& wanted) {
  std::vector<fs::path> found, level{folder};
  for (int at = 0; at <= depth && found.empty(); ++at) {
    std::vector<fs::path> next;
    for (const fs::path& directory : level)
      for (const fs::path& entry : sorted_entries(directory)) {
        if (fs::is_directory(entry)) next.push_back(entry);
        if (fs::is_regular_file(entry) && wanted(entry)) found.push_back(entry);
      }
    level = std::move(next);
  }
  return found;
}

/// The one file of a kind; `usual` decides between several.
fs::path find_only(const fs::path& folder, const std::string& kind, const std::vector<std::string>& extensions,
                   const std::vector<std::string>& usual) {
  const std::vector<fs::path> found = find_files(folder, 2, [&](const fs::path& path) {
    return std::find(extensions.begin(), extensions.end(), path.extension()) != extensions.end();
  });
  if (found.empty())
    fail(
        "{} looks like a capture, but no {} (*{}) lies in it or up to two folders below; put it there, or write a "
        "capture.yaml that names it (docs/capture.md)",
        folder.string(), kind, fmt::join(extensions, ", *"));
  for (const std::string& name : usual)
    for (const fs::path& path : found)
      if (path.filename() == name) return path;
  if (found.size() > 1)
    fail(
        "{} holds several files that may be the {}: {} and {}; write a capture.yaml that names the right one "
        "(docs/capture.md)",
        folder.string(), kind, relative_to(found[0], folder), relative_to(found[1], folder));
  return found[0];
}

/// The poses of a split: in its folder, or beside it (ASH keeps skeletoolToGTPose and skeletoolToGTPoseTest apart);
/// empty when there are none.
fs::path find_motion(const fs::path& folder, const std::string& split) {
  const auto is_poses = [](const fs::path& path) { return path.filename() == "poseAngles.motion"; };
  std::vector<fs::path> found = find_files(folder / split, 2, is_poses);
  const std::string wanted = split == "training" ? "skeletoolToGTPose" : "skeletoolToGTPoseTest";
  if (found.empty())
    found = find_files(folder, 3,
                       [&](const fs::path& path) { return is_poses(path) && path.parent_path().filename() == wanted; });
  if (found.empty()) return {};
  if (found.size() == 1) return found[0];
  fail(
      "{} has videos, but several poses (poseAngles.motion); put the right one into {}/skeletoolToGTPose/, or write a "
      "capture.yaml that names it (docs/capture.md)",
      (folder / split).string(), split);
}

/// The rows of `frames.csv` at which the segment number changes.
std::vector<long> read_cuts(const fs::path& path) {
  TextReader reader(path, "a table of frames and segments", Separator::comma);
  reader.require_header("frame,segment");
  std::vector<long> cuts;
  std::optional<long> last_frame, last_segment;
  while (reader.next_row(2)) {
    const long frame = reader.integer(0, "the frame", 0, INT_MAX);
    const long segment = reader.integer(1, "the segment", LONG_MIN, LONG_MAX);
    if (last_frame && frame != *last_frame + 1)
      reader.fail_here("frame {} follows frame {}; frames must count up by one", frame, last_frame.value_or(-1));
    if (last_segment && segment != *last_segment) cuts.push_back(frame);
    last_frame = frame;
    last_segment = segment;
  }
  return cuts;
}

/// OpenPose files as `keypoints/NNN/streamNNN_FFFFFFFFFFFF_keypoints.json`, when the first camera has them.
std::string find_keypoints(const fs::path& split_folder, long camera) {
  const std::string pattern = "keypoints/{camera:03}/stream{camera:03}_{frame:012}_keypoints.json";
  return fs::is_regular_file(split_folder / expand_pattern(pattern, static_cast<int>(camera), "", 0)) ? pattern : "";
}

struct FoundSequence {
  SequenceEntry entry;
  std::string layout;
  std::set<long> cameras;
};

std::optional<FoundSequence> find_sequence(const fs::path& folder, const std::string& split) {
  for (const Layout& layout : kLayouts) {
    const fs::path base = folder / split;
    const auto videos = numbered_files(base / layout.video_folder, layout.prefix, kVideoExtensions);
    if (!videos) continue;
    const auto masks = numbered_files(base / layout.mask_folder, layout.prefix, kMaskExtensions);
    if (!masks) continue;
    FoundSequence found;
    found.layout = layout.name;
    std::set_intersection(videos->numbers.begin(), videos->numbers.end(), masks->numbers.begin(), masks->numbers.end(),
                          std::inserter(found.cameras, found.cameras.end()));
    found.entry.name = split;
    found.entry.split = split == "training" ? Split::train : Split::test;
    found.entry.videos = (fs::path(split) / layout.video_folder / videos->pattern).lexically_normal().string();
    found.entry.masks = (fs::path(split) / layout.mask_folder / masks->pattern).lexically_normal().string();
    found.entry.largest_component = layout.name == "DynaCap";
    if (found.cameras.empty())
      fail("{} holds videos and masks, but none of the same camera; check the numbers in the file names",
           base.string());
    const std::string keypoints = find_keypoints(base, *found.cameras.begin());
    if (!keypoints.empty()) found.entry.keypoints = split + "/" + keypoints;
    if (fs::is_regular_file(base / "frames.csv")) found.entry.cuts = read_cuts(base / "frames.csv");
    return found;
  }
  return std::nullopt;
}

/// `background/<cam>/NAME`, with the first NAME that the folders of all cameras contain.
std::string find_background_folders(const fs::path& folder) {
  std::vector<fs::path> cameras;
  std::size_t shortest = 6, longest = 0;
  for (const fs::path& entry : sorted_entries(folder)) {
    const std::string name = entry.filename().string();
    if (!fs::is_directory(entry) || name.size() > 6 ||
        !std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c); }))
      continue;
    cameras.push_back(entry);
    shortest = std::min(shortest, name.size());
    longest = std::max(longest, name.size());
  }
  if (cameras.empty()) return "";
  const std::string camera = shortest == longest && longest > 1 ? fmt::format("{{camera:0{}}}", longest) : "{camera}";
  for (const fs::path& entry : sorted_entries(cameras[0])) {
    const std::string name = entry.filename().string();
    const bool image = entry.extension() == ".png" || entry.extension() == ".jpg";
    const bool everywhere = std::all_of(cameras.begin(), cameras.end(),
                                        [&](const fs::path& other) { return fs::is_regular_file(other / name); });
    if (image && everywhere && name.find_first_of("{}") == std::string::npos)
      return "background/" + camera + "/" + name;
  }
  return "";
}

/// The images of the empty studio: `background/NNN.png`, or an image that all folders `background/<cam>/` contain.
std::string find_background(const fs::path& folder) {
  const auto files = numbered_files(folder / "background", "", {"png", "jpg"});
  return files ? "background/" + files->pattern : find_background_folders(folder / "background");
}

/// The names of the cameras that have a video in every sequence; empty when all cameras have one.
std::vector<std::string> common_cameras(const std::vector<FoundSequence>& sequences, const std::vector<Camera>& all) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto has = [&](const FoundSequence& sequence) { return sequence.cameras.count(static_cast<long>(i)) > 0; };
    if (std::all_of(sequences.begin(), sequences.end(), has)) names.push_back(all[i].name);
  }
  return names.size() == all.size() ? std::vector<std::string>() : names;
}

std::optional<RecognisedCapture> recognise_studio(const fs::path& folder) {
  std::vector<FoundSequence> sequences;
  for (const std::string split : {"training", "testing"})
    if (const auto found = find_sequence(folder, split)) sequences.push_back(*found);
  if (sequences.empty()) return std::nullopt;

  RecognisedCapture result;
  result.layout = sequences[0].layout;
  Capture& capture = result.capture;
  capture.root = fs::absolute(folder).lexically_normal();
  if (!capture.root.has_filename()) capture.root = capture.root.parent_path();
  capture.name = usable_name(fs::weakly_canonical(folder).filename().string(), "capture");
  const fs::path calibration = find_only(capture.root, "calibration", {".calibration", ".calib"},
                                         {"cameras.calibration", "cameras_corrected.calibration", "cameras.calib"});
  capture.calibration = relative_to(calibration, capture.root);
  capture.character = relative_to(
      find_only(capture.root, "character", {".character"}, {"ddc.character", "actor.character"}), capture.root);
  capture.background = find_background(capture.root);
  if (fs::is_regular_file(capture.root / "landmarks.csv")) capture.landmarks = "landmarks.csv";
  for (FoundSequence& sequence : sequences) {
    sequence.entry.motion = relative_to(find_motion(capture.root, sequence.entry.name), capture.root);
    capture.sequences.push_back(sequence.entry);
    result.notes.push_back(
        fmt::format("{}: {} cameras, videos {}, masks {}, poses {}, {} cuts", sequence.entry.name,
                    sequence.cameras.size(), sequence.entry.videos.to_string(), sequence.entry.masks.to_string(),
                    sequence.entry.motion.empty() ? "none" : sequence.entry.motion, sequence.entry.cuts.size()));
  }
  const std::vector<Camera> cameras = read_posed_cameras(calibration);
  capture.cameras = common_cameras(sequences, cameras);
  if (capture.cameras.empty() && sequences[0].cameras.size() < cameras.size())
    fail("{}: none of the {} cameras of {} has a video in every sequence", folder.string(), cameras.size(),
         capture.calibration);
  result.notes.push_back("calibration " + capture.calibration + ", character " + capture.character);
  return result;
}

}  // namespace

std::optional<RecognisedCapture> recognise_capture(const fs::path& folder) {
  if (auto studio = recognise_studio(folder)) return studio;
  return recognise_dataset(folder);
}

Capture find_capture(const fs::path& file_or_folder) {
  if (!fs::exists(file_or_folder)) fail("there is no file or folder {}", file_or_folder.string());
  if (!fs::is_directory(file_or_folder) || fs::exists(file_or_folder / "capture.yaml"))
    return read_capture(file_or_folder);
  const auto recognised = recognise_capture(file_or_folder);
  if (!recognised)
    fail(
        "{} has no capture.yaml and is not laid out like a public dataset (DynaCap: training/img/c_<camera>.avi with "
        "training/fg/; ASH and TriHuman: training/videos/streamNNN.mp4 with training/foregroundSegmentation/; {}); let "
        "`doppel capture init {}` write a capture.yaml, or write one as docs/capture.md shows",
        file_or_folder.string(), fmt::join(dataset_names(), ", "), file_or_folder.string());
  log::info("{}: recognised the {} layout", file_or_folder.string(), recognised->layout);
  for (const std::string& note : recognised->notes) log::info("  {}", note);
  for (const std::string& note : recognised->missing) log::info("  missing: {}", note);
  return recognised->capture;
}

}  // namespace doppel
