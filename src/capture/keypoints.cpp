#include "doppel/capture/keypoints.h"

#include <algorithm>
#include <cctype>
#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "doppel/capture/path_pattern.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxBytes = std::uintmax_t{1} << 30;
constexpr int kMaxJsonDepth = 4;  ///< of nested lists; no known tool nests deeper
constexpr double kReachPerSide = 0.03;
constexpr char kTableHeader[] = "frame,camera,name,x,y,confidence";

/// The context for reading one file.
struct Context {
  FileLocation where;
  const PointLayout& layout;
};

float number_of(const json& value, const Context& context) {
  if (!value.is_number() || !std::isfinite(value.get<float>()))
    fail_at(context.where, "found '{}' where a number of a person's keypoints is expected",
            value.dump(-1, ' ', false, json::error_handler_t::replace).substr(0, 40));
  return value.get<float>();
}

Keypoint make_point(float x, float y, float confidence) {
  if (!(confidence > 0.0f)) return {};
  return {x, y, std::min(confidence, 1.0f)};
}

[[noreturn]] void fail_count(std::size_t found, const Context& context) {
  fail_at(
      context.where,
      "a person has {} points, but the keypoint map is for the {} of '{}' (body25 has 25, coco18 has 18, coco17 has "
      "17); name the detector's own with keypoint_map",
      found, context.layout.points.size(), context.layout.name);
}

/// In place of a confidence, COCO's annotations have 0 (not labelled), 1 (hidden) or 2 (visible).
void halve_visibilities(std::vector<std::array<float, 3>>& rows) {
  bool visible = false;
  for (const auto& row : rows) {
    if (row[2] != 0.0f && row[2] != 1.0f && row[2] != 2.0f) return;
    visible |= row[2] == 2.0f;
  }
  for (auto& row : rows) row[2] *= visible ? 0.5f : 1.0f;
}

Person person_of(std::vector<std::array<float, 3>> rows, const Context& context) {
  if (rows.size() != context.layout.points.size()) fail_count(rows.size(), context);
  halve_visibilities(rows);
  Person person;
  for (const auto& [x, y, confidence] : rows) person.push_back(make_point(x, y, confidence));
  return person;
}

/// [x, y, confidence, x, y, confidence, ...]
Person read_flat(const json& list, const Context& context) {
  if (list.size() % 3 != 0)
    fail_at(context.where, "a person has {} numbers; x, y and confidence of each point are expected", list.size());
  std::vector<std::array<float, 3>> rows(list.size() / 3);
  for (std::size_t i = 0; i < list.size(); ++i) rows[i / 3][i % 3] = number_of(list[i], context);
  return person_of(std::move(rows), context);
}

/// [[x, y], ...] with the confidences in a list beside it, or [[x, y, confidence], ...].
Person read_nested(const json& list, const json* scores, const Context& context) {
  if (scores && (!scores->is_array() || scores->size() != list.size()))
    fail_at(context.where, "a person has {} points, but `keypoint_scores` is not a list of that length", list.size());
  std::vector<std::array<float, 3>> rows;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!list[i].is_array() || list[i].size() < 2 || (list[i].size() < 3 && !scores))
      fail_at(context.where, "point {} of a person is not of the form [x, y] with a confidence in `keypoint_scores`",
              i);
    rows.push_back({number_of(list[i][0], context), number_of(list[i][1], context),
                    number_of(scores ? (*scores)[i] : list[i][2], context)});
  }
  return person_of(std::move(rows), context);
}

const json* find(const json& object, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (const auto found = object.find(key); found != object.end()) return &*found;
  return nullptr;
}

const json* points_of(const json& object) { return find(object, {"pose_keypoints_2d", "keypoints"}); }
const json* list_of(const json& object) {
  return find(object, {"people", "instances", "predictions", "instance_info", "annotations"});
}

Person read_person(const json& object, const Context& context) {
  const json& points = *points_of(object);
  if (!points.is_array()) fail_at(context.where, "the keypoints of a person are not a list");
  if (!points.empty() && points[0].is_array())
    return read_nested(points, find(object, {"keypoint_scores", "keypoints_scores"}), context);
  return read_flat(points, context);
}

