#include "doppel/detect/keypoints/person_choice.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/landmark_key.h"
#include "doppel/detect/keypoints/person_groups.h"

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr double kStep = 0.3, kStepPerFrame = 0.15, kMaxStep = 1.5;  ///< metres that a body may move
constexpr long kGoesStraight = 15;                                   ///< frames that a body is expected to do so
constexpr double kEquallyGood = 0.75;                                ///< of the support of the best person
constexpr double kWorthNaming = 0.1;
constexpr double kGoesOn = 0.6;     ///< of the mean support per frame, to count as the same person later
constexpr double kTolerance = 2.0;  ///< of the largest residual, once the body is known
constexpr double kCameraNeverAgrees = 0.02;

/// One person over time: the groups by frame.
struct GroupTrack {
  std::map<long, PersonGroup> groups;
  double support = 0.0;

  void add(long frame, PersonGroup group) {
    support += 0.5 * group.support * (group.views - 1);
    groups.emplace(frame, std::move(group));
  }
  double support_per_frame() const { return support / static_cast<double>(std::max<std::size_t>(1, groups.size())); }
  Vector3d position() const {
    Vector3d sum = Vector3d::Zero();
    for (const auto& [frame, group] : groups) sum += group.middle;
    return sum / static_cast<double>(std::max<std::size_t>(1, groups.size()));
  }
  /// Where the middle of the body is expected in a later frame. The velocity is that of the last `kGoesStraight` frames
  /// or somewhat more: from one frame to the next, the noise of the detections would outweigh it.
  Vector3d expected(long frame, long step) const {
    const auto& [last, now] = *groups.rbegin();
    for (auto before = std::next(groups.rbegin()); before != groups.rend(); ++before) {
      const long passed = (last - before->first) * step;
      if (passed < kGoesStraight) continue;
      if (passed > 3 * kGoesStraight) break;
      const long ahead = std::min((frame - last) * step, kGoesStraight);
      return now.middle +
             (now.middle - before->second.middle) * static_cast<double>(ahead) / static_cast<double>(passed);
    }
    return now.middle;
  }
  bool overlaps(const GroupTrack& other) const {
    return std::any_of(other.groups.begin(), other.groups.end(),
                       [&](const auto& item) { return groups.count(item.first) > 0; });
  }
};

/// Gives each group of a frame to the nearest track that it may continue, or to a new one.
void link_groups(long frame, long step, std::vector<PersonGroup> groups, std::vector<GroupTrack>& tracks) {
  struct Link {
    double distance;
    std::size_t group, track;
  };
  std::vector<Link> links;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const long last = tracks[t].groups.rbegin()->first;
    const double reach = std::min(kMaxStep, kStep + kStepPerFrame * static_cast<double>((frame - last) * step));
    const Vector3d expected = tracks[t].expected(frame, step);
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const double distance = (groups[g].middle - expected).norm();
      if (distance <= reach) links.push_back({distance, g, t});
    }
  }
  std::stable_sort(links.begin(), links.end(), [](const Link& a, const Link& b) { return a.distance < b.distance; });
  std::vector<bool> group_done(groups.size(), false), track_done(tracks.size(), false);
  for (const Link& link : links) {
    if (group_done[link.group] || track_done[link.track]) continue;
    group_done[link.group] = track_done[link.track] = true;
    tracks[link.track].add(frame, std::move(groups[link.group]));
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (group_done[g]) continue;
    tracks.emplace_back();
    tracks.back().add(frame, std::move(groups[g]));
  }
}

/// Joins tracks that cannot be two people: the later one begins when the earlier one has ended, and is seen about as
/// well. Tracks are sorted by their support.
void join_tracks(std::vector<GroupTrack>& tracks) {
  for (std::size_t i = 0; i < tracks.size(); ++i)
    for (std::size_t j = i + 1; j < tracks.size();) {
      const bool same =
          !tracks[i].overlaps(tracks[j]) && tracks[j].support_per_frame() >= kGoesOn * tracks[i].support_per_frame();
      if (!same) {
        ++j;
        continue;
      }
      for (auto& [frame, group] : tracks[j].groups) tracks[i].add(frame, std::move(group));
      tracks.erase(tracks.begin() + static_cast<std::ptrdiff_t>(j));
    }
}

bool has_more_support(const GroupTrack& a, const GroupTrack& b) { return a.support > b.support; }

/// The body between two frames; points that one of them lacks are left out.
std::vector<std::optional<Vector3d>> body_between(const PersonGroup& a, const PersonGroup& b, double share) {
  std::vector<std::optional<Vector3d>> body(a.body.size());
  for (std::size_t i = 0; i < body.size(); ++i)
    if (a.body[i] && b.body[i]) body[i] = (1.0 - share) * *a.body[i] + share * *b.body[i];
  return body;
}

FoundPerson described(const GroupTrack& track, std::size_t frames) {
  FoundPerson person;
  person.position = track.position();
  person.support = track.support;
  for (const auto& [frame, group] : track.groups) {
    person.views += group.views;
    person.residual += group.residual;
  }
  const auto count = static_cast<double>(track.groups.size());
  person.frames = count / static_cast<double>(frames);
  person.views /= count;
  person.residual /= count;
  return person;
}

int wanted_person(const std::vector<FoundPerson>& people, const PersonChoiceOptions& options) {
  if (options.person && options.near)
    fail<UsageError>("following a person: either the index of the person or a position may be given, not both");
  if (people.empty()) return -1;
  if (options.person) {
    if (*options.person < 0 || *options.person >= static_cast<int>(people.size()))
      fail<UsageError>("following a person: person {} was asked for, and {} people were found, counted from 0",
                       *options.person, people.size());
    return *options.person;
  }
  if (!options.near) return 0;
  const auto nearest = std::min_element(people.begin(), people.end(), [&](const auto& a, const auto& b) {
    return (a.position - *options.near).norm() < (b.position - *options.near).norm();
  });
  return static_cast<int>(nearest - people.begin());
}

