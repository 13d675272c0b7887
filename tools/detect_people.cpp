#include "detect_people.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "detect_camera.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/detect/keypoints/person_anchors.h"

namespace doppel::tools {

namespace {

using Json = nlohmann::ordered_json;

constexpr long kRowsApart = 15, kMinMoments = 8;
constexpr double kSamePerson = 0.05;  ///< of a region's side, mean distance of the landmarks

std::string names_of(std::span<const DetectSource> sources) {
  std::vector<std::string> names;
  for (const DetectSource& source : sources)
    if (std::find(names.begin(), names.end(), source.camera) == names.end()) names.push_back(source.camera);
  return fmt::format("{}", fmt::join(names, ", "));
}

bool has_camera(std::span<const DetectSource> sources, const std::string& name) {
  return std::any_of(sources.begin(), sources.end(), [&](const auto& source) { return source.camera == name; });
}

std::vector<double> finite_numbers(std::span<const std::string> words) {
  std::vector<double> numbers;
  for (const std::string& word : words)
    if (const auto number = parse_number(word); number && std::isfinite(*number)) numbers.push_back(*number);
  return numbers;
}

/// The same person may be found by two boxes.
bool is_same(const BodyPose& a, const BodyPose& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.landmarks.size(); ++i)
    sum += std::hypot(a.landmarks[i].x - b.landmarks[i].x, a.landmarks[i].y - b.landmarks[i].y);
  return sum < kSamePerson * a.roi.side * static_cast<double>(a.landmarks.size());
}

People people_in(const cv::Mat& image, BodyDetector& detector) {
  std::vector<BodyPose> poses;
  for (BodyPose& pose : detector.detect_all(image)) {
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const auto& other) { return is_same(pose, other); });
    if (!known) poses.push_back(std::move(pose));
  }
  People people;
  for (const BodyPose& pose : poses) people.push_back(person_of_pose(pose));
  return people;
}

SeenPeople seen_together(const PeopleSearch& search, std::span<const DetectSource> sources,
                         const std::vector<CameraPeople>& seen) {
  SeenPeople together;
  together.layout = mediapipe_layout(PersonPoints::body);
  together.step = search.step;
  together.people.resize(search.rows.size());
  for (std::size_t c = 0; c < seen.size(); ++c) {
    const DetectSource& source = sources[search.sources[c]];
    together.cameras.push_back(fit_to_images(*source.calibration, seen[c].image, source.images));
    for (std::size_t f = 0; f < search.rows.size(); ++f) together.people[f].push_back(seen[c].people[f]);
  }
  return together;
}

std::optional<PersonAtPixel> pixel_of(const PersonWish& wish, const std::vector<Camera>& cameras) {
  for (std::size_t c = 0; c < cameras.size() && wish.pixel; ++c)
    if (cameras[c].name == wish.camera) return PersonAtPixel{c, *wish.pixel};
  return std::nullopt;
}

PersonGuide guide_of(const std::vector<std::optional<PersonAnchor>>& anchors, const PeopleSearch& search,
                     const FrameClock& clock) {
  std::map<long, PersonAnchor> by_frame;
  for (std::size_t f = 0; f < anchors.size(); ++f)
    if (anchors[f]) by_frame.emplace(clock.frame(search.rows[f]), *anchors[f]);
  return PersonGuide(std::move(by_frame), static_cast<double>(search.step) * clock.rate);
}

std::string title_of(const PeopleSearch& search) {
  return search.sequence.empty() ? "" : fmt::format("sequence {}: ", search.sequence);
}

void tell_people(const AnchoredPerson& found, const PeopleSearch& search) {
  std::string list;
  for (std::size_t i = 0; i < found.people.size(); ++i) {
    const FoundPerson& person = found.people[i];
    list +=
        fmt::format("{}person {} near ({:.2f}, {:.2f}, {:.2f}) m, in {:.0f} % of the moments, seen by {:.1f} cameras",
                    i ? "; " : "", i, person.position.x(), person.position.y(), person.position.z(),
                    100.0 * person.frames, person.views);
  }
  const std::string text = fmt::format(
      "{}{} people: {}. Person {} is followed. To choose another one: `--person CAMERA X Y`, a pixel near the hips; "
      "`--person X Y Z`, a position in the world in metres; or `person: {{near: [x, y, z]}}` in capture.yaml",
      title_of(search), found.people.size(), list, found.person);
  if (found.ambiguous)
    log::warn("{}", text);
  else
    log::info("{}", text);
}

void tell_doubts(const AnchoredPerson& found, const PeopleSearch& search, const std::vector<Camera>& cameras) {
  for (const std::size_t c : found.doubtful)
    log::warn(
        "{}camera {} sees people, but hardly ever the person on whom the others agree, so it follows whom it sees most "
        "clearly; check its calibration and its frame offset with `doppel doctor`",
        title_of(search), cameras[c].name);
}