/// All people below a node, in the order of the file.
void collect_people(const json& node, const Context& context, People& people, int depth = 0) {
  if (depth > kMaxJsonDepth) fail_at(context.where, "lists are nested deeper than any known keypoint file's");
  if (node.is_array()) {
    for (const json& item : node) collect_people(item, context, people, depth + 1);
  } else if (node.is_object() && points_of(node)) {
    people.push_back(read_person(node, context));
  } else if (node.is_object() && list_of(node)) {
    collect_people(*list_of(node), context, people, depth + 1);
  } else {
    fail_at(context.where,
            "is not a keypoint file: a person must have `pose_keypoints_2d` (OpenPose) or `keypoints` (COCO, MMPose), "
            "and be in a list `people`, `instances`, `predictions` or `annotations`");
  }
}

json parse_json(const fs::path& path, const FileLocation& where) {
  json document = json::parse(read_file(path, kMaxBytes), nullptr, false);
  if (document.is_discarded()) fail_at(where, "is not JSON; it may be truncated");
  return document;
}

/// The number at the end of a file name.
std::optional<long> trailing_number(const std::string& name) {
  const std::string stem = fs::path(name).stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !std::isdigit(static_cast<unsigned char>(stem[end - 1]))) --end;
  std::size_t begin = end;
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1]))) --begin;
  if (begin == end || end - begin > 15) return std::nullopt;
  return std::stol(stem.substr(begin, end - begin));
}

std::optional<long> frame_number(const json& value) {
  if (value.is_string()) return trailing_number(value.get<std::string>());
  if (!value.is_number_integer()) return std::nullopt;
  const auto number = value.get<std::int64_t>();
  return number >= 0 && number <= INT_MAX ? std::optional<long>(number) : std::nullopt;
}

/// The frame number of an `image_id`: the number in the image's file name if the file lists its images, otherwise the
/// id itself.
std::map<long, long> frames_of_images(const json& document) {
  std::map<long, long> frames;
  const json* images = document.is_object() ? find(document, {"images"}) : nullptr;
  if (!images || !images->is_array()) return frames;
  for (const json& image : *images) {
    if (!image.is_object() || !image.contains("id") || !image.contains("file_name")) continue;
    const auto id = frame_number(image["id"]), frame = frame_number(image["file_name"]);
    if (id && frame) frames[*id] = *frame;
  }
  return frames;
}

long frame_of(const json& entry, const std::map<long, long>& images, const Context& context) {
  const json* value = entry.is_object() ? find(entry, {"frame_id", "frame_index", "image_id"}) : nullptr;
  const std::optional<long> frame = value ? frame_number(*value) : std::nullopt;
  if (!frame)
    fail_at(context.where,
            "an entry has no frame number (`frame_id`, or `image_id` as a number or a file name that ends in one); a "
            "file of one frame needs {{frame}} in its path");
  const auto image = images.find(*frame);
  return image == images.end() ? *frame : image->second;
}

int place_of(const TextReader& reader, const PointLayout& layout, const std::string& name) {
  const auto found = std::find(layout.points.begin(), layout.points.end(), name);
  if (found != layout.points.end()) return static_cast<int>(found - layout.points.begin());
  reader.fail_here("there is no point '{}'; '{}' has {}", name.substr(0, 60), layout.name,
                   fmt::join(layout.points, ", "));
}

double total_confidence(const Person& person) {
  double sum = 0.0;
  for (const Keypoint& point : person) sum += point.confidence;
  return sum;
}

/// The sum of confidences over points on or near the mask.
double confidence_inside(const Person& person, const cv::Mat& distance, double reach) {
  double sum = 0.0;
  for (const Keypoint& point : person) {
    const int x = static_cast<int>(std::floor(point.x)), y = static_cast<int>(std::floor(point.y));
    if (x < 0 || y < 0 || x >= distance.cols || y >= distance.rows) continue;
    if (distance.at<float>(y, x) <= reach) sum += point.confidence;
  }
  return sum;
}

}  // namespace

People read_people(const fs::path& path, const PointLayout& layout) {
  const Context context{{path.string(), 0}, layout};
  People people;
  collect_people(parse_json(path, context.where), context, people);
  return people;
}

std::map<long, People> read_all_people(const fs::path& path, const PointLayout& layout) {
  const Context context{{path.string(), 0}, layout};
  const json document = parse_json(path, context.where);
  const json* entries = document.is_object() ? list_of(document) : &document;
  if (!entries || !entries->is_array())
    fail_at(context.where,
            "is not a keypoint file of all frames: there is no list of entries, `instance_info` or "
            "`annotations`");
  const std::map<long, long> images = frames_of_images(document);
  std::map<long, People> all;
  for (const json& entry : *entries) collect_people(entry, context, all[frame_of(entry, images, context)]);
  const bool from_one = document.is_object() && document.contains("instance_info") && all.count(0) == 0;
  if (!from_one) return all;
  std::map<long, People> shifted;
  for (auto& [frame, people] : all) shifted.emplace(frame - 1, std::move(people));
  return shifted;
}

