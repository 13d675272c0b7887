#include "doppel/data/doctor/activity_examination.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>

#include "doppel/core/as_size.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

constexpr double kClearGain = 0.08;    ///< of the contrast between activity on and beside the limbs
constexpr double kGoodContrast = 0.5;  ///< that a correction must reach
constexpr double kRejected = 0.2;      ///< contrast below which a video speaks against its keypoints
constexpr double kClearlyElsewhere =
    0.2;  ///< contrast that limbs gain at another position, in a video that speaks against them
constexpr double kPerhapsElsewhere = 0.1;       ///< the same, of a correction that is not believed
constexpr double kStepAside = 0.1;              ///< between the positions that are tried, of the limbs' size
constexpr int kStepsAside = 6, kNearSteps = 1;  ///< in each direction; so near is the same position
constexpr double kMaxActiveShare = 0.3;         ///< share of the image: more is a camera or a lamp that moves
constexpr double kLimbWidth = 0.07;             ///< of the person's size
constexpr double kActiveShare = 0.05;           ///< of the limbs' pixels: fewer active ones are noise, or a small thing
constexpr double kShareOfImages = 0.5;          ///< that must have so many active pixels
constexpr double kMovingShare = 0.1;      ///< of the limbs' pixels that leave the position where the limbs usually are
constexpr int kJitter = 5;                ///< pixels, diameter by which limbs may waver without moving
constexpr double kActiveDifference = 12;  ///< grey levels
constexpr std::size_t kMinImages = 5;
constexpr double kBodyOnOwnMask = 0.85, kOnMaskGain = 0.04;  ///< share of the points; more than of the keypoints

using SmallImages = std::vector<cv::Mat>;

/// Where small images differ from their median, one image for each.
SmallImages activity_of(const FootageExamination& camera) {
  SmallImages active;
  if (camera.small.size() < kMinImages) return active;
  cv::Mat background(camera.small[0].size(), CV_8UC1);
  for (int y = 0; y < background.rows; ++y)
    for (int x = 0; x < background.cols; ++x) {
      std::vector<double> values;
      for (const cv::Mat& image : camera.small) values.push_back(image.at<std::uint8_t>(y, x));
      background.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(median(values));
    }
  for (const cv::Mat& image : camera.small) {
    cv::Mat difference;
    cv::absdiff(image, background, difference);
    cv::threshold(difference, difference, kActiveDifference, 255, cv::THRESH_BINARY);
    active.push_back(difference);
  }
  return active;
}

SmallImages flipped(const SmallImages& images, int code) {
  SmallImages result(images.size());
  for (std::size_t i = 0; i < images.size(); ++i) cv::flip(images[i], result[i], code);
  return result;
}

/// Activity on the limbs, against activity beside them.
struct ActivityMatch {
  /// (inside - outside) / (inside + outside) of the share of active pixels; NaN: nothing moves, or nobody is seen
  double contrast = std::numeric_limits<double>::quiet_NaN();
  double images_on = 0.0;   ///< share of the images in which enough pixels on the limbs are active
  double images_all = 0.0;  ///< share in which as many pixels are active anywhere
  double active = 0.0;      ///< share of the pixels

  /// Whether the person may be where the limbs are.
  bool may_be_good() const { return contrast >= kGoodContrast && images_on >= kShareOfImages; }
  /// Whether much moves, and neither the camera nor the light.
  bool is_known() const { return images_all >= kShareOfImages && active <= kMaxActiveShare; }
};

/// @param limbs one image for each of `active`; empty ones: nobody is seen
ActivityMatch match_of(const SmallImages& active, const SmallImages& limbs) {
  double inside = 0.0, outside = 0.0, inside_area = 0.0, outside_area = 0.0, seen = 0.0;
  ActivityMatch match;
  for (std::size_t i = 0; i < active.size(); ++i) {
    if (limbs[i].empty()) continue;
    const double area = cv::countNonZero(limbs[i]), on = cv::countNonZero(active[i] & limbs[i]),
                 all = cv::countNonZero(active[i]);
    if (area == 0.0) continue;
    inside += on;
    outside += all - on;
    inside_area += area;
    outside_area += static_cast<double>(limbs[i].total()) - area;
    match.images_on += on >= kActiveShare * area;
    match.images_all += all >= kActiveShare * area;
    ++seen;
  }
  if (inside_area == 0.0 || outside_area == 0.0 || inside + outside == 0.0) return match;
  const double a = inside / inside_area, b = outside / outside_area;
  match.contrast = (a - b) / (a + b);
  match.images_on /= seen;
  match.images_all /= seen;
  match.active = (inside + outside) / (inside_area + outside_area);
  return match;
}

