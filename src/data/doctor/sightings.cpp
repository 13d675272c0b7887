#include "doppel/data/doctor/sightings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/doctor/statistics.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "doppel/detect/keypoints/limbs.h"
#include "doppel/detect/keypoints/read_keypoints.h"

namespace doppel {

namespace {

using Eigen::Vector2d;

constexpr long kPiece = 60;           ///< consecutive rows that are read of a long sequence
constexpr long kMaxProbed = 1000000;  ///< keypoint files that are counted where there is no video
constexpr int kWindows = 20, kMinWindow = 4, kMaxWindow = 40;
constexpr double kSeenShare = 0.5;  ///< of the camera's median confidence: below, a point counts as not seen
constexpr double kMinConfidence = 0.05;
constexpr double kUsualDistance = 3.0;  ///< of the cameras from their middle

/// The parts of the body that detectors agree on. Points of hands and faces are left out.
const std::set<std::string>& body_parts() {
  static const std::set<std::string> kParts = [] {
    std::set<std::string> parts{"nose", "neck"};
    for (const char* part : {"Eye", "Ear", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "BigToe", "Heel"})
      for (const char* side : {"L", "R"}) parts.insert(landmark_key(std::string(side) + part));
    parts.insert(landmark_key("MidHip"));
    return parts;
  }();
  return kParts;
}

void add_unreadable(const Camera& camera, const Error& error, std::vector<Finding>& findings) {
  findings.push_back({camera.name, faults::kUnreadable, Severity::fault, "a file cannot be read",
                      std::string(error.what()) + ". Replace the file, or correct its path in capture.yaml."});
}

/// The video's size and length; nothing, with a finding, when it cannot be read.
std::optional<FootageFacts> facts_of_video(const Capture& capture, const SequenceEntry& sequence, const Camera& camera,
                                           int file_index, std::vector<Finding>& findings) {
  try {
    const std::string source = capture.source(sequence.videos, file_index, camera.name);
    const auto reader = open_frames(source, PixelFormat::colour);
    const cv::Size size = reader->size();
    return FootageFacts{size.width, size.height, 0.0, reader->num_frames(sequence.last_frame.value_or(-2) + 1)};
  } catch (const Error& error) {
    add_unreadable(camera, error, findings);
    return std::nullopt;
  }
}

/// The camera for its images, even where calibration and images contradict each other.
Camera fitted_camera(const Camera& camera, const FootageFacts& video, std::vector<Finding>& findings) {
  try {
    return fit_to_images(camera, {video.width, video.height}, "the video");
  } catch (const Error&) {
    findings.push_back(
        {camera.name, faults::kWrongResolution, Severity::fault,
         fmt::format("the images have {}x{} pixels, the calibration is for {}x{}", video.width, video.height,
                     camera.width, camera.height),
         camera.width == video.height && camera.height == video.width
             ? "The images are turned by 90 degrees against the calibration. Turn them back, or calibrate again."
             : "The shapes differ, so the images were cropped or turned, or this is the calibration of another "
               "camera. Use the images as they were calibrated, or calibrate this size."});
    Camera scaled = camera;
    scaled.K.row(0) *= static_cast<double>(video.width) / camera.width;
    scaled.K.row(1) *= static_cast<double>(video.height) / camera.height;
    scaled.width = video.width;
    scaled.height = video.height;
    return scaled;
  }
}

/// Whether the files state the names of their points: then these decide, whatever the map says.
bool names_its_points(const std::string& source, const KeypointCamera& camera) {
  std::filesystem::path file = source;
  if (has_frame_placeholder(source))
    file = expand_pattern(source, 0, "", frames_of_pattern(source).front());
  else if (std::filesystem::is_directory(source))
    file = keypoint_files_of_folder(source).begin()->second;
  return !read_detections(file, camera).points.empty();
}

class SightingsReader {
 public:
  SightingsReader(const Capture& capture, long most_rows, std::vector<Finding>& findings, bool footage)
      : capture_(capture), most_rows_(most_rows), findings_(findings), footage_(footage) {}

