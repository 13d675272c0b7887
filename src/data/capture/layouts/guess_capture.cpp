#include "doppel/data/capture/layouts/guess_capture.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <regex>

#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/layouts/name_words.h"
#include "doppel/data/capture/layouts/sequence_files.h"

namespace doppel {

namespace {

constexpr double kMaxDrift = 0.5;  // frames; more at the end of a video needs a rate of its own
constexpr std::size_t kShownFiles = 3;
constexpr double kSameCentre = 0.01;  ///< metres between two calibrations of one camera

std::string some_of(const std::vector<std::string>& paths) {
  const std::size_t shown = std::min(paths.size(), kShownFiles);
  return fmt::format("{}{}", fmt::join(paths.begin(), paths.begin() + static_cast<std::ptrdiff_t>(shown), ", "),
                     paths.size() > shown ? fmt::format(" and {} more", paths.size() - shown) : "");
}

/// The largest distance between cameras of the same position in two lists; nothing if the lists differ in length.
std::optional<double> largest_distance(const std::vector<Camera>& a, const std::vector<Camera>& b) {
  if (a.size() != b.size()) return std::nullopt;
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i].centre() - b[i].centre()).norm());
  return largest;
}

template <typename T, typename Wanted>
std::vector<T> filtered(const std::vector<T>& all, Wanted wanted) {
  std::vector<T> chosen;
  std::copy_if(all.begin(), all.end(), std::back_inserter(chosen), wanted);
  return chosen;
}

using Streams = std::vector<FileStream>;

/// The streams that the first expression matches which matches any; without expressions, those with a role.
Streams matching(const Streams& streams, const std::vector<std::string>& expressions, FileRole role,
                 const std::vector<std::string>& cameras) {
  if (expressions.empty())
    return filtered(streams,
                    [&](const FileStream& stream) { return role_of_file(stream.first_file, cameras) == role; });
  for (const std::string& expression : expressions) {
    const std::regex wanted(expression);
    Streams found =
        filtered(streams, [&](const FileStream& stream) { return std::regex_search(stream.first_file, wanted); });
    if (!found.empty()) return found;
  }
  return {};
}

/// Videos, or where those have fewer cameras, images.
SortedFiles best_files(const Streams& streams, const std::vector<std::string>& cameras) {
  const auto of_kind = [&](FileKind kind) {
    return sort_files(filtered(streams,
                               [&](const FileStream& stream) {
                                 return stream.kind == kind && (stream.per_frame || kind != FileKind::image);
                               }),
                      cameras);
  };
  SortedFiles videos = of_kind(FileKind::video), images = of_kind(FileKind::image);
  return images.most_cameras() > videos.most_cameras() ? images : videos;
}

/// Fills in a guess, part by part.
class Guesser {
 public:
  Guesser(const FolderContent& content, const GuessHints& hints)
      : content_(content), hints_(hints), streams_(group_streams(content.files)) {
    guess_.capture.root = content.root;
    guess_.capture.name = usable_name(content.root.filename().string(), "capture");
  }

  CaptureGuess run() {
    choose_calibration();
    if (calibration_) {
      find_sequences();
      choose_cameras();
      find_rates();
      check_sizes();
      find_masks();
      find_keypoints();
    }
    find_body();
    guess_.found.insert(guess_.found.end(), content_.notes.begin(), content_.notes.end());
    guess_.complete = calibration_ && !guess_.capture.sequences.empty();
    return std::move(guess_);
  }