/// Images moved by whole pixels; what comes in is empty.
SmallImages moved(const SmallImages& images, int dx, int dy) {
  SmallImages result;
  for (const cv::Mat& image : images) {
    cv::Mat& to = result.emplace_back();
    if (image.empty()) continue;
    to = cv::Mat::zeros(image.size(), CV_8UC1);
    const cv::Rect whole({}, image.size()), inside = (whole + cv::Point(dx, dy)) & whole;
    if (!inside.empty()) image(inside - cv::Point(dx, dy)).copyTo(to(inside));
  }
  return result;
}

double pixels_of(const SmallImages& images) {
  double pixels = 0.0;
  for (const cv::Mat& image : images) pixels += image.empty() ? 0 : cv::countNonZero(image);
  return pixels;
}

/// The median diagonal of the limbs, pixels.
double size_of(const SmallImages& limbs) {
  std::vector<double> sizes;
  for (const cv::Mat& image : limbs)
    if (!image.empty())
      if (const cv::Rect box = cv::boundingRect(image); !box.empty())
        sizes.push_back(std::hypot(box.width, box.height));
  return sizes.empty() ? 0.0 : median(sizes);
}

/// The largest contrast of the limbs at other positions in the image. If they are where the person is, it is none that
/// is larger than theirs.
double contrast_elsewhere(const SmallImages& active, const SmallImages& limbs) {
  const double step = std::max(2.0, kStepAside * size_of(limbs)), all = pixels_of(limbs);
  double best = -1.0;
  for (int y = -kStepsAside; y <= kStepsAside; ++y)
    for (int x = -kStepsAside; x <= kStepsAside; ++x) {
      if (std::max(std::abs(x), std::abs(y)) <= kNearSteps) continue;
      const SmallImages there = moved(limbs, static_cast<int>(x * step), static_cast<int>(y * step));
      if (pixels_of(there) < 0.5 * all) continue;
      if (const double contrast = match_of(active, there).contrast; contrast > best) best = contrast;
    }
  return best;
}

/// Whether the person is where the limbs are.
bool is_good(const ActivityMatch& match, const SmallImages& active, const SmallImages& limbs) {
  return match.may_be_good() && contrast_elsewhere(active, limbs) <= match.contrast + kPerhapsElsewhere;
}

/// Whether much moves, but hardly more where the limbs are than elsewhere, or as the limbs do at another position.
bool is_rejected(const ActivityMatch& match, const SmallImages& active, const SmallImages& limbs) {
  return match.is_known() &&
         (match.contrast < kRejected || contrast_elsewhere(active, limbs) > match.contrast + kClearlyElsewhere);
}

/// Whether the limbs move: pixels of theirs lie clearly beside those that are limbs in half of the images.
bool limbs_move(const SmallImages& limbs) {
  cv::Mat count;
  int seen = 0;
  for (const cv::Mat& image : limbs) {
    if (image.empty()) continue;
    if (count.empty()) count = cv::Mat::zeros(image.size(), CV_32FC1);
    cv::accumulate(image, count);
    ++seen;
  }
  if (seen == 0) return false;
  cv::Mat usual = count >= 0.5 * 255.0 * seen;
  cv::dilate(usual, usual, cv::getStructuringElement(cv::MORPH_ELLIPSE, {kJitter, kJitter}));
  double moving = 0.0, all = 0.0;
  for (const cv::Mat& image : limbs) {
    if (image.empty()) continue;
    moving += cv::countNonZero(image & ~usual);
    all += cv::countNonZero(image);
  }
  return all > 0.0 && moving >= kMovingShare * all;
}

class ActivityJudge {
 public:
  ActivityJudge(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage,
                std::vector<Finding>& findings)
      : seen_(seen), rig_(rig), footage_(footage), findings_(findings), cameras_(footage.size()) {}