std::map<long, People> read_keypoint_table(const fs::path& path, const PointLayout& layout, const std::string& camera) {
  TextReader reader(path, "a table of keypoints", Separator::comma);
  reader.require_header(kTableHeader);
  std::map<long, People> all;
  std::set<std::pair<long, int>> given;
  std::set<std::string> others;
  while (reader.next_row(6)) {
    const long frame = reader.integer(0, "the frame", 0, INT_MAX);
    const double x = reader.number(3, "x"), y = reader.number(4, "y"), confidence = reader.number(5, "the confidence");
    if (confidence < 0.0 || confidence > 1.0) reader.fail_here("the confidence is {}, allowed is 0 to 1", confidence);
    if (std::abs(x) > 1e7 || std::abs(y) > 1e7) reader.fail_here("({}, {}) lies in no image", x, y);
    const int place = place_of(reader, layout, std::string(reader.tokens()[2]));
    if (reader.tokens()[1] != camera) {
      if (others.size() < 20) others.emplace(reader.tokens()[1].substr(0, 60));
      continue;
    }
    if (!given.emplace(frame, place).second)
      reader.fail_here("the point '{}' of frame {} is given twice", reader.tokens()[2], frame);
    People& people = all[frame];
    if (people.empty()) people.emplace_back(layout.points.size());
    people[0][place] = make_point(static_cast<float>(x), static_cast<float>(y), static_cast<float>(confidence));
  }
  if (all.empty())
    reader.fail_here("the table has no row of camera '{}'; it has rows of: {}", camera, fmt::join(others, ", "));
  return all;
}

void write_keypoint_table(const fs::path& path, const PointLayout& layout, const std::string& camera,
                          const std::map<long, People>& frames) {
  const std::string header = std::string(kTableHeader) + "\n";
  std::string text = header;
  for (const auto& [frame, people] : frames) {
    for (std::size_t i = 0; !people.empty() && i < layout.points.size(); ++i) {
      const Keypoint& point = people[0].at(i);
      if (point.confidence > 0.0f)
        text += fmt::format("{},{},{},{:.3f},{:.3f},{:.4f}\n", frame, camera, layout.points[i], point.x, point.y,
                            point.confidence);
    }
  }
  if (text == header && !frames.empty())
    text += fmt::format("{},{},{},0,0,0\n", frames.begin()->first, camera, layout.points.at(0));
  write_atomically(path, text);
}

std::optional<Person> choose_person(const People& people, const cv::Mat& mask) {
  if (people.empty()) return std::nullopt;
  if (people.size() == 1) return people[0];
  std::vector<double> scores(people.size(), 0.0);
  const cv::Rect box = mask.empty() ? cv::Rect() : cv::boundingRect(mask);
  if (box.area() > 0) {
    cv::Mat distance;
    cv::distanceTransform(~mask, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    const double reach = kReachPerSide * std::max(box.width, box.height);
    for (std::size_t i = 0; i < people.size(); ++i) scores[i] = confidence_inside(people[i], distance, reach);
  }
  if (*std::max_element(scores.begin(), scores.end()) == 0.0)
    for (std::size_t i = 0; i < people.size(); ++i) scores[i] = total_confidence(people[i]);
  return people[as_size(std::max_element(scores.begin(), scores.end()) - scores.begin())];
}

KeypointSource::KeypointSource(std::string path, const PointLayout& layout, const std::string& camera)
    : path_(std::move(path)), layout_(layout) {
  if (has_frame_placeholder(path_)) return;
  all_ = fs::path(path_).extension() == ".csv" ? read_keypoint_table(path_, layout, camera)
                                               : read_all_people(path_, layout);
}

std::optional<People> KeypointSource::people(long frame) const {
  if (all_) {
    const auto found = all_->find(frame);
    return found == all_->end() ? People() : found->second;
  }
  const fs::path file = expand_pattern(path_, 0, "", frame);
  return fs::is_regular_file(file) ? std::optional(read_people(file, layout_)) : std::nullopt;
}

}  // namespace doppel