 private:
  template <typename... Args>
  void found(fmt::format_string<Args...> format, Args&&... args) {
    guess_.found.push_back(fmt::format(format, std::forward<Args>(args)...));
  }
  template <typename... Args>
  void missing(fmt::format_string<Args...> format, Args&&... args) {
    guess_.missing.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  SortedFiles footage_of(const std::vector<std::string>& cameras) const {
    return best_files(matching(streams_, hints_.videos, FileRole::footage, cameras), cameras);
  }

  // ---- the calibration ----

  static std::vector<std::string> names_of(const FoundCalibration& found) {
    std::vector<std::string> names;
    for (const Camera& camera : found.calibration.cameras) names.push_back(camera.name);
    return names;
  }

  /// More matched cameras are better, then names that match, then cameras with sizes, then fewer assumptions about
  /// unit and axes, then the upper folder. Of equals, the first by name is taken.
  auto rank(const FoundCalibration& candidate) const {
    const auto& cameras = candidate.calibration.cameras;
    const bool sized =
        std::all_of(cameras.begin(), cameras.end(), [](const Camera& camera) { return camera.width > 0; });
    const auto depth = -static_cast<long>(path_parts(candidate.path).size());
    const SortedFiles files = footage_of(names_of(candidate));
    const auto assumptions = -static_cast<long>(candidate.calibration.notes.size());
    return std::make_tuple(files.most_cameras(), -static_cast<int>(files.way), sized, assumptions, depth);
  }

  /// Whether a calibration has one camera, as others in its folder have.
  bool is_one_of_several(const FoundCalibration& found) const {
    const auto is_alike = [&](const FoundCalibration& other) {
      return other.calibration.cameras.size() == 1 && folder_of(other.path) == folder_of(found.path) &&
             other.calibration.format == found.calibration.format;
    };
    return is_alike(found) && std::count_if(content_.calibrations.begin(), content_.calibrations.end(), is_alike) > 1;
  }

  void choose_calibration() {
    std::vector<const FoundCalibration*> candidates;
    for (const FoundCalibration& candidate : content_.calibrations) {
      const auto fits = [&](const std::string& hint) { return std::regex_search(candidate.path, std::regex(hint)); };
      const std::vector<std::string>& hints = hints_.calibration;
      if (!hints.empty() && std::none_of(hints.begin(), hints.end(), fits)) continue;
      if (is_one_of_several(candidate)) continue;
      candidates.push_back(&candidate);
      if (!calibration_ || rank(candidate) > rank(*calibration_)) calibration_ = &candidate;
    }
    if (!calibration_) {
      if (const auto alone = std::find_if(content_.calibrations.begin(), content_.calibrations.end(),
                                          [&](const FoundCalibration& found) { return is_one_of_several(found); });
          alone != content_.calibrations.end())
        missing(
            "one calibration of all cameras: {} and the files beside it hold one camera each; put the cameras into one "
            "file, or use a format with a file for each camera (docs/calibration.md)",
            alone->path);
      missing(
          "no calibration with the poses of the cameras; put one of the formats of docs/calibration.md into the "
          "folder");
      return;
    }
    names_ = names_of(*calibration_);
    guess_.capture.calibration = calibration_->path;
    tell_calibration(candidates);
  }

  void tell_calibration(const std::vector<const FoundCalibration*>& candidates) {
    const Calibration& chosen = calibration_->calibration;
    found("calibration: {} ({}, {} cameras, unit {}, up {})", calibration_->path, chosen.format, names_.size(),
          chosen.unit, chosen.up);
    for (const std::string& note : chosen.notes) found("calibration: {}", note);
    for (const FoundCalibration* other : candidates)
      if (other != calibration_) tell_other_calibration(*other);
    if (chosen.up == "unknown") missing("the axis that points up is not known; state `up` (+x ... -z)");
    if (!chosen.has_scale)
      missing(
          "the calibration has no scale; lengths of the person will be wrong until the cameras are scaled to metres");
  }

  void tell_other_calibration(const FoundCalibration& other) {
    const auto& [path, calibration] = other;
    const std::optional<double> apart = largest_distance(calibration_->calibration.cameras, calibration.cameras);
    const std::string why =
        !apart ? "is not used; name it as `calibration` to use it"
        : *apart <= kSameCentre
            ? fmt::format("has the same cameras within {:.1f} mm; it is not used", 1e3 * *apart)
            : fmt::format(
                  "has the same number of cameras in other positions, up to {:.3g} m apart; it is not used. If it "
                  "is the right one, name it as `calibration`",
                  *apart);
    found("calibration: {} ({}, {} cameras) {}", path, calibration.format, calibration.cameras.size(), why);
  }

  // ---- sequences ----

  void find_sequences() {
    SortedFiles all = footage_of(names_);
    const std::size_t most = all.most_cameras();
    for (SequenceFiles& sequence : all.sequences) {
      if (2 * sequence.by_camera.size() < most)
        found("footage: {} of {} cameras is not used, because other footage has {} cameras",
              some_of({sequence.by_camera.begin()->second.path}), sequence.by_camera.size(), most);
      else
        filmed_.push_back(std::move(sequence));
    }
    if (!all.unmatched.empty())
      found("footage: {} {} no camera of the calibration; not used", some_of(all.unmatched),
            all.unmatched.size() == 1 ? "matches" : "match");
    if (filmed_.empty()) tell_no_footage();
    count_positions_of_steps();
    std::set<std::string> used;
    for (const SequenceFiles& sequence : filmed_) add_sequence(sequence, all.way, used);
    tell_splits();
  }

  void tell_no_footage() {
    const Streams images = filtered(matching(streams_, hints_.videos, FileRole::footage, names_),
                                    [](const FileStream& stream) { return stream.kind == FileKind::image; });
    if (images.empty())
      return missing(
          "no videos, and no folders of images; put one video for each camera into the folder, named like the "
          "camera: {}",
          some_of(names_));
    missing(
        "footage of the cameras: no video or folder of images is named like one of them ({}); there are images such as "
        "{}. Where each folder is a frame, put these folders into a folder `frames`, or write `videos: "
        "frames/{{frame}}/{{name}}.png` into a capture.yaml (docs/capture.md)",
        some_of(names_), images.front().first_file);
  }

  /// Frames are the positions of images that are numbered in steps, and of the masks and keypoints in the same steps.
  void count_positions_of_steps() {
    std::set<long> steps;
    for (SequenceFiles& sequence : filmed_) {
      const long step = sequence.by_camera.begin()->second.step;
      const bool all = step > 1 && std::all_of(sequence.by_camera.begin(), sequence.by_camera.end(),
                                               [&](const auto& e) { return e.second.step == step && e.second.alone; });
      if (!all) continue;
      steps.insert(step);
      for (auto& [camera, stream] : sequence.by_camera) stream.count_positions();
    }
    for (FileStream& stream : streams_)
      if (stream.alone && steps.contains(stream.step)) stream.count_positions();
  }

  /// Something must be for training.
  void tell_splits() {
    std::vector<SequenceEntry>& all = guess_.capture.sequences;
    const bool trains = std::any_of(all.begin(), all.end(), [](const auto& s) { return s.split == Split::train; });
    for (SequenceEntry& entry : all) {
      if (entry.split == Split::train) continue;
      if (trains)
        found("sequence {}: split {}, by its name", entry.name, to_string(entry.split));
      else
        found("sequence {}: split train, though its name says {}: no other sequence is for training", entry.name,
              to_string(entry.split));
      if (!trains) entry.split = Split::train;
    }
  }

  void add_sequence(const SequenceFiles& sequence, CameraMatch::Way way, std::set<std::string>& used) {
    const bool telling =
        std::any_of(sequence.name.begin(), sequence.name.end(), [](unsigned char c) { return std::isalpha(c); });
    SequenceEntry entry;
    const std::string name = usable_name(telling               ? sequence.name
                                         : filmed_.size() == 1 ? guess_.capture.name
                                                               : "sequence_" + sequence.name,
                                         "sequence");
    entry.name = name;
    for (int i = 2; !used.insert(entry.name).second; ++i) entry.name = fmt::format("{}_{}", name.substr(0, 56), i);
    const auto any_of = [&](std::initializer_list<const char*> words) {
      return std::any_of(words.begin(), words.end(), [&](const char* word) { return sequence.words.count(word) > 0; });
    };
    entry.split = any_of({"test", "testing"})     ? Split::test
                  : any_of({"validation", "val"}) ? Split::validation
                                                  : Split::train;
    entry.videos = paths_of_cameras(sequence.paths(), names_);
    found("sequence {}: {} of {} cameras, matched {}: {}", entry.name,
          sequence.by_camera.begin()->second.per_frame ? "images" : "videos", sequence.by_camera.size(), to_string(way),
          entry.videos.to_string());
    set_first_frame(sequence, entry);
    guess_.capture.sequences.push_back(std::move(entry));
  }

  void set_first_frame(const SequenceFiles& sequence, SequenceEntry& entry) {
    tell_numbering(sequence, entry.name);
    long first = 0, last = std::numeric_limits<long>::max(), shortest = last, longest = 0;
    for (const auto& [camera, stream] : sequence.by_camera) {
      first = std::max(first, stream.first_frame);
      last = std::min(last, stream.last_frame);
      shortest = std::min(shortest, stream.last_frame - stream.first_frame + 1);
      longest = std::max(longest, stream.last_frame - stream.first_frame + 1);
    }
    if (first == 0) return;
    // Of common numbers, cameras that began late have fewer.
    const bool shifted = shortest == longest && last - first + 1 < shortest;
    if (shifted || 2 * (last - first + 1) < shortest) return set_own_first_frames(sequence, entry);
    for (const auto& [camera, stream] : sequence.by_camera)
      entry.frame_offset[names_[camera]] = static_cast<double>(first);
    found("sequence {}: all cameras have images from number {} on, so `frame_offset` is {}", entry.name, first, first);
  }

  /// Cameras that name their files themselves count from other numbers.
  void set_own_first_frames(const SequenceFiles& sequence, SequenceEntry& entry) {
    std::string numbers;
    for (const auto& [camera, stream] : sequence.by_camera) {
      entry.frame_offset[names_[camera]] = static_cast<double>(stream.first_frame);
      numbers += fmt::format("{}{} {}", numbers.empty() ? "" : ", ", names_[camera], stream.first_frame);
    }
    found(
        "sequence {}: each camera numbers its images in its own way; they are taken to begin at the same time, so "
        "`frame_offset` is the first number: {}",
        entry.name, numbers);
  }

  void tell_numbering(const SequenceFiles& sequence, const std::string& name) {
    for (const auto& [camera, stream] : sequence.by_camera) {
      if (stream.by_position && stream.step > 1)
        return found(
            "sequence {}: the images of {} are numbered in steps of {}; the frames are their positions, so `fps` is "
            "the rate at which these images follow each other",
            name, stream.path, stream.step);
      if (stream.by_position)
        return found(
            "sequence {}: the images of {} have times as names; the frames are their positions in natural order, and "
            "images that were lost are not noticed",
            name, stream.path);
      const long numbers = stream.last_frame - stream.first_frame + 1;
      if (stream.per_frame && stream.files < numbers)
        return missing(
            "sequence {}: {} images: {} has {} for the numbers {} to {}; number them without gaps, and the files of "
            "masks and keypoints alike",
            name, numbers - stream.files, stream.path, stream.files, stream.first_frame, stream.last_frame);
    }
  }

  /// The cameras of all sequences.
  void choose_cameras() {
    if (filmed_.empty()) return;
    std::vector<std::string> unfilmed;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      const bool everywhere = std::all_of(filmed_.begin(), filmed_.end(), [&](const SequenceFiles& sequence) {
        return sequence.by_camera.count(static_cast<int>(i)) > 0;
      });
      if (everywhere)
        used_.push_back(static_cast<int>(i));
      else
        unfilmed.push_back(names_[i]);
    }
    if (unfilmed.empty()) return;
    for (const int camera : used_) guess_.capture.cameras.push_back(names_[camera]);
    found("cameras: {} of the calibration's {} are used; {} {} not filmed in every sequence", used_.size(),
          names_.size(), some_of(unfilmed), unfilmed.size() == 1 ? "is" : "are");
    if (used_.empty()) {
      const bool single = std::all_of(filmed_.begin(), filmed_.end(),
                                      [](const SequenceFiles& sequence) { return sequence.by_camera.size() == 1; });
      if (single)
        missing(
            "nothing in the names of the videos tells which of them were filmed together; give the videos of one take "
            "the same name but for the camera (walk_{0}.mp4, {0}/walk.mp4), or name them for each camera under "
            "`videos` "
            "in a capture.yaml (docs/capture.md)",
            names_.front());
      else
        missing("no camera filmed all sequences; write a capture.yaml for each of them");
      guess_.capture.sequences.clear();
    }
  }

