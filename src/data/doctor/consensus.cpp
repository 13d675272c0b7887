#include "doppel/data/doctor/consensus.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "doppel/core/as_size.h"
#include "doppel/data/doctor/statistics.h"
#include "doppel/detect/keypoints/person_choice.h"

namespace doppel {

namespace {

constexpr int kProposalInstants = 40;   ///< looked at for each group of cameras
constexpr std::size_t kMaxGroups = 84;  ///< all triples of nine cameras
constexpr int kQuickInstants = 24;      ///< where only the quality is wanted
constexpr std::size_t kQuickGroups = 28;
constexpr double kMemberRatio = 2.0;  ///< of the noise, up to which a camera may join
constexpr double kMinNoise = 0.0015;  ///< share of the person's size; below, rounding and the lens dominate
constexpr double kMinFactor = 0.1;
constexpr double kMinKnownShare = 0.5;  ///< share of the points that a group must triangulate

double extent_of(const SeenPerson& person) {
  Eigen::AlignedBox2d box;
  for (const SeenPoint& point : person)
    if (point.seen) box.extend(point.pixel);
  return box.sizes().norm();
}

People people_of(const std::vector<SeenPerson>& seen) {
  People people;
  for (const SeenPerson& person : seen) {
    people.emplace_back();
    for (const SeenPoint& point : person)
      people.back().push_back(
          point.seen ? Keypoint{static_cast<float>(point.pixel.x()), static_cast<float>(point.pixel.y()), 1.0f}
                     : Keypoint{});
  }
  return people;
}

bool has_several(const Sightings& seen) {
  int several = 0, all = 0;
  for (const auto& camera : seen.people)
    for (const auto& people : camera) {
      several += people.size() > 1;
      all += !people.empty();
    }
  return 50 * several > all;
}

std::vector<std::vector<int>> groups_of(int cameras, std::size_t most) {
  std::vector<std::vector<int>> groups;
  for (int a = 0; a < cameras; ++a)
    for (int b = a + 1; b < cameras; ++b) {
      if (cameras <= 3) groups.push_back({a, b});
      for (int c = b + 1; c < cameras && cameras > 3; ++c) groups.push_back({a, b, c});
    }
  const std::size_t stride = (groups.size() + most - 1) / most;
  std::vector<std::vector<int>> kept;
  for (std::size_t i = 0; i < groups.size(); i += std::max<std::size_t>(1, stride)) kept.push_back(groups[i]);
  return kept;
}

/// How many cameras have to agree: all of up to three but one, all but two of up to eight, two thirds of more.
std::size_t needed_members(std::size_t cameras) {
  if (cameras <= 3) return 2;
  return std::max<std::size_t>(3, std::min(cameras - 2, (2 * cameras + 2) / 3));
}

/// Share of the chosen points, seen by two cameras of the group, that the group could triangulate.
double known_share(const Sightings& seen, const PersonOfCamera& person, const std::vector<int>& group,
                   const BodyTrack& body, const ChosenInstants& chosen) {
  int shared = 0, known = 0;
  for (const int instant : chosen.instants)
    for (int k = 0; k < seen.num_points(); ++k) {
      int views = 0;
      for (const int c : group) {
        const int index = person[c][instant];
        views += index >= 0 && seen.people[c][instant][index][k].seen;
      }
      shared += views >= 2;
      known += views >= 2 && body.known(instant, k);
    }
  return shared == 0 ? 0.0 : static_cast<double>(known) / shared;
}

struct GroupResult {
  std::vector<int> group;
  double quality = kMaxShare;
};

GroupResult best_group(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person,
                       const SightTable& sights, const ChosenInstants& chosen, std::size_t most_groups) {
  const std::size_t needed = needed_members(views.size());
  GroupResult best;
  for (const std::vector<int>& group : groups_of(seen.num_cameras(), most_groups)) {
    const BodyTrack body = sights.triangulate(group, chosen);
    if (known_share(seen, person, group, body, chosen) < kMinKnownShare) continue;
    std::vector<double> residual;
    for (int c = 0; c < seen.num_cameras(); ++c) {
      const std::vector<double> shares = residuals_of(seen, c, views[c], body, chosen).shares;
      residual.push_back(shares.empty() ? kMaxShare : median(shares));
    }
    std::sort(residual.begin(), residual.end());
    if (residual[needed - 1] < best.quality) best = {group, residual[needed - 1]};
  }
  return best;
}

/// The residual of a camera that took part in a triangulation, over the noise of a view. Without a common point: n
/// views have 2n equations for three unknowns.
double inside_factor(const SightTable& sights, const std::vector<int>& members, int camera, const BodyTrack& body) {
  const double uncertainty =
      sights.uncertainty(members, camera, body).value_or(1.5 / static_cast<double>(members.size()));
  return std::sqrt(std::max(kMinFactor, 1.0 - uncertainty));
}

}  // namespace

double expected_factor(const SightTable& sights, const std::vector<int>& others, int camera, const BodyTrack& body) {
  return std::sqrt(1.0 + sights.uncertainty(others, camera, body).value_or(1.5 / static_cast<double>(others.size())));
}

namespace {

void judge_cameras(const Sightings& seen, const std::vector<SupposedView>& views, const SightTable& sights,
                   Consensus& consensus) {
  const ChosenInstants all = all_instants(seen);
  consensus.body = sights.triangulate(consensus.members, all);
  std::vector<double> inside;
  for (const int c : consensus.members)
    inside.push_back(residuals_of(seen, c, views[c], consensus.body, all).mean_of_windows(seen.windows.size()) /
                     inside_factor(sights, consensus.members, c, consensus.body));
  consensus.noise = std::max(kMinNoise, median(inside));
  consensus.residual.clear();
  consensus.expected.clear();
  consensus.by_window.clear();
  for (int c = 0; c < seen.num_cameras(); ++c) {
    std::vector<int> others;
    for (const int member : consensus.members)
      if (member != c) others.push_back(member);
    // Two views alone fix a point badly along their rays, so a member of three is judged from inside.
    const bool inside_only = others.size() < 3 && others.size() < consensus.members.size();
    const bool is_outside = others.size() == consensus.members.size();
    const BodyTrack body = inside_only || is_outside ? consensus.body : sights.triangulate(others, all);
    const ViewResiduals residuals = residuals_of(seen, c, views[c], body, all);
    consensus.residual.push_back(residuals.mean_of_windows(seen.windows.size()));
    consensus.by_window.push_back(residuals.by_window(seen.windows.size()));
    consensus.expected.push_back(consensus.noise * (inside_only
                                                        ? inside_factor(sights, consensus.members, c, consensus.body)
                                                        : expected_factor(sights, others, c, consensus.body)));
  }
}

}  // namespace

PersonOfCamera choose_detections(const Sightings& seen) {
  const std::size_t instants = as_size(seen.num_instants());
  PersonOfCamera person(seen.cameras.size(), std::vector<int>(instants, -1));
  std::vector<std::vector<int>> followed(instants, std::vector<int>(seen.cameras.size(), -1));
  if (has_several(seen) && seen.cameras.size() > 1) {
    std::vector<std::vector<People>> frames(instants);
    for (std::size_t i = 0; i < instants; ++i)
      for (const auto& camera : seen.people) frames[i].push_back(people_of(camera[i]));
    const PersonChoice choice = follow_people(frames, seen.cameras, {"examined", seen.points});
    if (choice.person >= 0) followed = choice.chosen;
  }
  for (std::size_t c = 0; c < person.size(); ++c) {
    int agreed = 0, there = 0;
    for (std::size_t i = 0; i < instants; ++i) {
      agreed += followed[i][c] >= 0;
      there += !seen.people[c][i].empty();
    }
    const bool agrees = 2 * agreed > there;
    for (std::size_t i = 0; i < instants; ++i) {
      const auto& people = seen.people[c][i];
      person[c][i] = followed[i][c];
      if (agrees || people.empty()) continue;
      const auto largest = std::max_element(people.begin(), people.end(),
                                            [](const auto& a, const auto& b) { return extent_of(a) < extent_of(b); });
      person[c][i] = static_cast<int>(largest - people.begin());
    }
  }
  return person;
}

std::vector<SupposedView> calibrated_views(const Sightings& seen) {
  std::vector<SupposedView> views;
  for (const Camera& camera : seen.cameras) {
    views.emplace_back();
    views.back().camera = camera;
  }
  return views;
}

double consensus_quality(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person) {
  const ChosenInstants chosen = all_instants(seen, kQuickInstants);
  return best_group(seen, views, person, SightTable(seen, views, person, chosen), chosen, kQuickGroups).quality;
}

Consensus find_consensus(const Sightings& seen, const std::vector<SupposedView>& views, const PersonOfCamera& person) {
  Consensus consensus;
  const SightTable sights(seen, views, person, all_instants(seen));
  const GroupResult best = best_group(seen, views, person, sights, all_instants(seen, kProposalInstants), kMaxGroups);
  consensus.quality = best.quality;
  if (best.group.empty() || best.quality > kAgreementShare) return consensus;
  consensus.found = true;
  consensus.members = best.group;
  judge_cameras(seen, views, sights, consensus);
  for (int round = 0; round < 3; ++round) {
    std::vector<int> members;
    for (int c = 0; c < seen.num_cameras(); ++c)
      if (consensus.residual[c] <= kMemberRatio * consensus.expected[c]) members.push_back(c);
    if (members.size() < std::min<std::size_t>(3, seen.cameras.size() - 1) || members == consensus.members) break;
    consensus.members = members;
    judge_cameras(seen, views, sights, consensus);
  }
  return consensus;
}

}  // namespace doppel
