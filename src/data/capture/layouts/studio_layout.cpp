#include "doppel/data/capture/layouts/studio_layout.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <climits>
#include <regex>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/path_pattern.h"
#include "doppel/core/text_reader.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/data/capture/video.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kVideoExtensions{"mp4", "avi", "mkv", "mov"};
const std::vector<std::string> kMaskExtensions{"mkv", "mp4", "avi", "mov"};

/// `{camera}`, or `{camera:03}` where all numbers are written with as many digits.
std::string camera_placeholder(const std::vector<std::string>& numbers) {
  const auto [shortest, longest] = std::minmax_element(
      numbers.begin(), numbers.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
  const std::size_t digits = longest->size();
  return shortest->size() == digits && digits > 1 ? fmt::format("{{camera:0{}}}", digits) : "{camera}";
}

/// Files of one folder whose names differ only in the number of the camera, e.g. stream000.mp4, stream001.mp4.
struct NumberedFiles {
  std::string path;  ///< with {camera} or {camera:03}
  std::set<long> numbers;
};

/// The numbered files of `folder` with this prefix and one of the extensions (the first that occurs), or nothing.
std::optional<NumberedFiles> numbered_files(const FolderListing& listing, const std::string& folder,
                                            const std::string& prefix, const std::vector<std::string>& extensions) {
  for (const std::string& extension : extensions) {
    const std::regex form(prefix + "([0-9]{1,6})\\." + extension);
    std::vector<std::string> numbers;
    NumberedFiles files;
    for (const std::string& name : listing.at(folder).files) {
      std::smatch match;
      if (!std::regex_match(name, match, form)) continue;
      numbers.push_back(match[1]);
      files.numbers.insert(std::stol(numbers.back()));
    }
    if (numbers.empty()) continue;
    files.path = folder + "/" + prefix + camera_placeholder(numbers) + "." + extension;
    return files;
  }
  return std::nullopt;
}

/// Paths of the files below `folder` (at most `depth` levels) that `wanted` accepts: those of the uppermost level that
/// has any.
template <typename Wanted>
std::vector<fs::path> find_files(const FolderListing& listing, const fs::path& folder, int depth, Wanted wanted) {
  std::vector<fs::path> found, level{folder};
  for (int at = 0; at <= depth && found.empty(); ++at) {
    std::vector<fs::path> next;
    for (const fs::path& here : level) {
      const FolderListing::Folder& inside = listing.at(here.string());
      for (const std::string& name : inside.folders) next.push_back(here / name);
      for (const std::string& name : inside.files)
        if (wanted(here / name)) found.push_back(here / name);
    }
    level = std::move(next);
  }
  return found;
}

/// The one file of a kind; `usual` decides between several.
std::string find_only(const FolderListing& listing, const std::string& kind, const std::vector<std::string>& extensions,
                      const std::vector<std::string>& usual) {
  const std::vector<fs::path> found = find_files(listing, "", 2, [&](const fs::path& path) {
    return std::find(extensions.begin(), extensions.end(), path.extension()) != extensions.end();
  });
  if (found.empty())
    fail(
        "{} looks like a capture, but no {} (*{}) lies in it or up to two folders below; put it there, or write a "
        "capture.yaml that names it (docs/capture.md)",
        listing.root().string(), kind, fmt::join(extensions, ", *"));
  for (const std::string& name : usual)
    for (const fs::path& path : found)
      if (path.filename() == name) return path.string();
  if (found.size() > 1)
    fail(
        "{} holds several files that may be the {}: {} and {}; write a capture.yaml that names the right one "
        "(docs/capture.md)",
        listing.root().string(), kind, found[0].string(), found[1].string());
  return found[0].string();
}

/// The poses of a split: in its folder, or beside it (ASH keeps skeletoolToGTPose and skeletoolToGTPoseTest apart);
/// empty when there are none.
std::string find_motion(const FolderListing& listing, const std::string& split) {
  const auto is_poses = [](const fs::path& path) { return path.filename() == "poseAngles.motion"; };
  std::vector<fs::path> found = find_files(listing, split, 2, is_poses);
  const std::string wanted = split == "training" ? "skeletoolToGTPose" : "skeletoolToGTPoseTest";
  if (found.empty())
    found = find_files(listing, "", 3,
                       [&](const fs::path& path) { return is_poses(path) && path.parent_path().filename() == wanted; });
  if (found.empty()) return "";
  if (found.size() == 1) return found[0].string();
  fail(
      "{} has videos, but several poses (poseAngles.motion); put the right one into {}/skeletoolToGTPose/, or write a "
      "capture.yaml that names it (docs/capture.md)",
      listing.full(split).string(), split);
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

/// The images of the empty studio: `background/NNN.png`, or `background/<camera>/NAME`, with the first NAME that the
/// folders of all cameras contain.
std::string find_background(const FolderListing& listing) {
  if (const auto files = numbered_files(listing, "background", "", {"png", "jpg"})) return files->path;
  std::vector<std::string> cameras;
  for (const std::string& name : listing.at("background").folders)
    if (name.size() <= 6 && std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c); }))
      cameras.push_back(name);
  if (cameras.empty()) return "";
  for (const std::string& name : listing.at("background/" + cameras[0]).files) {
    const std::string extension = fs::path(name).extension().string();
    const bool usable = (extension == ".png" || extension == ".jpg") && name.find_first_of("{}") == std::string::npos;
    if (usable && std::all_of(cameras.begin(), cameras.end(), [&](const std::string& camera) {
          return listing.has_file("background/" + camera + "/" + name);
        }))
      return "background/" + camera_placeholder(cameras) + "/" + name;
  }
  return "";
}