  // ---- rates and sizes ----

  /// Calls `use(camera, stream, facts)` for the footage of a sequence that could be opened.
  template <typename Use>
  void each_footage(const SequenceFiles& sequence, Use use) const {
    for (const auto& [camera, stream] : sequence.by_camera)
      if (const auto facts = content_.footage.find(stream.first_file); facts != content_.footage.end())
        use(camera, stream, facts->second);
  }

  void find_rates() {
    using Rate = std::pair<double, long>;  // fps and frames
    std::map<double, int> count;
    std::vector<std::map<int, Rate>> rates(filmed_.size());  // [sequences] by camera
    for (std::size_t i = 0; i < filmed_.size(); ++i)
      each_footage(filmed_[i], [&](int camera, const FileStream&, const FootageFacts& facts) {
        if (facts.fps <= 0.0) return;
        ++count[facts.fps];
        rates[i][camera] = {facts.fps, facts.frames};
      });
    if (count.empty()) {
      if (!filmed_.empty())
        missing("images have no frame rate; `fps: {}` is assumed, state the true one", guess_.capture.fps);
      return;
    }
    const auto usual =
        std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    guess_.capture.fps = usual->first;
    found("fps: {:.6g}, from the videos", usual->first);
    const auto drift = [&](const Rate& rate) {
      return std::abs(rate.first / usual->first - 1.0) * static_cast<double>(rate.second);
    };
    for (std::size_t i = 0; i < filmed_.size(); ++i) {
      const bool all = !rates[i].empty() && std::all_of(rates[i].begin(), rates[i].end(), [&](const auto& camera) {
        return drift(camera.second) >= kMaxDrift && camera.second.first == rates[i].begin()->second.first;
      });
      if (all && filmed_.size() > 1) {
        missing(
            "one rate for all sequences: {} has {:.6g} frames a second, others {:.6g}, which is the `fps` of all; make "
            "a capture for each rate",
            guess_.capture.sequences.size() > i ? guess_.capture.sequences[i].name : filmed_[i].name,
            rates[i].begin()->second.first, usual->first);
        continue;
      }
      for (const auto& [camera, rate] : rates[i]) {
        if (drift(rate) < kMaxDrift || guess_.capture.camera_fps.contains(names_[camera])) continue;
        guess_.capture.camera_fps[names_[camera]] = rate.first;
        found("fps: the video of {} says {:.6g}, {:.1f} frames off at its end, so `camera_fps` names it",
              names_[camera], rate.first, drift(rate));
      }
    }
    tell_lengths();
  }