/// The choice in all frames, gaps included.
class ChosenPerson {
 public:
  ChosenPerson(const std::vector<std::vector<People>>& frames, const PersonGrouper& grouper, const GroupTrack& track,
               const PersonChoiceOptions& options)
      : frames_(frames), grouper_(grouper), longest_gap_(options.longest_gap / options.step) {
    for (auto before = track.groups.begin(); before != track.groups.end(); ++before) {
      complete(before->first, before->second);
      const auto after = std::next(before);
      if (after != track.groups.end()) bridge(*before, *after);
    }
  }

  std::vector<int> in_frame(long frame, std::size_t cameras) const {
    const auto found = chosen_.find(frame);
    return found == chosen_.end() ? std::vector<int>(cameras, -1) : found->second;
  }

 private:
  using Moment = std::pair<const long, PersonGroup>;

  /// The detections of the group and, where a camera has none, one that is nearly as close.
  void complete(long frame, const PersonGroup& group) {
    const PersonGroup wider = grouper_.match(frames_[frame], group.body, kTolerance);
    std::vector<int>& chosen = chosen_[frame] = group.chosen;
    for (std::size_t c = 0; c < chosen.size(); ++c)
      if (chosen[c] < 0) chosen[c] = wider.chosen[c];
  }

  void bridge(const Moment& before, const Moment& after) {
    const long gap = after.first - before.first;
    if (gap <= 1 || gap - 1 > longest_gap_) return;
    for (long frame = before.first + 1; frame < after.first; ++frame) {
      const double share = static_cast<double>(frame - before.first) / static_cast<double>(gap);
      const auto body = body_between(before.second, after.second, share);
      chosen_[frame] = grouper_.match(frames_[frame], body, kTolerance).chosen;
    }
  }

  const std::vector<std::vector<People>>& frames_;
  const PersonGrouper& grouper_;
  long longest_gap_;  ///< of the given frames
  std::map<long, std::vector<int>> chosen_;
};

std::vector<GroupTrack> find_tracks(const std::vector<std::vector<People>>& frames, const PersonGrouper& grouper,
                                    std::size_t cameras, long step) {
  std::vector<GroupTrack> tracks;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (frames[f].size() != cameras)
      fail("following a person: frame {} has people of {} cameras, expected {}", f, frames[f].size(), cameras);
    link_groups(static_cast<long>(f), step, grouper.find(frames[f]), tracks);
  }
  std::stable_sort(tracks.begin(), tracks.end(), has_more_support);
  join_tracks(tracks);
  std::stable_sort(tracks.begin(), tracks.end(), has_more_support);
  return tracks;
}

}  // namespace

std::vector<std::string> PersonChoice::doubts(const std::vector<Camera>& cameras_of_choice) const {
  std::vector<std::string> sentences;
  if (person < 0) {
    sentences.emplace_back(
        "no two cameras agree on a person; check that the cameras are synchronous, that the calibration is of these "
        "videos, and that `keypoint_map` is the detector's");
    return sentences;
  }
  if (ambiguous) {
    std::string list;
    for (std::size_t i = 0; i < people.size(); ++i)
      list +=
          fmt::format("{}person {} near ({:.2f}, {:.2f}, {:.2f}) m in {:.0f} % of the frames", i ? "; " : "", i,
                      people[i].position.x(), people[i].position.y(), people[i].position.z(), 100.0 * people[i].frames);
    sentences.push_back(fmt::format(
        "several people agree about equally well: {}. Person {} is followed; set `person` to another index or to a "
        "position, as in `person: {{near: [x, y, z]}}` in metres",
        list, person));
  }
  for (std::size_t c = 0; c < cameras.size(); ++c)
    if (cameras[c] < kCameraNeverAgrees)
      sentences.push_back(fmt::format(
          "camera {} hardly ever agrees with the others on the person; check its calibration, its frame offset and its "
          "keypoint files",
          cameras_of_choice.at(c).name));
  return sentences;
}

PersonChoice follow_people(const std::vector<std::vector<People>>& frames, const std::vector<Camera>& cameras,
                           const PointLayout& layout, const PersonChoiceOptions& options) {
  const PersonGrouper grouper(cameras, mirrored_indices(layout.points), options.max_residual);
  const std::vector<GroupTrack> tracks = find_tracks(frames, grouper, cameras.size(), options.step);
  PersonChoice choice;
  for (const GroupTrack& track : tracks)
    if (track.support >= kWorthNaming * tracks[0].support) choice.people.push_back(described(track, frames.size()));
  choice.person = wanted_person(choice.people, options);
  choice.ambiguous = !options.names_person() && choice.people.size() > 1 &&
                     choice.people[1].support >= kEquallyGood * choice.people[0].support;
  const GroupTrack nobody;
  const GroupTrack& track = choice.person < 0 ? nobody : tracks[choice.person];
  const ChosenPerson chosen(frames, grouper, track, options);
  choice.cameras.assign(cameras.size(), 0.0);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    choice.chosen.push_back(chosen.in_frame(static_cast<long>(f), cameras.size()));
    for (std::size_t c = 0; c < cameras.size(); ++c) choice.cameras[c] += choice.chosen[f][c] >= 0;
  }
  for (double& share : choice.cameras) share /= std::max(1.0, static_cast<double>(frames.size()));
  return choice;
}

}  // namespace doppel