  Sightings read() {
    if (capture_.sequences.empty())
      fail("{}: the capture has no sequences, so there is nothing to examine", capture_.name);
    CaptureCameras chosen = choose_cameras(capture_);
    seen_.up = load_calibration(capture_.calibration_path(), capture_.calibration_options).up;
    seen_.calibrated = chosen.cameras;
    seen_.cameras = chosen.cameras;
    seen_.file_index = chosen.file_index;
    note_times();
    inspect_videos();
    seen_.people.resize(seen_.cameras.size());
    choose_points();
    for (std::size_t s = 0; s < capture_.sequences.size(); ++s) read_sequence(static_cast<int>(s));
    normalise_scale(seen_);
    complete_sightings(seen_);
    return std::move(seen_);
  }

 private:
  void note_times() {
    for (const SequenceEntry& sequence : capture_.sequences) {
      seen_.sequences.push_back(sequence.name);
      seen_.times.emplace_back();
      for (const Camera& camera : seen_.cameras)
        seen_.times.back().push_back({capture_.clock(sequence, camera.name), sequence.keypoint_offset_of(camera.name),
                                      sequence.mask_offset_of(camera.name)});
    }
  }

  void inspect_videos() {
    rows_.resize(capture_.sequences.size());
    for (std::size_t c = 0; c < seen_.cameras.size(); ++c) {
      const Camera calibrated = seen_.calibrated[c];
      bool fitted = false;
      for (std::size_t s = 0; s < capture_.sequences.size(); ++s) {
        const SequenceEntry& sequence = capture_.sequences[s];
        if (!footage_ && !has_images(capture_, sequence, calibrated, seen_.file_index[c])) continue;
        const auto video = facts_of_video(capture_, sequence, calibrated, seen_.file_index[c], findings_);
        if (!video) continue;
        rows_[s].push_back(capture_.clock(sequence, calibrated.name).num_rows(video->frames));
        if (!fitted) seen_.cameras[c] = fitted_camera(calibrated, *video, findings_);
        fitted = true;
      }
      Camera& camera = seen_.cameras[c];
      if (camera.width > 0) continue;  // else neither calibration nor images say it, and the middle of the lens must
      camera.width = static_cast<int>(std::lround(2.0 * camera.K(0, 2)));
      camera.height = static_cast<int>(std::lround(2.0 * camera.K(1, 2)));
    }
  }

  /// The layout of the keypoints. The files decide it where they can, because `keypoint_map` may be wrong.
  void choose_points() {
    if (!capture_.has_keypoints()) return;
    try {
      const PointLayout layout = layout_of_files();
      layout_ = layout;
      for (std::size_t i = 0; i < layout.points.size(); ++i) {
        const std::string key = landmark_key(layout.points[i]);
        if (body_parts().count(key) == 0 || seen_.point(key) >= 0) continue;
        seen_.points.push_back(key);
        indices_.push_back(i);
      }
      if (seen_.points.size() < 5) {  // a detector with names of its own
        seen_.points = layout.points;
        indices_.resize(layout.points.size());
        for (std::size_t i = 0; i < indices_.size(); ++i) indices_[i] = i;
      }
      seen_.mirrored = mirrored_indices(seen_.points);
    } catch (const Error& error) {
      findings_.push_back(
          {"", faults::kUnreadable, Severity::fault, "the keypoints cannot be read", std::string(error.what()) + "."});
    }
  }

  PointLayout layout_of_files() {
    for (const SequenceEntry& sequence : capture_.sequences)
      for (std::size_t c = 0; c < seen_.cameras.size() && !sequence.keypoints.empty(); ++c) try {
          const std::string source = capture_.source(sequence.keypoints, seen_.file_index[c], seen_.cameras[c].name);
          const KeypointCamera camera = keypoint_camera(seen_.cameras[c], seen_.file_index[c]);
          const auto name = guess_layout(source, camera);
          if (!name) continue;
          const PointLayout layout = read_keypoint_map(*name).layout;
          if (!names_its_points(source, camera)) compare_with_map(layout);
          return layout;
        } catch (const Error&) {  // the next camera may decide; below, the capture's map does
        }
    return layout_of_keypoints(capture_);
  }