  void tell_lengths() {
    for (std::size_t i = 0; i < guess_.capture.sequences.size(); ++i) {
      std::set<long> lengths;
      each_footage(filmed_[i], [&](int, const FileStream&, const FootageFacts& facts) {
        if (facts.frames > 0) lengths.insert(facts.frames);
      });
      if (lengths.size() > 1)
        found(
            "sequence {}: the videos have {} to {} frames; they are taken to begin at the same time, or `frame_offset` "
            "is needed",
            guess_.capture.sequences[i].name, *lengths.begin(), *lengths.rbegin());
    }
  }

  void check_sizes() {
    for (const SequenceFiles& sequence : filmed_)
      each_footage(sequence, [&](int camera, const FileStream& stream, const FootageFacts& facts) {
        check_size(calibration_->calibration.cameras[camera], facts, stream.path);
      });
  }

  void check_size(const Camera& camera, const FootageFacts& facts, const std::string& path) {
    if (camera.width == 0 || (camera.width == facts.width && camera.height == facts.height)) return;
    const std::string sizes = fmt::format("{} is {}x{}, the calibration of {} is for {}x{}", path, facts.width,
                                          facts.height, camera.name, camera.width, camera.height);
    const double stretch = static_cast<double>(facts.width) / facts.height * camera.height / camera.width - 1.0;
    if (is_without_padding(camera, {facts.width, facts.height}))
      found("size: {}; the difference is taken for padding of the encoder", sizes);
    else if (std::abs(stretch) <= kMaxStretch)
      found("size: {}; the calibration is scaled", sizes);
    else
      missing("{}, another aspect ratio: the images were cropped or turned, or this is not their camera", sizes);
  }