  bool judge() {
    for (const FootageExamination& camera : footage_) active_.push_back(activity_of(camera));
    matches_.assign(cameras_, std::vector<ActivityMatch>(cameras_));
    for (std::size_t video = 0; video < cameras_; ++video)
      for (std::size_t keypoints = 0; keypoints < cameras_; ++keypoints)
        matches_[video][keypoints] = compare(video, keypoints);
    find_exchanges();
    for (std::size_t c = 0; c < cameras_; ++c) flips_.push_back(is_exchanged(c) ? std::nullopt : best_flip(c));
    if (are_of_other_footage()) return false;
    for (const auto& [a, b] : exchanges_) add_exchange(a, b);
    for (std::size_t c = 0; c < cameras_; ++c)
      if (flips_[c]) add_flip(c, *flips_[c]);
    return true;
  }

  /// The mean contrast of the cameras, with the limbs of `shift` rows later.
  double contrast_of_shift(int shift) {
    for (const FootageExamination& camera : footage_) active_.push_back(activity_of(camera));
    double sum = 0.0;
    int count = 0;
    for (std::size_t c = 0; c < cameras_; ++c) {
      const ActivityMatch match = match_of(active_[c], limbs_in(c, c, shift));
      if (!std::isfinite(match.contrast)) continue;
      sum += match.contrast;
      ++count;
    }
    return count == 0 ? std::numeric_limits<double>::quiet_NaN() : sum / count;
  }

  /// Whether what moves in the videos of two cameras is where the keypoints of each other are.
  bool videos_fit_other_keypoints(std::size_t a, std::size_t b) {
    for (const FootageExamination& camera : footage_) active_.push_back(activity_of(camera));
    for (const auto& [video, other] : {std::pair(a, b), std::pair(b, a)}) {
      const SmallImages limbs = limbs_in(video, other);
      const ActivityMatch match = match_of(active_[video], limbs),
                          own = match_of(active_[video], limbs_in(video, video));
      if (!(match.contrast - own.contrast > kClearGain) || !is_good(match, active_[video], limbs)) return false;
    }
    return true;
  }

 private:
  struct Flip {
    const char* fault;
    const char* words;
    double contrast;
  };

  void add(std::size_t camera, const char* fault, std::string figure, std::string advice) {
    findings_.push_back({name(camera), fault, Severity::fault, std::move(figure), std::move(advice)});
  }
  const std::string& name(std::size_t camera) const { return seen_.cameras[camera].name; }

  /// The limbs of the person in a small image, as one camera's keypoints say; empty without a person.
  cv::Mat limbs_of(std::size_t keypoints, int instant, cv::Size size) const {
    const auto& people = seen_.people[keypoints][instant];
    const int index = rig_ ? rig_->person[keypoints][instant] : (people.empty() ? -1 : 0);
    if (index < 0) return {};
    const Camera& camera = seen_.cameras[keypoints];
    const double sx = static_cast<double>(size.width) / camera.width,
                 sy = static_cast<double>(size.height) / camera.height;
    cv::Mat limbs = cv::Mat::zeros(size, CV_8UC1);
    const SeenPerson& person = people[index];
    const auto at = [&](int k) {
      const Eigen::Vector2d& pixel = person[k].pixel;
      return cv::Point(static_cast<int>(pixel.x() * sx), static_cast<int>(pixel.y() * sy));
    };
    for (const auto& [a, b] : seen_.bones)
      if (person[a].seen && person[b].seen)
        cv::line(limbs, at(a), at(b), 255, std::max(3, static_cast<int>(kLimbWidth * seen_.size[keypoints] * sx)));
    return limbs;
  }

  /// The limbs in the images of a video, as the keypoints of a camera say; of `shift` rows later.
  SmallImages limbs_in(std::size_t video, std::size_t keypoints, int shift = 0) const {
    SmallImages limbs;
    for (std::size_t i = 0; i < active_[video].size(); ++i) {
      const int here = footage_[video].small_instants[i], there = here + shift;
      const bool known = there >= 0 && there < seen_.num_instants() &&
                         seen_.instants[there].sequence == seen_.instants[here].sequence &&
                         seen_.instants[there].row == seen_.instants[here].row + shift;
      limbs.push_back(known ? limbs_of(keypoints, there, active_[video][i].size()) : cv::Mat());
    }
    return limbs;
  }

  ActivityMatch compare(std::size_t video, std::size_t keypoints) const {
    if (active_[video].empty() || (rig_ && (rig_->faulty[video] || rig_->faulty[keypoints]))) return {};
    const SmallImages limbs = limbs_in(video, keypoints);
    return limbs_move(limbs) ? match_of(active_[video], limbs) : ActivityMatch();
  }

