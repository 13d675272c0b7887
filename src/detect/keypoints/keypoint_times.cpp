#include "doppel/detect/keypoints/keypoint_times.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace doppel {

namespace {

constexpr double kLargestTime = 1e15;  ///< up to which doubles hold every frame number

/// A point with its frame.
struct TimedKeypoint {
  double frame;
  Keypoint point;
};

std::optional<TimedKeypoint> seen_in(const std::map<long, Person>& track, std::initializer_list<long> frames,
                                     std::size_t place) {
  for (const long frame : frames) {
    const auto found = track.find(frame);
    if (found == track.end() || place >= found->second.size()) continue;
    const Keypoint& point = found->second[place];
    if (point.confidence > 0.0f) return TimedKeypoint{static_cast<double>(frame), point};
  }
  return std::nullopt;
}

Keypoint between(const TimedKeypoint& a, const TimedKeypoint& b, double time) {
  const auto share = static_cast<float>((time - a.frame) / (b.frame - a.frame));
  return {a.point.x + share * (b.point.x - a.point.x), a.point.y + share * (b.point.y - a.point.y),
          std::min(a.point.confidence, b.point.confidence)};
}

}  // namespace

Person person_at(const std::map<long, Person>& track, double time) {
  if (!(std::abs(time) < kLargestTime)) return {};
  const long before = static_cast<long>(std::floor(time)), after = before + 1;
  const auto here = track.find(before);
  if (static_cast<double>(before) == time) return here == track.end() ? Person() : here->second;
  std::size_t count = 0;
  for (const long frame : {before - 1, before, after, after + 1})
    if (const auto found = track.find(frame); found != track.end()) count = std::max(count, found->second.size());
  Person person(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto a = seen_in(track, {before, before - 1}, i), b = seen_in(track, {after, after + 1}, i);
    if (a && b) person[i] = between(*a, *b, time);
  }
  return person;
}

std::vector<Person> interpolate_people(const std::map<long, Person>& track, const std::vector<double>& times) {
  std::vector<Person> people;
  people.reserve(times.size());
  for (const double time : times) people.push_back(person_at(track, time));
  return people;
}

}  // namespace doppel