  // ---- masks, keypoints, body ----

  bool has_all(const SequenceFiles& sequence) const {
    return std::all_of(used_.begin(), used_.end(), [&](int camera) { return sequence.by_camera.count(camera) > 0; });
  }
  /// The paths of the used cameras.
  CameraPaths paths_of(const SequenceFiles& sequence) const {
    std::map<int, std::string> paths;
    for (const int camera : used_) paths[camera] = sequence.by_camera.at(camera).path;
    return paths_of_cameras(paths, names_);
  }
  /// The sequence of a role that belongs to sequence `i` and has all cameras; tells if it lacks some.
  const SequenceFiles* files_for(std::size_t i, const SortedFiles& sequences, const char* role) {
    const SequenceFiles* sequence = files_of_sequence(i, filmed_, sequences);
    if (!sequence || has_all(*sequence)) return sequence;
    found("{}: {} has {} of {} cameras; not used", role, sequence->by_camera.begin()->second.path,
          sequence->by_camera.size(), used_.size());
    return nullptr;
  }

  void find_masks() {
    if (guess_.capture.sequences.empty()) return;
    const SortedFiles masks = best_files(matching(streams_, hints_.masks, FileRole::masks, names_), names_);
    const SortedFiles empty = empty_files();
    for (std::size_t i = 0; i < guess_.capture.sequences.size(); ++i) {
      SequenceEntry& entry = guess_.capture.sequences[i];
      if (const SequenceFiles* sequence = files_for(i, masks, "masks")) {
        entry.masks = paths_of(*sequence);
        entry.mask_threshold = hints_.mask_threshold;
        found("sequence {}: masks, matched {}: {}", entry.name, to_string(masks.way), entry.masks.to_string());
        for (const int camera : used_)
          set_mask_offset(camera, filmed_[i].by_camera.at(camera), sequence->by_camera.at(camera), entry);
        tell_offset(entry, "masks", "mask_offset", entry.mask_offset);
        if (entry.mask_threshold == SequenceEntry().mask_threshold) fit_threshold(*sequence, entry);
      } else if (const SequenceFiles* scene = empty.sequences.size() == 1 && has_all(empty.sequences[0])
                                                  ? &empty.sequences[0]
                                                  : files_for(i, empty, "empty")) {
        entry.subtraction.emplace().empty = paths_of(*scene);
        found("sequence {}: masks by background subtraction from the empty scene: {}", entry.name,
              entry.subtraction->empty.to_string());
      } else {
        missing(
            "sequence {} has no masks; without them the outline does not count. Add masks (a folder `masks`), or film "
            "the empty scene (a folder `empty`) and run this command again, or find them with `doppel detect --masks`",
            entry.name);
      }
    }
  }