Json report_of(const AnchoredPerson& found, const PeopleSearch& search) {
  Json people = Json::array();
  for (const FoundPerson& person : found.people)
    people.push_back({{"position", {person.position.x(), person.position.y(), person.position.z()}},
                      {"frames", person.frames},
                      {"views", person.views}});
  return {{"sequence", search.sequence}, {"person", found.person}, {"people", people}};
}

}  // namespace

PersonWish read_person_wish(const std::vector<std::string>& words, std::span<const DetectSource> sources,
                            const std::string& input) {
  if (words.empty()) return {};
  const bool several = std::any_of(sources.begin(), sources.end(),
                                   [&](const DetectSource& source) { return source.camera != sources[0].camera; });
  const std::vector<double> numbers = finite_numbers(words);
  if (words.size() == 3 && has_camera(sources, words[0])) {
    const std::vector<double> pixel = finite_numbers(std::span(words).last(2));
    if (pixel.size() == 2) return {words[0], Eigen::Vector2d(pixel[0], pixel[1]), {}};
  } else if (words.size() == 3 && numbers.size() == 3 && several) {
    return {"", {}, Eigen::Vector3d(numbers[0], numbers[1], numbers[2])};
  } else if (words.size() == 2 && numbers.size() == 2 && !several) {
    return {sources[0].camera, Eigen::Vector2d(numbers[0], numbers[1]), {}};
  }
  if (!several)
    fail<UsageError>("--person {}: {} is one camera; allowed are two numbers X Y, a pixel near the person's hips",
                     fmt::join(words, " "), input);
  fail<UsageError>(
      "--person {}: {} has several cameras; allowed are CAMERA X Y, a pixel near the person's hips in one of the "
      "cameras "
      "{}, or three numbers X Y Z, a position in the world in metres",
      fmt::join(words, " "), input, names_of(sources));
}

std::vector<PeopleSearch> plan_searches(std::span<const DetectSource> sources) {
  std::map<std::string, std::vector<std::size_t>> sequences;
  for (std::size_t i = 0; i < sources.size(); ++i)
    if (sources[i].calibration) sequences[sources[i].sequence].push_back(i);
  std::vector<PeopleSearch> searches;
  for (const auto& [name, cameras] : sequences) {
    auto [first, last] = filmed_rows(sources[cameras[0]]);
    for (const std::size_t i : cameras) {
      const auto [begin, end] = filmed_rows(sources[i]);
      first = std::max(first, begin);
      last = std::min(last, end);
    }
    if (cameras.size() < 2 || last < first) continue;
    PeopleSearch search{name, cameras, {}, std::clamp((last - first + 1) / kMinMoments, 1L, kRowsApart)};
    for (long row = first; row <= last; row += search.step) search.rows.push_back(row);
    searches.push_back(std::move(search));
  }
  return searches;
}

std::optional<CameraPeople> look_at_people(const DetectSource& source, const std::vector<long>& rows,
                                           BodyDetector& detector, const std::function<bool()>& advance) {
  const auto images = open_frames(source.images, PixelFormat::colour);
  CameraPeople seen;
  long shown = -1;
  for (const long row : rows) {
    const long frame = source.clock.frame(row);
    if (frame == shown) {  // a camera with fewer frames than rows
      seen.people.push_back(seen.people.back());
    } else {
      const cv::Mat image = images->read(frame);
      seen.image = image.size();
      seen.people.push_back(people_in(image, detector));
    }
    shown = frame;
    if (!advance()) return std::nullopt;
  }
  return seen;
}

FollowedPerson choose_followed(const PeopleSearch& search, std::span<const DetectSource> sources,
                               const std::vector<CameraPeople>& seen, const PersonWish& wish) {
  FollowedPerson followed;
  followed.guides.resize(search.sources.size());
  SeenPeople together;
  try {
    together = seen_together(search, sources, seen);
  } catch (const Error& error) {  // doctor says more about a calibration of other images
    if (wish.names_person()) throw;
    log::warn("{}who is who is not compared between the cameras: {}", title_of(search), error.what());
    return followed;
  }
  PersonChoiceOptions options = sources[search.sources[0]].person;
  if (wish.near) {
    options = {};
    options.near = wish.near;
  }
  const AnchoredPerson found = anchor_person(together, options, pixel_of(wish, together.cameras));
  if (found.person < 0 && wish.near)
    fail<UsageError>(
        "--person: no two cameras agree on anybody; name the person in one of the cameras, or look for a "
        "fault of the calibration with `doppel doctor`");
  if (found.people.size() > 1) {
    tell_people(found, search);
    followed.report = report_of(found, search);
  }
  if (found.alone) return followed;
  tell_doubts(found, search, together.cameras);
  for (std::size_t c = 0; c < found.anchors.size(); ++c)
    followed.guides[c] = guide_of(found.anchors[c], search, sources[search.sources[c]].clock);
  return followed;
}

}  // namespace doppel::tools
