#include "doppel/detect/keypoints/person_anchors.h"

#include <algorithm>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/triangulation.h"

namespace doppel {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHipReach = 0.35, kMinHipReach = 0.15;  ///< metres between the hips of one person
constexpr double kHipError = 0.03;                       ///< of a detection, share of the image's height
constexpr double kNearest = 0.05;                        ///< metres before a camera
constexpr double kMinAgreeing = 0.25;                    ///< of the moments in which a camera should see the person
constexpr double kBeyond = 0.5;  ///< of the image's sides; lenses are not to be trusted farther outside of the image

/// One of the people in all moments.
struct Sighting {
  std::vector<std::vector<int>> chosen;       ///< [F][C] index into the camera's people
  std::vector<std::optional<Vector3d>> hips;  ///< [F] world, metres
};

bool is_in_image(const Vector2d& pixel, const Camera& camera, double beyond = 0.0) {
  const Vector2d size(camera.width, camera.height);
  return (pixel.array() >= -beyond * size.array()).all() && (pixel.array() <= (1.0 + beyond) * size.array()).all();
}

class Moments {
 public:
  Moments(const SeenPeople& seen, const PersonChoiceOptions& options)
      : seen_(seen), options_(options), left_(hip("left_hip")), right_(hip("right_hip")) {
    options_.step = seen.step;
    choice_ = follow_people(seen.people, seen.cameras, seen.layout, options_);
    for (std::size_t i = 0; i < choice_.people.size(); ++i) people_.push_back(sighting_of(static_cast<int>(i)));
  }

  const PersonChoice& choice() const { return choice_; }

  /// Whether every detection shows this person.
  bool is_alone(int person) const {
    for (std::size_t f = 0; f < seen_.people.size(); ++f)
      for (std::size_t c = 0; c < seen_.cameras.size(); ++c) {
        const std::size_t detections = seen_.people[f][c].size();
        if (detections > 1 || (detections == 1 && people_.at(as_size(person)).chosen[f][c] < 0)) return false;
      }
    return true;
  }

  int nearest_to(const PersonAtPixel& wanted) const {
    for (std::size_t f = 0; f < seen_.people.size(); ++f) {
      if (seen_.people[f].at(wanted.camera).empty()) continue;
      int nearest = -1;
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i < people_.size(); ++i) {
        const auto anchor = anchor_of(people_[i], f, wanted.camera);
        if (!anchor || !anchor->visible || !((anchor->hips - wanted.pixel).norm() < least)) continue;
        least = (anchor->hips - wanted.pixel).norm();
        nearest = static_cast<int>(i);
      }
      if (nearest >= 0) return nearest;
    }
    fail<UsageError>(
        "following a person: camera {} never sees anybody on whom another camera agrees; name the person "
        "in another camera, or by a position in the world",
        seen_.cameras.at(wanted.camera).name);
  }

  /// [F] the anchors of a person in a camera.
  std::vector<std::optional<PersonAnchor>> anchors(int person, std::size_t camera) const {
    std::vector<std::optional<PersonAnchor>> anchors;
    for (std::size_t f = 0; f < seen_.people.size(); ++f) {
      auto anchor = among_others(anchor_of(people_[as_size(person)], f, camera), person, f, camera);
      if (!anchor && sees_only_others(person, f, camera)) anchor = PersonAnchor{{0, 0}, 0.0, false};
      anchors.push_back(anchor);
    }
    return anchors;
  }

  bool is_doubtful(int person, std::size_t camera) const {
    const Sighting& sighting = people_[as_size(person)];
    long should_see = 0, agree = 0;
    for (std::size_t f = 0; f < seen_.people.size(); ++f) {
      const auto anchor = anchor_of(sighting, f, camera);
      if (!anchor || !anchor->visible || seen_.people[f][camera].empty()) continue;
      ++should_see;
      agree += sighting.chosen[f][camera] >= 0;
    }
    return static_cast<double>(agree) < kMinAgreeing * static_cast<double>(should_see);
  }

 private:
  std::size_t hip(const char* name) const {
    const std::optional<int> index = seen_.layout.find(name);
    if (!index) fail<UsageError>("following a person: the layout {} has no point {}", seen_.layout.name, name);
    return as_size(*index);
  }

  std::optional<Vector2d> hips_of(const Person& person) const {
    const Keypoint &left = person.at(left_), &right = person.at(right_);
    if (left.confidence <= 0.0f || right.confidence <= 0.0f) return std::nullopt;
    return Vector2d(0.5 * (left.x + right.x), 0.5 * (left.y + right.y));
  }

  Sighting sighting_of(int person) const {
    PersonChoiceOptions options = options_;
    options.near.reset();
    options.person = person;
    Sighting sighting{follow_people(seen_.people, seen_.cameras, seen_.layout, options).chosen, {}};
    for (std::size_t f = 0; f < seen_.people.size(); ++f)
      sighting.hips.push_back(hips_in_space(seen_.people[f], sighting.chosen[f]));
    return sighting;
  }