  /// Masks are numbered as keypoints are, see set_keypoint_offset.
  void set_mask_offset(int camera, const FileStream& footage, const FileStream& masks, SequenceEntry& entry) {
    const auto filmed = filmed_frames(footage);
    if (masks.per_frame && filmed)
      set_offset(camera, *filmed, {"masks", "mask_offset", masks.path, {masks.first_frame, masks.last_frame}},
                 entry.mask_offset);
  }

  /// Lowers the threshold where masks hold labels, or are dim.
  void fit_threshold(const SequenceFiles& sequence, SequenceEntry& entry) {
    for (const int camera : used_) {
      const FileStream& stream = sequence.by_camera.at(camera);
      const auto looked_at = content_.masks.find(stream.first_file);
      if (looked_at == content_.masks.end()) continue;
      const MaskValues& masks = looked_at->second;
      if (const auto needed = masks.needed_threshold(); needed && *needed < entry.mask_threshold) {
        entry.mask_threshold = *needed;
        found("sequence {}: mask_threshold: {}, because the masks {} have the values {}", entry.name, *needed,
              stream.path, masks.to_string());
      } else if (!needed && masks.has_dark_labels()) {
        found(
            "sequence {}: the masks {} have the values {}; those below mask_threshold ({}) are not the person. If they "
            "are, set mask_threshold to the smallest of them",
            entry.name, stream.path, masks.to_string(), entry.mask_threshold);
      }
    }
  }

  /// One image for each camera is as good as a video, and looks like a stream of frames.
  SortedFiles empty_files() const {
    const std::vector<std::string> files = filtered(
        content_.files, [&](const std::string& file) { return role_of_file(file, names_) == FileRole::empty; });
    const auto sorted = [&](bool per_frame) {
      return sort_files(filtered(group_streams(files, per_frame),
                                 [](const FileStream& stream) {
                                   return stream.kind == FileKind::video || stream.kind == FileKind::image;
                                 }),
                        names_);
    };
    SortedFiles streams = sorted(true), singles = sorted(false);
    return singles.most_cameras() > streams.most_cameras() ? singles : streams;
  }

  void find_keypoints() {
    if (guess_.capture.sequences.empty()) return;
    Streams files, tables, singles;
    for (const FileStream& stream : streams_)
      if (content_.keypoint_maps.count(stream.first_file) > 0)
        (stream.kind == FileKind::table ? tables : files).push_back(stream);
    std::set<std::string> folders;  // whose files may be one for each camera, and not for each frame
    bool are_whole = false;         // whether such files hold several frames
    for (const FileStream& stream : files) {
      const auto frames = content_.keypoint_frames.find(stream.first_file);
      const bool whole = frames != content_.keypoint_frames.end() && frames->second.first < frames->second.second;
      are_whole |= whole && stream.per_frame;
      if (whole || stream.files == static_cast<long>(names_.size())) folders.insert(folder_of(stream.first_file));
    }
    for (const FileStream& stream : group_streams(content_.files, false))
      if (stream.kind == FileKind::json && folders.count(folder_of(stream.path)) > 0) singles.push_back(stream);
    SortedFiles sequences = sort_files(files, names_);
    SortedFiles by_camera = sort_files(singles, names_);
    if (by_camera.most_cameras() + (are_whole ? 1 : 0) > sequences.most_cameras()) sequences = std::move(by_camera);
    for (std::size_t i = 0; i < guess_.capture.sequences.size(); ++i) set_keypoints(i, sequences, tables);
    choose_map(files);
    find_joints();
  }