  /// The number of the points and the limbs decided on the layout of the files, so the capture's map is wrong if it has
  /// another one. A map of the body alone is not: files may have face and hands besides.
  void compare_with_map(const PointLayout& of_files) {
    if (capture_.keypoint_map.empty()) return;
    const PointLayout stated = layout_of_keypoints(capture_);
    const std::vector<std::string> known = builtin_keypoint_maps();
    if (std::find(known.begin(), known.end(), stated.name) == known.end() || stated.name == of_files.name) return;
    const bool is_body_of_files =
        stated.points.size() < of_files.points.size() &&
        std::equal(stated.points.begin(), stated.points.end(), of_files.points.begin(),
                   [](const std::string& a, const std::string& b) { return landmark_key(a) == landmark_key(b); });
    if (is_body_of_files) return;
    findings_.push_back(
        {"", faults::kWrongKeypoints, Severity::fault,
         fmt::format("keypoint_map is {}, but the files are {}; correct the key", capture_.keypoint_map, of_files.name),
         fmt::format("Set `keypoint_map: {}` in capture.yaml. Here the keypoints were examined as {}.", of_files.name,
                     of_files.name)});
  }

  void read_sequence(int s) {
    const SequenceEntry& sequence = capture_.sequences[s];
    const std::vector<KeypointTrackReader> readers = open_keypoints(sequence);
    const long last = last_row(sequence, s, readers);
    std::vector<long> rows = rows_to_read(sequence.first_frame, last);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const bool cut = std::find(sequence.cuts.begin(), sequence.cuts.end(), rows[i]) != sequence.cuts.end();
      if (i == 0 || cut || rows[i] != rows[i - 1] + 1) ++segment_;
      seen_.instants.push_back({s, segment_, rows[i]});
    }
    for (std::size_t c = 0; c < seen_.cameras.size(); ++c) read_camera(s, sequence, c, rows, readers[c]);
  }

  using KeypointTrackReader = std::shared_ptr<KeypointSource>;

  std::vector<KeypointTrackReader> open_keypoints(const SequenceEntry& sequence) {
    std::vector<KeypointTrackReader> readers(seen_.cameras.size());
    for (std::size_t c = 0; c < readers.size(); ++c) {
      if (sequence.keypoints.empty() || !layout_) continue;
      const Camera& camera = seen_.cameras[c];
      try {
        const std::string source = capture_.source(sequence.keypoints, seen_.file_index[c], camera.name);
        readers[c] = std::make_shared<KeypointSource>(source, *layout_, keypoint_camera(camera, seen_.file_index[c]),
                                                      sequence.keypoint_offset_of(camera.name));
      } catch (const Error& error) {
        add_unreadable(camera, error, findings_);
      }
    }
    return readers;
  }

  /// The last row of most cameras; without videos, of the keypoint files of the first camera that has some.
  long last_row(const SequenceEntry& sequence, int s, const std::vector<KeypointTrackReader>& readers) const {
    if (sequence.last_frame) return *sequence.last_frame;
    const std::vector<long>& rows = rows_[s];
    if (!rows.empty()) return static_cast<long>(median(std::vector<double>(rows.begin(), rows.end()))) - 1;
    for (std::size_t c = 0; c < readers.size(); ++c)
      if (const auto range = readers[c] ? readers[c]->range() : std::nullopt)
        return capture_.clock(sequence, seen_.cameras[c].name).num_rows(range->second + 1) - 1;
    if (sequence.keypoints.empty() || !has_frame_placeholder(sequence.keypoints.sample()))
      return sequence.first_frame - 1;
    const std::string pattern = capture_.source(sequence.keypoints, seen_.file_index[0], seen_.cameras[0].name);
    const long offset = sequence.keypoint_offset_of(seen_.cameras[0].name);
    long row = sequence.first_frame;
    while (row < kMaxProbed && std::filesystem::exists(expand_pattern(pattern, 0, "", row + offset))) ++row;
    return row - 1;
  }