  bool is_exchanged(std::size_t camera) const {
    return std::any_of(exchanges_.begin(), exchanges_.end(),
                       [&](const auto& pair) { return pair.first == camera || pair.second == camera; });
  }

  void find_exchanges() {
    for (std::size_t a = 0; a < cameras_; ++a)
      for (std::size_t b = a + 1; b < cameras_; ++b) {
        const ActivityMatch &first = matches_[a][b], &second = matches_[b][a];
        const double gain =
            std::min(first.contrast - matches_[a][a].contrast, second.contrast - matches_[b][b].contrast);
        if (gain > kClearGain && is_good(first, active_[a], limbs_in(a, b)) &&
            is_good(second, active_[b], limbs_in(b, a)))
          exchanges_.emplace_back(a, b);
      }
  }

  /// How a video would have to be turned for its keypoints, if that is clearly better and good.
  std::optional<Flip> best_flip(std::size_t c) const {
    if (!std::isfinite(matches_[c][c].contrast)) return std::nullopt;
    double best = matches_[c][c].contrast + 2.0 * kClearGain;
    std::optional<Flip> found;
    for (const auto& [code, fault, words] : {std::tuple(1, faults::kMirrored, "mirrored left to right"),
                                             std::tuple(0, faults::kMirrored, "mirrored top to bottom"),
                                             std::tuple(-1, faults::kUpsideDown, "turned by 180 degrees")}) {
      const SmallImages active = flipped(active_[c], code), limbs = limbs_in(c, c);
      const ActivityMatch match = match_of(active, limbs);
      if (!(match.contrast > best) || !is_good(match, active, limbs)) continue;
      best = match.contrast;
      found = Flip{fault, words, best};
    }
    return found;
  }

  /// Keypoints that agree in all cameras are of one body in space. If half of the videos do not show it there, and no
  /// other order or turn of them does, it is another body.
  bool are_of_other_footage() {
    std::vector<std::string> rejecting;
    std::size_t known = 0;
    for (std::size_t c = 0; c < cameras_; ++c) {
      known += std::isfinite(matches_[c][c].contrast);
      if (!flips_[c] && !is_exchanged(c) && is_rejected(matches_[c][c], active_[c], limbs_in(c, c)))
        rejecting.push_back(fmt::format("{} {:.2f}", name(c), matches_[c][c].contrast));
    }
    if (rejecting.empty() || 2 * rejecting.size() < known || (cameras_ > 1 && rejecting.size() < 2)) return false;
    findings_.push_back(
        {"", faults::kWrongKeypoints, Severity::fault,
         fmt::format("the keypoints are not of this footage: what moves is not where they are (contrast of "
                     "camera {})",
                     fmt::join(rejecting, ", ")),
         "The keypoints are of another take, of another person, or of videos in another order. Run the detector on "
         "these videos, or correct `keypoints` or `videos` in capture.yaml. Nothing else was compared with these "
         "keypoints."});
    return true;
  }

  void add_exchange(std::size_t a, std::size_t b) {
    for (const auto& [one, other] : {std::pair(a, b), std::pair(b, a)})
      add(one, faults::kSwapped,
          fmt::format("what moves in its video is where the keypoints of camera {} are (contrast {:.2f}, with its "
                      "own {:.2f})",
                      name(other), matches_[one][other].contrast, matches_[one][one].contrast),
          fmt::format("The videos of cameras {} and {} are exchanged. Exchange them in capture.yaml.", name(one),
                      name(other)));
  }

  void add_flip(std::size_t c, const Flip& flip) {
    add(c, flip.fault,
        fmt::format(
            "what moves in its video is not where the keypoints are (contrast {:.2f}, {:.2f} after the correction)",
            matches_[c][c].contrast, flip.contrast),
        fmt::format("The video is {} against the keypoints. Flip it back.", flip.words));
  }

  const Sightings& seen_;
  const RigExamination* rig_;
  const SequenceFootage& footage_;
  std::vector<Finding>& findings_;
  std::size_t cameras_;
  std::vector<SmallImages> active_;                  ///< [C] of the videos
  std::vector<std::vector<ActivityMatch>> matches_;  ///< [video][keypoints]
  std::vector<std::pair<std::size_t, std::size_t>> exchanges_;
  std::vector<std::optional<Flip>> flips_;  ///< [C]
};