  /// A table of joints in space does not name its camera.
  void find_joints() {
    if (content_.joint_tables.empty()) return;
    SequenceEntry& entry = guess_.capture.sequences.front();
    if (used_.size() == 1 && filmed_.size() == 1 && content_.joint_tables.size() == 1 && !entry.keypoints.empty()) {
      entry.joints3d = content_.joint_tables.front();
      found("sequence {}: joints in space: {}", entry.name, entry.joints3d);
    } else {
      found("joints in space: {}; not used, because only one table of one camera with keypoints is certain",
            some_of(content_.joint_tables));
    }
  }

  void set_keypoints(std::size_t i, const SortedFiles& sequences, const Streams& tables) {
    SequenceEntry& entry = guess_.capture.sequences[i];
    SortedFiles by_camera = sequences;
    const SequenceFiles* files = files_for(i, sequences, "keypoints");
    const bool only_table = !files && filmed_.size() == 1 && tables.size() == 1;
    if (!files && !only_table) {
      by_camera = sort_files(tables, names_);
      files = files_for(i, by_camera, "keypoints");
    }
    if (!files && !only_table) {
      missing(
          "sequence {} has no keypoints; `doppel track` then runs `doppel detect`. Files of another detector "
          "(OpenPose, MMPose, ...) belong into folders named like the cameras (docs/capture.md)",
          entry.name);
      return;
    }
    entry.keypoints = only_table ? CameraPaths(tables.front().path) : paths_of(*files);
    found("sequence {}: keypoints{}: {}", entry.name, only_table ? "" : ", matched " + to_string(by_camera.way),
          entry.keypoints.to_string());
    for (const int camera : used_)
      set_keypoint_offset(camera, filmed_[i].by_camera.at(camera),
                          only_table ? tables.front() : files->by_camera.at(camera), entry);
    tell_offset(entry, "keypoints", "keypoint_offset", entry.keypoint_offset);
  }

  /// The numbers of the first and the last frame of a camera; nothing where they are not known.
  std::optional<std::pair<long, long>> filmed_frames(const FileStream& footage) const {
    if (footage.per_frame) return std::pair(footage.first_frame, footage.last_frame);
    const auto facts = content_.footage.find(footage.first_file);
    if (facts == content_.footage.end() || facts->second.frames <= 0) return std::nullopt;
    return std::pair(0L, facts->second.frames - 1);
  }
  std::optional<std::pair<long, long>> keypoint_frames(const FileStream& keypoints) const {
    if (keypoints.per_frame) return std::pair(keypoints.first_frame, keypoints.last_frame);
    const auto frames = content_.keypoint_frames.find(keypoints.first_file);
    return frames == content_.keypoint_frames.end() ? std::nullopt : std::optional(frames->second);
  }

  /// The number of frame 0 among files that cannot have the numbers of the frames: as many files have others, or the
  /// last is of no frame. Both are first and last numbers. @return nothing where number n may be of frame n
  static std::optional<long> number_of_first(const std::pair<long, long>& filmed, const std::pair<long, long>& files) {
    if (files.second - files.first == filmed.second - filmed.first) return files.first - filmed.first;
    if (files.second == filmed.second + 1 && files.first > filmed.first) return 1;
    return std::nullopt;
  }

  /// Files of a camera with the first and the last of their numbers. `kind` and `key` are for messages.
  struct NumberedFiles {
    const char* kind;
    const char* key;
    std::string path;
    std::pair<long, long> numbers;
  };
  /// Notes the number of frame 0 if it cannot be 0, and tells where nothing decides it. @return whether it did either
  bool set_offset(int camera, const std::pair<long, long>& filmed, const NumberedFiles& files,
                  std::map<std::string, long>& offsets) {
    const auto& [first, last] = files.numbers;
    if (files.numbers == filmed) return true;
    if (const auto offset = number_of_first(filmed, files.numbers)) {
      offsets[names_[camera]] = *offset;
      return true;
    }
    if (last <= filmed.second) return false;
    missing(
        "certainty about the {} of {}: {} has numbers {} to {}, the footage has the frames {} to {}; number n is taken "
        "to be of frame n. State `{}` if that is wrong",
        files.kind, names_[camera], files.path, first, last, filmed.first, filmed.second, files.key);
    return true;
  }