  std::vector<long> rows_to_read(long first, long last) const {
    std::vector<long> rows;
    const long share = std::max(kPiece, most_rows_ / static_cast<long>(capture_.sequences.size()));
    const long count = last - first + 1;
    const long pieces = count <= share ? 1 : std::max(1L, share / kPiece);
    for (long piece = 0; piece < pieces; ++piece) {
      const long begin = pieces == 1 ? first : first + (count - kPiece) * piece / std::max(1L, pieces - 1);
      const long end = count <= share ? last : std::min(last, begin + kPiece - 1);
      for (long row = begin; row <= end; ++row)
        if (rows.empty() || row > rows.back()) rows.push_back(row);
    }
    return rows;
  }

  void read_camera(int s, const SequenceEntry& sequence, std::size_t c, const std::vector<long>& rows,
                   const KeypointTrackReader& reader) {
    std::vector<std::vector<SeenPerson>>& all = seen_.people[c];
    const FrameClock clock = capture_.clock(sequence, seen_.cameras[c].name);
    if (!reader) {
      all.resize(all.size() + rows.size());
      return;
    }
    std::vector<People> frames;
    std::vector<bool> there;
    try {
      for (const long row : rows) {
        const auto people = reader->people(clock.frame(row));
        there.push_back(people.has_value());
        frames.push_back(people.value_or(People()));
      }
    } catch (const Error& error) {
      add_unreadable(seen_.cameras[c], error, findings_);
    }
    frames.resize(rows.size());
    if (are_of_other_frames(*reader, c, rows, clock)) return add_people(frames, c, all);
    // The first and last rows may lie outside of the recording.
    const auto first = std::find(there.begin(), there.end(), true);
    const auto last = std::find(there.rbegin(), there.rend(), true).base();
    const long missing = first == there.end() ? static_cast<long>(there.size()) : std::count(first, last, false);
    if (10 * missing > static_cast<long>(rows.size()))
      findings_.push_back({seen_.cameras[c].name, faults::kNoKeypoints,
                           2 * missing > static_cast<long>(rows.size()) ? Severity::fault : Severity::warning,
                           fmt::format("{} of {} keypoint files of sequence {} are missing", missing, rows.size(),
                                       capture_.sequences[s].name),
                           "Run the detector on all frames of this camera, or correct `keypoints` in capture.yaml."});
    add_people(frames, c, all);
  }

  /// A file that tells something, but of none of the frames.
  bool are_of_other_frames(const KeypointSource& reader, std::size_t c, const std::vector<long>& rows,
                           const FrameClock& clock) {
    const auto range = reader.range();
    if (!range || rows.empty()) return false;
    const long first = clock.frame(rows.front()), last = clock.frame(rows.back());
    if (range->first <= last && range->second >= first) return false;
    findings_.push_back(
        {seen_.cameras[c].name, faults::kNoKeypoints, Severity::fault,
         fmt::format("its keypoints are of frames {} to {}, and frames {} to {} were examined", range->first,
                     range->second, first, last),
         "The numbers in the keypoint files are not those of the frames. If the files count from another frame, state "
         "`keypoint_offset` in capture.yaml; else give them the numbers of the frames."});
    return true;
  }