/// The videos and masks of a split, without what else belongs to its sequence.
struct FoundSequence {
  std::string split;
  NumberedFiles videos, masks;
  std::set<long> cameras;  ///< those that have both
};

std::vector<FoundSequence> find_sequences(const StudioRelease& release, const FolderListing& listing) {
  std::vector<FoundSequence> sequences;
  for (const std::string split : {"training", "testing"})
    for (const StudioRelease::Folders& folders : release.folders) {
      const std::string video_folder = folders.videos.empty() ? split : split + "/" + folders.videos;
      const auto videos = numbered_files(listing, video_folder, release.prefix, kVideoExtensions);
      const auto masks = numbered_files(listing, split + "/" + folders.masks, release.prefix, kMaskExtensions);
      if (!videos || !masks) continue;
      FoundSequence& found = sequences.emplace_back(FoundSequence{split, *videos, *masks, {}});
      std::set_intersection(videos->numbers.begin(), videos->numbers.end(), masks->numbers.begin(),
                            masks->numbers.end(), std::inserter(found.cameras, found.cameras.end()));
      break;
    }
  return sequences;
}

SequenceEntry sequence_entry(const FoundSequence& found, const FolderListing& listing) {
  const std::string& split = found.split;
  if (found.cameras.empty())
    fail("{} holds videos and masks, but none of the same camera; check the numbers in the file names",
         listing.full(split).string());
  SequenceEntry entry;
  entry.name = split;
  entry.split = split == "training" ? Split::train : Split::test;
  entry.videos = found.videos.path;
  entry.masks = found.masks.path;
  entry.motion = find_motion(listing, split);
  const std::string keypoints = split + "/keypoints/{camera:03}/stream{camera:03}_{frame:012}_keypoints.json";
  if (listing.has_file(expand_pattern(keypoints, static_cast<int>(*found.cameras.begin()), "", 0)))
    entry.keypoints = keypoints;
  if (listing.has_file(split + "/frames.csv")) entry.cuts = read_cuts(listing.full(split + "/frames.csv"));
  return entry;
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

/// Takes the frame rate of the first video, and tells it where it is not the usual one.
void find_rate(const FoundSequence& sequence, CaptureGuess& guess) {
  Capture& capture = guess.capture;
  const std::string path = expand_pattern(sequence.videos.path, static_cast<int>(*sequence.cameras.begin()), "", 0);
  double fps = 0.0;
  try {
    fps = inspect_footage((capture.root / path).string()).fps;
  } catch (const Error&) {  // whoever reads the video tells what is wrong with it
  }
  if (fps <= 0.0 || fps == capture.fps) return;
  guess.found.push_back(
      fmt::format("fps: {:.6g}, from {} (datasets of this layout usually have {:.6g})", fps, path, capture.fps));
  capture.fps = fps;
}

CaptureGuess guess_studio(const StudioRelease& release, const FolderListing& listing) {
  CaptureGuess guess;
  guess.complete = true;
  Capture& capture = guess.capture;
  capture.root = listing.root();
  capture.name = usable_name(fs::weakly_canonical(capture.root).filename().string(), "capture");
  const std::vector<FoundSequence> sequences = find_sequences(release, listing);
  capture.calibration = find_only(listing, "calibration", {".calibration", ".calib"},
                                  {"cameras.calibration", "cameras_corrected.calibration", "cameras.calib"});
  capture.character = find_only(listing, "character", {".character"}, {"ddc.character", "actor.character"});
  capture.background = find_background(listing);
  if (listing.has_file("landmarks.csv")) capture.landmarks = "landmarks.csv";
  for (const FoundSequence& found : sequences) {
    SequenceEntry entry = sequence_entry(found, listing);
    entry.largest_component = release.largest_component;
    guess.found.push_back(fmt::format("{}: {} cameras, videos {}, masks {}, poses {}, {} cuts", entry.name,
                                      found.cameras.size(), entry.videos.to_string(), entry.masks.to_string(),
                                      entry.motion.empty() ? "none" : entry.motion, entry.cuts.size()));
    capture.sequences.push_back(std::move(entry));
  }
  find_rate(sequences[0], guess);
  const std::vector<Camera> cameras = read_posed_cameras(listing.full(capture.calibration));
  capture.cameras = common_cameras(sequences, cameras);
  if (capture.cameras.empty() && sequences[0].cameras.size() < cameras.size())
    fail("{}: none of the {} cameras of {} has a video in every sequence", listing.root().string(), cameras.size(),
         capture.calibration);
  guess.found.push_back("calibration " + capture.calibration + ", character " + capture.character);
  return guess;
}

/// The folders of the first sequence.
std::optional<std::string> find_sign(const StudioRelease& release, const FolderListing& listing) {
  const std::vector<FoundSequence> sequences = find_sequences(release, listing);
  if (sequences.empty()) return std::nullopt;
  return folder_of(sequences[0].videos.path) + " and " + folder_of(sequences[0].masks.path);
}

}  // namespace

FolderLayout studio_layout(StudioRelease release) {
  return {release.name, true, [release](const FolderListing& listing) { return find_sign(release, listing); },
          [release](const FolderListing& listing) { return guess_studio(release, listing); }};
}

}  // namespace doppel