  /// Keypoints have the numbers of the frames that they were found in, unless these numbers cannot be: a detector may
  /// have seen images that were numbered from 1, or from another frame on.
  void set_keypoint_offset(int camera, const FileStream& footage, const FileStream& keypoints, SequenceEntry& entry) {
    const auto filmed = filmed_frames(footage), seen = keypoint_frames(keypoints);
    if (!filmed || !seen) return;
    const bool done =
        set_offset(camera, *filmed, {"keypoints", "keypoint_offset", keypoints.path, *seen}, entry.keypoint_offset);
    if (!done && keypoints.per_frame && seen->first != filmed->first)
      found(
          "sequence {}: the keypoint files of {} begin with number {}, the footage with {}; number n is taken to be of "
          "frame n",
          entry.name, names_[camera], seen->first, filmed->first);
  }

  /// @param files, key for the message @param offsets of the sequence, by camera
  void tell_offset(const SequenceEntry& entry, const char* files, const char* key,
                   const std::map<std::string, long>& offsets) {
    std::map<long, std::vector<std::string>> cameras;
    for (const auto& [camera, offset] : offsets) cameras[offset].push_back(camera);
    for (const auto& [offset, names] : cameras)
      found(
          "sequence {}: the {} of {} have the number n of frame n {} {}: there are as many, or the last number is of "
          "no frame; so `{}` is {}",
          entry.name, files, some_of(names), offset < 0 ? '+' : '-', std::abs(offset), key, offset);
  }

  void choose_map(const Streams& files) {
    const auto& sequences = guess_.capture.sequences;
    if (files.empty() ||
        std::all_of(sequences.begin(), sequences.end(), [](const auto& s) { return s.keypoints.empty(); }))
      return;
    const std::vector<std::string>& maps = content_.keypoint_maps.at(files.front().first_file);
    guess_.capture.keypoint_map = maps.front();
    found("keypoint_map: {}, by the number and the order of the points", maps.front());
    if (maps.size() > 1)
      missing(
          "certainty about `keypoint_map`: {} have as many points, and the limbs do not decide between them; {} is "
          "taken",
          fmt::join(maps, ", "), maps.front());
  }

  std::vector<std::string> files_with(const std::string& extension) const {
    return filtered(content_.files, [&](const std::string& file) { return file.ends_with(extension); });
  }

  void find_body() {
    const std::vector<std::string> characters = files_with(".character");
    if (characters.size() == 1) {
      guess_.capture.character = characters.front();
      found("character: {}", characters.front());
    } else if (characters.empty()) {
      missing(
          "no character (*.character); make one with `doppel character create` from a scan, `import` from a rigged "
          "figure, or `fit` from this capture alone, and add `character: PATH`");
    } else {
      missing("several characters ({}); name one of them as `character`", some_of(characters));
    }
    for (const std::string& file : content_.files)
      if (file == "landmarks.csv" || file.ends_with("/landmarks.csv")) {
        guess_.capture.landmarks = file;
        found("landmarks: {}", file);
        break;
      }
    find_motions();
  }

  /// Motions beside the character are rest poses.
  void find_motions() {
    std::set<std::string> folders;
    for (const std::string& character : files_with(".character")) folders.insert(folder_of(character));
    const std::vector<std::string> motions =
        filtered(files_with(".motion"), [&](const std::string& file) { return folders.count(folder_of(file)) == 0; });
    for (std::size_t i = 0; i < guess_.capture.sequences.size(); ++i) {
      const std::vector<std::string> own = filtered(motions, [&](const std::string& file) {
        return belong_to(i, filmed_, telling_name(file), telling_words(file));
      });
      SequenceEntry& entry = guess_.capture.sequences[i];
      if (own.size() == 1) entry.motion = own.front();
      if (own.size() == 1) found("sequence {}: motion: {}", entry.name, own.front());
      if (own.size() > 1) missing("sequence {}: several motions ({}); name one of them", entry.name, some_of(own));
    }
  }

  const FolderContent& content_;
  const GuessHints& hints_;
  Streams streams_;
  CaptureGuess guess_;
  const FoundCalibration* calibration_ = nullptr;
  std::vector<std::string> names_;     ///< of the calibration's cameras
  std::vector<SequenceFiles> filmed_;  ///< [sequences]
  std::vector<int> used_;              ///< indices of the cameras
};

}  // namespace

CaptureGuess guess_capture(const FolderContent& content, const GuessHints& hints) {
  return Guesser(content, hints).run();
}

}  // namespace doppel
