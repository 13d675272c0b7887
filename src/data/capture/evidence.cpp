#include "doppel/data/capture/evidence.h"

#include <algorithm>
#include <cmath>

#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/fractional_frames.h"
#include "doppel/detect/keypoints/guess_layout.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "doppel/detect/networks/network_config.h"

namespace doppel {

namespace {

constexpr char kDefaultMap[] = "body25", kNamesMap[] = "names";
constexpr float kMaxShare = 1.5f;  ///< pixels: all coordinates of a body in pixels exceed this

/// The built-in layout that has exactly these points, in any order. Nothing: the names are those of landmarks.
std::optional<std::string> layout_with_points(const std::vector<std::string>& points) {
  for (const PointLayout& known : builtin_layouts()) {
    const bool has_all = std::all_of(points.begin(), points.end(), [&](const auto& p) { return known.find(p); });
    if (has_all && known.points.size() == points.size()) return known.name;
  }
  return std::nullopt;
}

/// Calls `use(source, camera)` for the keypoints of each sequence and camera, until it returns true.
template <typename Use>
void until_found(const Capture& capture, const Use& use) {
  const CaptureCameras filmed = choose_cameras(capture);
  for (const SequenceEntry& sequence : capture.sequences)
    for (std::size_t c = 0; c < filmed.cameras.size() && !sequence.keypoints.empty(); ++c) {
      const Camera& camera = filmed.cameras[c];
      if (use(capture.source(sequence.keypoints, filmed.file_index[c], camera.name),
              keypoint_camera(camera, filmed.file_index[c])))
        return;
    }
}

bool shows_somebody(const Detections& detections) {
  const auto is_seen = [](const Keypoint& point) { return point.confidence > 0.0f; };
  for (const DetectedImage& image : detections.images)
    for (const DetectedPerson& person : image.people)
      if (std::any_of(person.body.begin(), person.body.end(), is_seen)) return true;
  return false;
}

/// The layout of the keypoint files, by those of the first camera that found somebody. Nothing for tables with other
/// names, and, with a warning, if the files do not decide it; reading them then checks the number of points.
std::optional<std::string> detected_layout(const Capture& capture) {
  std::optional<std::string> found;
  try {
    bool tables = false;
    until_found(capture, [&](const std::string& source, const KeypointCamera& camera) {
      if (!is_keypoint_table(source)) {
        found = guess_layout(source, camera);
        return found.has_value();
      }
      tables = true;
      const Detections table = read_detections(source, camera);
      found = layout_with_points(table.points);
      return found || shows_somebody(table);
    });
    if (!found && !tables && capture.has_keypoints())
      log::warn(
          "{}: no keypoint file tells the detector's points, as none of them holds a person. `keypoint_map` is not "
          "set, so its default is used",
          capture.name);
  } catch (const Error& e) {
    log::warn("{}. `keypoint_map` is not set, so its default is used", e.what());
  }
  return found;
}

std::string chosen_map(const Capture& capture) {
  if (!capture.keypoint_map.empty()) return capture.keypoint_map;
  if (capture.detector) return kDefaultMap;
  const bool tables =
      std::all_of(capture.sequences.begin(), capture.sequences.end(), [](const SequenceEntry& sequence) {
        const std::string extension = std::filesystem::path(sequence.keypoints.sample()).extension().string();
        return sequence.keypoints.empty() || extension == ".csv" || extension == ".tsv";
      });
  return detected_layout(capture).value_or(tables ? kNamesMap : kDefaultMap);
}

KeypointMap load_map(const Capture& capture, const std::string& name) {
  const std::vector<std::string> builtin = builtin_keypoint_maps();
  const bool is_builtin = std::find(builtin.begin(), builtin.end(), name) != builtin.end();
  return read_keypoint_map(is_builtin ? name : capture.resolve(name).string());
}

/// The points of the first table that shows somebody: that of a camera that saw nobody may have one of them only.
PointLayout layout_of_tables(const Capture& capture) {
  PointLayout layout{kNamesMap, {}};
  until_found(capture, [&](const std::string& source, const KeypointCamera& camera) {
    const Detections table = read_detections(source, camera);
    const bool somebody = shows_somebody(table);
    if (somebody || layout.points.empty()) layout.points = table.points;
    return somebody;
  });
  if (layout.points.empty()) fail("{} names no `keypoints`, and no points are known without them", capture.name);
  return layout;
}

/// Some detectors can write fractions of the image size, 0 to 1.
void check_pixels(const std::vector<std::vector<Keypoint>>& frames) {
  float largest = 0.0f;
  for (const auto& landmarks : frames)
    for (const Keypoint& point : landmarks) largest = std::max({largest, std::abs(point.x), std::abs(point.y)});
  if (largest > 0.0f && largest <= kMaxShare)
    fail(
        "no keypoint lies more than {} from the image's corner: these are parts of the image's size, pixels are "
        "needed (OpenPose: without --keypoint_scale)",
        largest);
}

void count_frame(const std::optional<People>& people, const std::vector<Keypoint>& landmarks, KeypointFacts& facts) {
  ++facts.frames;
  facts.missing_files += !people.has_value();
  facts.nobody += !people || people->empty();
  facts.several += people && people->size() > 1;
  const auto seen = std::count_if(landmarks.begin(), landmarks.end(),
                                  [](const Keypoint& point) { return point.confidence >= kSeenConfidence; });
  facts.unsure += people && !people->empty() && seen == 0;
  facts.seen += landmarks.empty() ? 0.0 : static_cast<double>(seen) / static_cast<double>(landmarks.size());
}

/// Without the others. @param index of the person; -1: none of them
People only(People people, int index) {
  if (index < 0 || as_size(index) >= people.size()) return {};
  return {std::move(people[index])};
}

/// The person in the frames around the present row. Each frame is read once; the rows ascend.
class RecentFrames {
 public:
  struct Frame {
    std::optional<People> people;
    std::vector<Keypoint> landmarks;
  };
  RecentFrames(const PeopleOfFrame& people, const ChoiceOfFrame& chosen, const LandmarkPicker& picker,
               const Undistorter& undistorter)
      : people_(people), chosen_(chosen), picker_(picker), undistorter_(undistorter) {}

