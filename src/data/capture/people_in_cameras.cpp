#include "doppel/data/capture/people_in_cameras.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "doppel/core/as_size.h"
#include "doppel/core/log.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

namespace {

constexpr long kRowsOfVote = 8;
constexpr double kMaxStep = 0.05;  ///< of a point from frame to frame, share of the image's height

using ChosenFrames = std::map<long, int>;  ///< index of the person by video frame

/// The detection nearest to a person of the frame before or after; -1: none is near.
int nearest_to(const Person& person, const People& people, double limit) {
  int nearest = -1;
  double least = limit;
  for (std::size_t i = 0; i < people.size(); ++i) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t k = 0; k < std::min(person.size(), people[i].size()); ++k) {
      const Keypoint &a = person[k], &b = people[i][k];
      if (a.confidence <= 0.0f || b.confidence <= 0.0f) continue;
      sum += std::hypot(a.x - b.x, a.y - b.y);
      ++count;
    }
    if (count == 0 || sum / count > least) continue;
    least = sum / count;
    nearest = static_cast<int>(i);
  }
  return nearest;
}

class Follower {
 public:
  Follower(const PeopleInCameras& seen, const PointLayout& layout, const PersonChoiceOptions& options)
      : seen_(seen), layout_(layout), options_(options) {
    for (long row = seen.first_row; row <= seen.last_row; ++row) {
      frames_.emplace_back();
      for (std::size_t c = 0; c < seen.cameras.size(); ++c)
        frames_.back().push_back(seen.people[c](seen.clocks[c].frame(row)).value_or(People()));
    }
  }

  std::vector<ChoiceOfFrame> choose(const MaskOfCamera& mask) {
    choice_ = follow_people(frames_, seen_.cameras, layout_, options_);
    if (mask && !options_.names_person() && choice_.people.size() > 1) choose_by_masks(mask);
    for (const std::string& doubt : choice_.doubts(seen_.cameras)) log::warn("sequence {}: {}", seen_.sequence, doubt);
    std::vector<ChoiceOfFrame> chosen;
    for (std::size_t c = 0; c < seen_.cameras.size(); ++c) {
      const auto frames = std::make_shared<const ChosenFrames>(frames_of(c));
      chosen.emplace_back([frames](long frame) {
        const auto found = frames->find(frame);
        return found == frames->end() ? -1 : found->second;
      });
    }
    return chosen;
  }

 private:
  /// Follows the person with most of the detections that the masks choose.
  void choose_by_masks(const MaskOfCamera& mask) {
    const std::vector<std::vector<int>> wanted = detections_in_masks(mask);
    const std::size_t people = choice_.people.size();
    long most = 0;
    for (std::size_t person = 0; person < people; ++person) {
      PersonChoiceOptions options = options_;
      options.person = static_cast<int>(person);
      PersonChoice other = follow_people(frames_, seen_.cameras, layout_, options);
      long votes = 0;
      for (std::size_t f = 0; f < wanted.size(); ++f)
        for (std::size_t c = 0; c < wanted[f].size(); ++c)
          votes += wanted[f][c] >= 0 && other.chosen[f][c] == wanted[f][c];
      if (votes <= most) continue;
      most = votes;
      choice_ = std::move(other);
    }
    log::info("sequence {}: of {} people, the masks show person {}", seen_.sequence, people, choice_.person);
  }

  /// [F][C] the detection in the mask, in a few frames; -1 in the others, and where fewer than two people are.
  std::vector<std::vector<int>> detections_in_masks(const MaskOfCamera& mask) const {
    std::vector<std::vector<int>> wanted(frames_.size(), std::vector<int>(seen_.cameras.size(), -1));
    for (std::size_t c = 0; c < seen_.cameras.size(); ++c) {
      const Undistorter undistorter(seen_.cameras[c]);
      std::vector<std::size_t> crowded;
      for (std::size_t f = 0; f < frames_.size(); ++f)
        if (frames_[f][c].size() > 1) crowded.push_back(f);
      const std::size_t step = std::max<std::size_t>(1, crowded.size() / as_size(kRowsOfVote));
      for (std::size_t i = 0; i < crowded.size(); i += step) {
        const std::size_t f = crowded[i];
        wanted[f][c] =
            index_of_person(undistorted(undistorter, frames_[f][c]), mask(c, seen_.first_row + static_cast<long>(f)));
      }
    }
    return wanted;
  }

  /// The choice by video frame. In frames that are not the nearest of any row, the same person is the detection nearest
  /// to that of the frame before; in the first frame, of the frame after.
  ChosenFrames frames_of(std::size_t c) const {
    const FrameClock& clock = seen_.clocks[c];
    ChosenFrames chosen;
    for (std::size_t f = 0; f < frames_.size(); ++f)
      chosen[clock.frame(seen_.first_row + static_cast<long>(f))] = choice_.chosen[f][c];
    if (clock.is_whole()) return chosen;
    const auto first = static_cast<long>(std::floor(clock.time(seen_.first_row)));
    const auto last = static_cast<long>(std::ceil(clock.time(seen_.last_row)));
    if (chosen.count(first) == 0) chosen[first] = continued(c, first + 1, chosen, first);
    for (long frame = first + 1; frame <= last; ++frame)
      if (chosen.count(frame) == 0) chosen[frame] = continued(c, frame - 1, chosen, frame);
    return chosen;
  }

  /// The detection in `frame` nearest to the chosen one in the neighbouring frame `known`; -1: none.
  int continued(std::size_t c, long known, const ChosenFrames& chosen, long frame) const {
    const auto index = chosen.find(known);
    if (index == chosen.end() || index->second < 0) return -1;
    const People before = seen_.people[c](known).value_or(People());
    return nearest_to(before.at(as_size(index->second)), seen_.people[c](frame).value_or(People()),
                      kMaxStep * seen_.cameras[c].height);
  }

  const PeopleInCameras& seen_;
  const PointLayout& layout_;
  const PersonChoiceOptions& options_;
  std::vector<std::vector<People>> frames_;  ///< [F][C]
  PersonChoice choice_;
};

bool has_several(const PeopleInCameras& seen) {
  for (std::size_t c = 0; c < seen.cameras.size(); ++c)
    for (long row = seen.first_row; row <= seen.last_row; ++row) {
      const std::optional<People> people = seen.people[c](seen.clocks[c].frame(row));
      if (people && people->size() > 1) return true;
    }
  return false;
}

}  // namespace

std::vector<ChoiceOfFrame> follow_in_cameras(const PeopleInCameras& seen, const PointLayout& layout,
                                             const PersonChoiceOptions& options, const MaskOfCamera& mask) {
  return Follower(seen, layout, options).choose(mask);
}

std::vector<ChoiceOfFrame> follow_if_several(const PeopleInCameras& seen, const PointLayout& layout,
                                             const PersonChoiceOptions& options, const MaskOfCamera& mask) {
  if (seen.cameras.size() >= 2 && (options.names_person() || has_several(seen)))
    return follow_in_cameras(seen, layout, options, mask);
  return std::vector<ChoiceOfFrame>(seen.cameras.size());
}

}  // namespace doppel
