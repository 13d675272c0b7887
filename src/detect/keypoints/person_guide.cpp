#include "doppel/detect/keypoints/person_guide.h"

#include <algorithm>
#include <iterator>

namespace doppel {

namespace {

/// Growth of the radius in the time from one moment to the next: after one anchor, a body walks half of its width in a
/// tenth of a second; between two anchors it leaves the line by less.
constexpr double kGrowthAfter = 2.5, kGrowthBetween = 1.0;

/// @param growth of the radius @param share of the time from one moment to the next
PersonAnchor grown(PersonAnchor anchor, double growth, double share) {
  anchor.radius *= 1.0 + growth * share;
  return anchor;
}

}  // namespace

PersonGuide::PersonGuide(std::map<long, PersonAnchor> anchors, double step)
    : anchors_(std::move(anchors)), step_(step) {
  for (const auto& [frame, anchor] : anchors_)
    if (anchor.visible && !start_) start_ = anchor.hips;
}

std::optional<PersonAnchor> PersonGuide::at(long frame) const {
  const auto after = anchors_.lower_bound(frame);
  if (after != anchors_.end() && after->first == frame) return after->second;
  const auto frames_to = [&](auto anchor) { return std::abs(static_cast<double>(anchor->first - frame)); };
  const auto known = [&](auto anchor) -> std::optional<PersonAnchor> {
    if (frames_to(anchor) > step_) return std::nullopt;
    return grown(anchor->second, kGrowthAfter, frames_to(anchor) / step_);
  };
  if (after == anchors_.begin()) return after == anchors_.end() ? std::nullopt : known(after);
  const auto before = std::prev(after);
  if (after == anchors_.end()) return known(before);
  if (!before->second.has_hips() || !after->second.has_hips()) return known(before->second.has_hips() ? before : after);
  const double gap = std::min(frames_to(before), frames_to(after));
  if (gap > step_) return std::nullopt;
  const double share = frames_to(before) / (frames_to(before) + frames_to(after));
  PersonAnchor between = before->second;
  between.hips += share * (after->second.hips - before->second.hips);
  between.radius += share * (after->second.radius - before->second.radius);
  between.visible = before->second.visible || after->second.visible;
  return grown(between, kGrowthBetween, gap / step_);
}

}  // namespace doppel