/// The median of a measure over the images of a camera in all sequences; -1: not known.
template <typename Measure>
double usual_of_camera(const std::vector<SequenceFootage>& footage, std::size_t camera, const Measure& measure) {
  std::vector<double> values;
  for (const SequenceFootage& sequence : footage)
    for (const ImageFacts& facts : sequence[camera].images)
      if (const double value = measure(facts); value >= 0.0) values.push_back(value);
  return values.empty() ? -1.0 : median(values);
}

/// Whether the masks of a camera show the body as the calibrated camera sees it, and not where its keypoints are;
/// nothing without masks.
std::optional<bool> masks_are_its_own(const std::vector<SequenceFootage>& footage, std::size_t camera) {
  const double body = usual_of_camera(footage, camera, [](const ImageFacts&f) { return f.calibrated_on_mask; }),
               points = usual_of_camera(footage, camera, [](const ImageFacts&f) { return f.points_on_mask; });
  if (body < 0.0 || points < 0.0) return std::nullopt;
  return body >= kBodyOnOwnMask && body > points + kOnMaskGain;
}

/// @return nothing where neither masks nor what moves decide it
std::optional<bool> only_keypoints_are_exchanged(const Sightings& seen, const RigExamination& rig,
                                                 const std::vector<SequenceFootage>& footage, std::size_t a,
                                                 std::size_t b) {
  const std::optional<bool> first = masks_are_its_own(footage, a), second = masks_are_its_own(footage, b);
  if (first && second) return *first && *second;
  const bool moves = std::any_of(footage.begin(), footage.end(), [&](const SequenceFootage& sequence) {
    std::vector<Finding> none;
    return ActivityJudge(seen, &rig, sequence, none).videos_fit_other_keypoints(a, b);
  });
  return moves ? std::optional<bool>(true) : std::nullopt;
}

/// @param only_keypoints are exchanged; nothing: it is not known
void say_what_is_exchanged(const std::string& camera, const std::string& other, std::optional<bool> only_keypoints,
                           std::vector<Finding>& findings) {
  for (Finding& finding : findings) {
    if (finding.camera != camera || finding.fault != faults::kSwapped) continue;
    if (!only_keypoints)
      finding.advice += " Look at the images first: if these are right, exchange the keypoint files alone.";
    else if (*only_keypoints)
      finding.advice = fmt::format(
          "Only the keypoint files of {} and {} are exchanged: their footage is their own. Exchange them under "
          "`keypoints` in capture.yaml, and leave videos, masks and calibrations as they are.",
          camera, other);
  }
}

/// Measures a camera by the body that the cameras agree on, instead of by its keypoints.
void forget_keypoints_of(std::size_t camera, std::vector<SequenceFootage>& footage) {
  for (SequenceFootage& sequence : footage) {
    sequence[camera].shifted_bones.clear();
    for (ImageFacts& facts : sequence[camera].images) {
      facts.body_on_mask = facts.calibrated_on_mask;
      facts.points_on_mask = facts.bones_on_mask = -1.0;
      facts.has_margins = false;
    }
  }
}

}  // namespace

void settle_exchanges(const Sightings& seen, RigExamination& rig, std::vector<SequenceFootage>& footage,
                      std::vector<Finding>& findings) {
  for (const auto& [a, b] : rig.exchanged) {
    const auto only_keypoints = only_keypoints_are_exchanged(seen, rig, footage, as_size(a), as_size(b));
    say_what_is_exchanged(seen.cameras[a].name, seen.cameras[b].name, only_keypoints, findings);
    say_what_is_exchanged(seen.cameras[b].name, seen.cameras[a].name, only_keypoints, findings);
    if (!only_keypoints.value_or(false)) continue;
    for (const int c : {a, b}) {
      forget_keypoints_of(as_size(c), footage);
      rig.views[c] = SupposedView();
      rig.views[c].camera = seen.cameras[c];
    }
  }
}

double contrast_of_shift(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage, int shift) {
  std::vector<Finding> none;
  return ActivityJudge(seen, rig, footage, none).contrast_of_shift(shift);
}

bool examine_activity(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage,
                      std::vector<Finding>& findings) {
  return ActivityJudge(seen, rig, footage, findings).judge();
}

}  // namespace doppel