  std::optional<Vector3d> hips_in_space(const std::vector<People>& people, const std::vector<int>& chosen) const {
    std::vector<Sight> sights;
    TriangulationOptions options;
    options.inlier_threshold = 0.0;
    for (std::size_t c = 0; c < chosen.size(); ++c) {
      options.inlier_threshold = std::max(options.inlier_threshold, kHipError * seen_.cameras[c].height);
      const auto pixel = chosen[c] < 0 ? std::nullopt : hips_of(people[c].at(as_size(chosen[c])));
      const auto sight = pixel ? sight_of(seen_.cameras[c], *pixel) : std::nullopt;
      if (sight) sights.push_back(*sight);
    }
    const auto point = triangulate(sights, options);
    return point ? std::optional(point->position) : std::nullopt;
  }

  /// The hips of the detection that was chosen, if they are where the other cameras see them: a pose that mixes two
  /// people may agree in other points.
  std::optional<Vector2d> seen_hips(const Sighting& sighting, std::size_t f, std::size_t c,
                                    const PersonAnchor& projected) const {
    const int chosen = sighting.chosen[f][c];
    const auto hips = chosen < 0 ? std::nullopt : hips_of(seen_.people[f][c].at(as_size(chosen)));
    return hips && (*hips - projected.hips).norm() <= kMinHipReach / kHipReach * projected.radius ? hips : std::nullopt;
  }

  /// Where a person is in a camera, without regard to the others. Nothing: not known.
  std::optional<PersonAnchor> anchor_of(const Sighting& sighting, std::size_t f, std::size_t c) const {
    if (!sighting.hips[f]) return std::nullopt;
    const Camera& camera = seen_.cameras[c];
    const Vector3d there = camera.camera_from_world(*sighting.hips[f]);
    PersonAnchor anchor;
    anchor.visible = there.z() >= kNearest && is_in_image((camera.K * there / there.z()).head<2>(), camera, kBeyond);
    if (!anchor.visible) return anchor;
    anchor.radius = kHipReach * pixels_per_metre(camera, there.z());
    anchor.hips = camera.project(*sighting.hips[f]);
    const auto seen = seen_hips(sighting, f, c, anchor);
    anchor.visible = seen || is_in_image(anchor.hips, camera);
    if (seen) anchor.hips = *seen;
    return anchor;
  }

  static double pixels_per_metre(const Camera& camera, double depth) {
    return 0.5 * (camera.K(0, 0) + camera.K(1, 1)) / depth;
  }

  /// Hides the person behind others, and keeps the others out of the radius.
  std::optional<PersonAnchor> among_others(std::optional<PersonAnchor> anchor, int person, std::size_t f,
                                           std::size_t c) const {
    if (!anchor || !anchor->visible) return anchor;
    const Sighting& sighting = people_[as_size(person)];
    const bool is_seen = seen_hips(sighting, f, c, *anchor).has_value();
    const double reach = anchor->radius;
    for (std::size_t i = 0; i < seen_.people[f][c].size(); ++i) {
      const auto other = hips_of(seen_.people[f][c][i]);
      if ((is_seen && static_cast<int>(i) == sighting.chosen[f][c]) || !other) continue;
      if (!is_seen && anchor->holds(*other) && shows_another(person, f, c, static_cast<int>(i)))
        anchor->visible = false;
      anchor->radius =
          std::min(anchor->radius, std::max(0.5 * (*other - anchor->hips).norm(), kMinHipReach / kHipReach * reach));
    }
    return anchor;
  }

  /// Whether two of the people were there at the same time, so that they cannot be the same.
  bool are_two(int person, std::size_t other) const {
    const auto &a = people_[as_size(person)].hips, &b = people_[other].hips;
    for (std::size_t f = 0; f < a.size(); ++f)
      if (a[f] && b[f]) return true;
    return false;
  }

  /// Whether a camera sees another one of the people, and not this one.
  bool sees_only_others(int person, std::size_t f, std::size_t c) const {
    if (people_[as_size(person)].chosen[f][c] >= 0) return false;
    for (std::size_t i = 0; i < people_.size(); ++i)
      if (static_cast<int>(i) != person && people_[i].chosen[f][c] >= 0 && are_two(person, i)) return true;
    return false;
  }

  /// Whether a detection shows another one of the people.
  bool shows_another(int person, std::size_t f, std::size_t c, int detection) const {
    for (std::size_t i = 0; i < people_.size(); ++i)
      if (static_cast<int>(i) != person && people_[i].chosen[f][c] == detection) return true;
    return false;
  }

  const SeenPeople& seen_;
  PersonChoiceOptions options_;
  std::size_t left_, right_;
  PersonChoice choice_;
  std::vector<Sighting> people_;
};

}  // namespace

AnchoredPerson anchor_person(const SeenPeople& seen, const PersonChoiceOptions& options,
                             const std::optional<PersonAtPixel>& wanted) {
  const Moments moments(seen, wanted ? PersonChoiceOptions() : options);
  AnchoredPerson result;
  result.people = moments.choice().people;
  result.person = wanted ? moments.nearest_to(*wanted) : moments.choice().person;
  result.ambiguous = !wanted && moments.choice().ambiguous;
  result.anchors.resize(seen.cameras.size());
  for (auto& anchors : result.anchors) anchors.resize(seen.people.size());
  if (result.person < 0) return result;
  result.alone = moments.is_alone(result.person);
  for (std::size_t c = 0; c < seen.cameras.size(); ++c)
    if (moments.is_doubtful(result.person, c))
      result.doubtful.push_back(c);
    else
      result.anchors[c] = moments.anchors(result.person, c);
  return result;
}

}  // namespace doppel
