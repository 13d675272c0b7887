#include "doppel/data/keypoints.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxBytes = 64u << 20;

std::vector<Keypoint> read_person(const json& person, int num_points, const FileLocation& where) {
  const auto found = person.is_object() ? person.find("pose_keypoints_2d") : person.end();
  if (!person.is_object() || found == person.end() || !found->is_array())
    fail_at(where, "a person has no list `pose_keypoints_2d`");
  if (found->size() % 3 != 0 || (num_points > 0 && found->size() != 3u * num_points))
    fail_at(where, "a person has {} numbers; x, y and confidence of {} points are expected", found->size(),
            num_points > 0 ? std::to_string(num_points) : "all");
  std::vector<Keypoint> points(found->size() / 3);
  for (std::size_t i = 0; i < found->size(); ++i) {
    const json& value = (*found)[i];
    if (!value.is_number() || !std::isfinite(value.get<float>()))
      fail_at(where, "number {} of a person's keypoints is '{}', not a number", i, value.dump());
    Keypoint& point = points[i / 3];
    (i % 3 == 0 ? point.x : i % 3 == 1 ? point.y : point.confidence) = value.get<float>();
  }
  return points;
}

double total_confidence(const std::vector<Keypoint>& points) {
  double sum = 0.0;
  for (const Keypoint& point : points) sum += point.confidence;
  return sum;
}

}  // namespace

std::vector<Keypoint> read_openpose(const std::filesystem::path& path, int num_points) {
  const FileLocation where{path.string(), 0};
  const json document = json::parse(read_file(path, kMaxBytes), nullptr, false);
  if (document.is_discarded()) fail_at(where, "is no JSON; it may be truncated");
  const auto people = document.is_object() ? document.find("people") : document.end();
  if (!document.is_object() || people == document.end() || !people->is_array())
    fail_at(where, "is no OpenPose keypoint file: there is no list `people`");
  std::vector<Keypoint> best(std::max(num_points, 0));
  double best_confidence = -1.0;
  for (const json& person : *people) {
    std::vector<Keypoint> points = read_person(person, num_points, where);
    const double confidence = total_confidence(points);
    if (confidence <= best_confidence) continue;
    best = std::move(points);
    best_confidence = confidence;
  }
  return best;
}

}  // namespace doppel