  /// The landmarks at a time, in frames.
  std::vector<Keypoint> at(double time, const std::function<cv::Mat()>& mask) {
    const double before = std::floor(time);
    const auto first = static_cast<long>(before);
    frames_.erase(frames_.begin(), frames_.lower_bound(first));
    const std::vector<Keypoint> landmarks = frame(first, mask).landmarks;
    return time == before ? landmarks : keypoints_between(landmarks, frame(first + 1, mask).landmarks, time - before);
  }
  const Frame& frame(long number, const std::function<cv::Mat()>& mask) {
    const auto [found, is_new] = frames_.try_emplace(number);
    if (!is_new) return found->second;
    found->second.people = people_(number);
    std::optional<People> people = found->second.people;
    if (people && chosen_) people = only(std::move(*people), chosen_(number));
    found->second.landmarks = pick_person(std::move(people), mask, picker_, undistorter_);
    return found->second;
  }

 private:
  const PeopleOfFrame& people_;
  const ChoiceOfFrame& chosen_;
  const LandmarkPicker& picker_;
  const Undistorter& undistorter_;
  std::map<long, Frame> frames_;
};

}  // namespace

PointLayout layout_of_keypoints(const Capture& capture) {
  const std::string name = chosen_map(capture);
  return name == kNamesMap ? layout_of_tables(capture) : load_map(capture, name).layout;
}

EvidencePlan plan_evidence(const Capture& capture, const Character& character) {
  EvidencePlan plan;
  if (!capture.has_keypoints()) return plan;
  const std::string name = chosen_map(capture);
  const bool by_name = name == kNamesMap;
  plan.map_name = name;
  if (by_name && capture.detector)
    fail("{} has a detector, whose points have an order but no names: `keypoint_map` must be a map, not '{}'",
         capture.name, kNamesMap);
  if (!by_name) plan.map = load_map(capture, name);
  if (!capture.landmarks.empty())
    plan.landmarks = read_landmarks(capture.resolve(capture.landmarks), character);
  else
    plan.landmarks = by_name ? character.skeleton.markers : known_markers(character.skeleton, plan.map);
  if (by_name) plan.map = map_of_names(plan.landmarks);
  if (!plan.landmarks.empty()) {
    const LandmarkPicker check(plan.map, plan.landmarks);  // throws for landmarks that the map does not contain
    return plan;
  }
  const std::string sentence = fmt::format(
      "{} has keypoints, but the keypoint map '{}' knows none of the skeleton's {} markers; name a placement file of "
      "landmarks with `landmarks`, or another `keypoint_map`",
      capture.name, name, character.skeleton.markers.size());
  if (!capture.keypoint_map.empty()) fail("{}", sentence);
  log::warn("{}. The keypoints are ignored", sentence);
  return plan;
}

People undistorted(const Undistorter& undistorter, People people) {
  for (Person& person : people)
    for (Keypoint& point : person) {
      if (point.confidence <= 0.0f) continue;
      const Eigen::Vector2d pixel = undistorter.apply(Eigen::Vector2d(point.x, point.y));
      point.x = static_cast<float>(pixel.x());
      point.y = static_cast<float>(pixel.y());
    }
  return people;
}

std::vector<Keypoint> pick_person(std::optional<People> people, const std::function<cv::Mat()>& mask,
                                  const LandmarkPicker& picker, const Undistorter& undistorter) {
  if (!people) return picker.pick(std::optional<Person>());
  people = undistorted(undistorter, std::move(*people));
  return picker.pick(choose_person(*people, people->size() > 1 ? mask() : cv::Mat()));
}

PoseDetector open_detector(const Capture& capture, const PointLayout& layout) {
  PersonNetworkOptions options = *capture.detector;
  for_each_network(options, [&](NetworkOptions& network) {
    network.model = capture.resolve(network.model.string());
    if (!network.weights.empty()) network.weights = capture.resolve(network.weights.string());
  });
  return PoseDetector(options, layout);
}

KeypointTrack follow_person(const PeopleOfFrame& people, const MaskOfRow& mask, const LandmarkPicker& picker,
                            const Camera& camera, const FilmedRows& rows, const KeypointFilter& filter,
                            const ChoiceOfFrame& chosen) {
  const Undistorter undistorter(camera);
  RecentFrames recent(people, chosen, picker, undistorter);
  KeypointTrack track;
  for (long row = rows.first; row <= rows.last; ++row) {
    const auto mask_of_row = [&] { return mask(row); };
    track.frames.push_back(recent.at(rows.clock.time(row), mask_of_row));
    count_frame(recent.frame(rows.clock.frame(row), mask_of_row).people, track.frames.back(), track.facts);
  }
  if (track.facts.frames > 0) track.facts.seen /= static_cast<double>(track.facts.frames);
  check_pixels(track.frames);
  std::vector<long> segments;
  segments.reserve(rows.cuts.size());
  for (const long cut : rows.cuts) segments.push_back(cut - rows.first);
  filter_keypoints(track.frames, segments, filter, std::max(camera.width, camera.height));
  return track;
}

std::vector<std::string> keypoint_doubts(const KeypointFacts& facts) {
  std::vector<std::string> doubts;
  if (facts.missing_files == facts.frames)
    doubts.emplace_back("none of the keypoint files exists; check the path and its number of digits");
  else if (facts.missing_files > 0)
    doubts.push_back(fmt::format("{} of {} keypoint files are missing; their frames have no keypoints",
                                 facts.missing_files, facts.frames));
  if (facts.unsure > 0 && facts.unsure == facts.frames - facts.nobody)
    doubts.push_back(
        fmt::format("all keypoints have a confidence below {}; they have little influence", kSeenConfidence));
  if (facts.missing_files < facts.frames && facts.nobody == facts.frames)
    doubts.emplace_back("nobody was found in any frame");
  return doubts;
}

}  // namespace doppel