  void add_people(const std::vector<People>& frames, std::size_t c, std::vector<std::vector<SeenPerson>>& all) const {
    std::vector<double> confidences;
    for (const People& people : frames)
      for (const Person& person : people)
        for (const std::size_t index : indices_)
          if (person[index].confidence > 0.0f) confidences.push_back(person[index].confidence);
    const double least = std::max(kMinConfidence, kSeenShare * median(confidences));
    const double reach = 3.0 * std::max(seen_.cameras[c].width, seen_.cameras[c].height);
    for (const People& people : frames) {
      all.emplace_back();
      for (const Person& person : people) {
        SeenPerson seen(indices_.size());
        int count = 0;
        for (std::size_t k = 0; k < indices_.size(); ++k) {
          const Keypoint& point = person[indices_[k]];
          const bool usable = point.confidence >= least && std::isfinite(point.x) && std::isfinite(point.y) &&
                              std::max(std::abs(point.x), std::abs(point.y)) < reach;
          seen[k] = {Vector2d(point.x, point.y), usable};
          count += usable;
        }
        if (count >= 3) all.back().push_back(std::move(seen));
      }
    }
  }

  const Capture& capture_;
  long most_rows_;
  std::vector<Finding>& findings_;
  bool footage_;
  Sightings seen_;
  std::vector<std::vector<long>> rows_;  ///< [sequences] rows that the videos have
  std::optional<PointLayout> layout_;
  std::vector<std::size_t> indices_;  ///< [K] in the layout
  int segment_ = -1;
};

}  // namespace

int Sightings::point(const std::string& key) const {
  const auto found = std::find(points.begin(), points.end(), key);
  return found == points.end() ? -1 : static_cast<int>(found - points.begin());
}

bool Sightings::has_people() const {
  return std::any_of(people.begin(), people.end(), [](const auto& camera) {
    return std::any_of(camera.begin(), camera.end(), [](const auto& instant) { return !instant.empty(); });
  });
}

void normalise_scale(Sightings& seen) {
  seen.scale = 1.0;
  if (seen.cameras.size() < 2) return;
  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> along;
    for (const Camera& camera : seen.cameras) along.push_back(camera.centre()[axis]);
    middle[axis] = median(along);
  }
  std::vector<double> distances;
  for (const Camera& camera : seen.cameras) distances.push_back((camera.centre() - middle).norm());
  std::sort(distances.begin(), distances.end());
  const double usual = median(distances);
  if (!(usual > 0.0) || !std::isfinite(usual)) return;
  seen.scale = kUsualDistance / usual;
  for (auto* cameras : {&seen.cameras, &seen.calibrated})
    for (Camera& camera : *cameras) camera.t *= seen.scale;
}

void complete_sightings(Sightings& seen) {
  seen.bones.clear();
  for (const auto& [a, b] : kBodyLimbs)
    if (seen.point(a) >= 0 && seen.point(b) >= 0) seen.bones.push_back({seen.point(a), seen.point(b)});
  seen.size.clear();
  for (const auto& camera : seen.people) {
    std::vector<double> sizes;
    for (const auto& people : camera) {
      double largest = 0.0;  // people in the background are smaller
      for (const SeenPerson& person : people) {
        Eigen::AlignedBox2d box;
        for (const SeenPoint& point : person)
          if (point.seen) box.extend(point.pixel);
        largest = std::max(largest, box.sizes().norm());
      }
      if (largest > 0.0) sizes.push_back(largest);
    }
    seen.size.push_back(sizes.empty() ? 1.0 : std::max(1.0, median(sizes)));
  }
  seen.windows.clear();
  const int length = std::clamp(seen.num_instants() / kWindows, kMinWindow, kMaxWindow);
  for (int i = 0; i < seen.num_instants(); ++i) {
    const bool same = i > 0 && seen.instants[i].segment == seen.instants[as_size(i) - 1].segment;
    if (!same || static_cast<int>(seen.windows.back().size()) >= length) seen.windows.emplace_back();
    seen.windows.back().push_back(i);
  }
}

Sightings read_sightings(const Capture& capture, long most_rows, std::vector<Finding>& findings, bool footage) {
  return SightingsReader(capture, most_rows, findings, footage).read();
}

}  // namespace doppel
