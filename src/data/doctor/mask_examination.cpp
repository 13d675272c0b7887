#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "doppel/data/doctor/image_examination.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

constexpr double kOnMaskWarning = 0.95, kOnMaskFault = 0.85;  ///< share of the points, median, if others have more
constexpr double kOnMaskBad = 0.7;                            ///< the same, whatever others have
constexpr double kBelowOthers = 0.04;                         ///< by which it must lie below the other cameras
constexpr double kMarginWarning = 0.06, kMarginFault = 0.1;   ///< sizes of the person, against the other cameras
constexpr double kSideways = 0.5;  ///< weight of the margins left and right, which depend on the pose
constexpr double kMaskSpread = 4.0;
constexpr double kFlickerShare = 0.04;                          ///< of the mask's area: more is flicker
constexpr double kFlickerTimes = 3.0;                           ///< of what the other cameras have in the same frames
constexpr double kFlickerWarning = 0.04, kFlickerFault = 0.12;  ///< share of the frames
constexpr int kMinFlickers = 4;                                 ///< of a fault; fewer may be one incident
constexpr double kBonesWarning = 0.9, kBonesFault = 0.8;        ///< share of the bones' length on the mask
constexpr double kBorderWarning = 0.1;                          ///< share of the frames
constexpr double kEmptyWarning = 0.03, kEmptyFault = 0.2;
constexpr double kEmptyArea = 2e-4;  ///< share of the image
constexpr double kFullArea = 0.9;

const double kNoValue = std::numeric_limits<double>::quiet_NaN();

class MaskJudge {
 public:
  MaskJudge(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage,
            std::vector<Finding>& findings)
      : seen_(seen), rig_(rig), footage_(footage), findings_(findings) {}

  void judge() {
    for (std::size_t c = 0; c < footage_.size(); ++c) {
      if (footage_[c].mask_error == "none") continue;
      if (!footage_[c].mask_error.empty())
        add(c, faults::kUnreadable, Severity::fault, "its masks cannot be read",
            footage_[c].mask_error + ". Make the masks again, or correct `masks` in capture.yaml.");
      if (share(c, [](const ImageFacts& f) { return f.mask_area >= 0.0; }) == 0.0) continue;
      if (above_all(c) || wrong(c)) continue;
      margins(c);
      flicker(c);
      holes(c);
      border(c);
    }
  }

 private:
  void add(std::size_t camera, const char* fault, Severity severity, std::string figure, std::string advice) {
    findings_.push_back({seen_.cameras[camera].name, fault, severity, std::move(figure), std::move(advice)});
  }

  template <typename Test>
  double share(std::size_t c, const Test& test) const {
    int yes = 0, all = 0;
    for (const ImageFacts& facts : footage_[c].images) {
      all += facts.mask_area >= 0.0;
      yes += facts.mask_area >= 0.0 && test(facts);
    }
    return all == 0 ? 0.0 : static_cast<double>(yes) / all;
  }

  /// [C] the median of a measure that is negative where it is not known.
  template <typename Measure>
  std::vector<double> usual_measure(const Measure& measure) const {
    std::vector<double> result;
    for (const FootageExamination& camera : footage_) {
      std::vector<double> values;
      for (const ImageFacts& facts : camera.images)
        if (const double value = measure(facts); value >= 0.0) values.push_back(value);
      result.push_back(values.empty() ? kNoValue : median(values));
    }
    return result;
  }

  /// The masks show something, but nothing that reaches the threshold.
  bool above_all(std::size_t c) {
    const auto& values = footage_[c].mask_values;
    const int threshold = footage_[c].mask_threshold;
    if (!values || values->lowest() == values->highest() || values->highest() >= threshold) return false;
    add(c, faults::kWrongMasks, Severity::fault,
        fmt::format("its masks have the values {}, and mask_threshold is {}: all of them are empty",
                    values->to_string(), threshold),
        fmt::format("The masks hold labels, or are dim. Set `mask_threshold: {}` for this sequence in capture.yaml.",
                    values->needed_threshold().value_or(values->lowest() + 1)));
    return true;
  }

  /// What explains masks without parts of the person.
  std::string about_labels(std::size_t c) const {
    const auto& values = footage_[c].mask_values;
    if (!values || !values->has_dark_labels() || footage_[c].mask_threshold <= values->lowest() + 1) return "";
    return fmt::format(
        " These masks have the values {}: if those below mask_threshold ({}) are the person too, set `mask_threshold: "
        "{}`.",
        values->to_string(), footage_[c].mask_threshold, values->lowest() + 1);
  }

  /// Empty, full or elsewhere. Where keypoints and projected body disagree, one of them is on a right mask.
  bool wrong(std::size_t c) {
    const double empty = share(c, [](const ImageFacts& f) { return f.mask_area < kEmptyArea; });
    const double full = share(c, [](const ImageFacts& f) { return f.mask_area > kFullArea; });
    const std::string advice =
        "Make the masks of this camera again: they may be those of another camera, of other frames or of another size, "
        "or black and white may be exchanged." +
        about_labels(c);
    if (empty > kEmptyWarning && empty < 0.9 && person_is_there(c)) {
      add(c, faults::kMaskFlicker, empty > kEmptyFault ? Severity::fault : Severity::warning,
          fmt::format("its masks are empty in {:.0f} % of the frames in which the person is seen", 100.0 * empty),
          advice);
      return true;
    }
    if (empty >= 0.9 || full > 0.5) {
      add(c, faults::kWrongMasks, Severity::fault,
          fmt::format("its masks are {} in {:.0f} % of the frames", empty >= 0.9 ? "empty" : "full",
                      100.0 * std::max(empty, full)),
          advice);
      return true;
    }
    const std::vector<double> points = usual_measure([](const ImageFacts&f) { return f.points_on_mask; }),
                              body = usual_measure([](const ImageFacts&f) { return f.body_on_mask; });
    const double on = std::max(std::isfinite(points[c]) ? points[c] : -1.0, std::isfinite(body[c]) ? body[c] : -1.0);
    if (on < 0.0 || on >= kOnMaskWarning) return false;
    const AgainstOthers against = against_others(std::isfinite(points[c]) ? points : body, c);
    if (against.others > 0 && against.difference > -kBelowOthers && on > kOnMaskBad) return false;
    add(c, faults::kWrongMasks, on < kOnMaskFault ? Severity::fault : Severity::warning,
        fmt::format("{:.0f} % of the person's keypoints lie on its masks", 100.0 * on), advice);
    return true;
  }

  bool person_is_there(std::size_t c) const {
    int there = 0, all = 0;
    for (const ImageFacts& facts : footage_[c].images) {
      all += facts.mask_area >= 0.0 && facts.mask_area < kEmptyArea;
      there += facts.mask_area >= 0.0 && facts.mask_area < kEmptyArea &&
               (facts.points_on_mask >= 0.0 || facts.body_on_mask >= 0.0);
    }
    return 2 * there > all;
  }

  /// The box of a mask around that of the keypoints: the same in all cameras, because clothes and hair are.
  void margins(std::size_t c) {
    if (rig_ && rig_->faulty[c]) return;
    double largest = 0.0;
    std::size_t side = 0;
    for (std::size_t s = 0; s < 4; ++s) {
      std::vector<double> values;
      for (const FootageExamination& camera : footage_) {
        std::vector<double> of;
        for (const ImageFacts& facts : camera.images)
          if (facts.has_margins) of.push_back(facts.margins[s]);
        values.push_back(of.size() < 3 ? kNoValue : median(of));
      }
      const AgainstOthers against = against_others(values, c);
      if (against.others < 2 || std::abs(against.difference) < kMaskSpread * against.spread) continue;
      const double difference = (s % 2 == 0 ? kSideways : 1.0) * against.difference;
      if (std::abs(difference) <= std::abs(largest)) continue;
      largest = difference;
      side = s;
    }
    if (std::abs(largest) < kMarginWarning) return;
    static constexpr std::array<const char*, 4> kSides{"left", "top", "right", "bottom"};
    add(c, faults::kWrongMasks, std::abs(largest) > kMarginFault ? Severity::fault : Severity::warning,
        fmt::format("its masks reach {:.0f} % of the person's size {} at the {} than those of the other cameras",
                    100.0 * std::abs(largest) / (side % 2 == 0 ? kSideways : 1.0),
                    largest > 0.0 ? "further" : "less far", kSides[side]),
        "Make the masks of this camera again: they are of another size, shifted, or contain a shadow or another "
        "object.");
  }

  void flicker(std::size_t c) {
    int flickers = 0, all = 0;
    std::vector<double> values;
    for (const ImageFacts& facts : footage_[c].images) {
      if (facts.flicker < 0.0) continue;
      ++all;
      values.push_back(facts.flicker);
      flickers += facts.flicker > std::max(kFlickerShare, kFlickerTimes * flicker_of_others(c, facts.row));
    }
    if (all < 3 || flickers < 2 || flickers < kFlickerWarning * all) return;
    const bool fault = flickers >= kMinFlickers && flickers > kFlickerFault * all;
    add(c, faults::kMaskFlicker, fault ? Severity::fault : Severity::warning,
        fmt::format("its masks flicker in {:.0f} % of the frames: {:.0f} % of the area changes for one frame",
                    100.0 * flickers / all, 100.0 * quantile(values, 0.9)),
        "Make the masks of this camera again with a steadier method, or with `largest_component: true`.");
  }

  double flicker_of_others(std::size_t c, long row) const {
    std::vector<double> values;
    for (std::size_t o = 0; o < footage_.size(); ++o) {
      if (o == c) continue;
      const auto& images = footage_[o].images;
      const auto found = std::lower_bound(images.begin(), images.end(), row,
                                          [](const ImageFacts& facts, long wanted) { return facts.row < wanted; });
      if (found != images.end() && found->row == row && found->flicker >= 0.0) values.push_back(found->flicker);
    }
    return median(values);
  }

  void holes(std::size_t c) {
    if (rig_ && rig_->faulty[c]) return;
    const std::vector<double> bones = usual_measure([](const ImageFacts& f) { return f.bones_on_mask; });
    if (!std::isfinite(bones[c]) || bones[c] >= kBonesWarning) return;
    const AgainstOthers against = against_others(bones, c);
    if (against.others > 0 && against.difference > -kBelowOthers && bones[c] > kBonesFault) return;
    add(c, faults::kMaskHoles, bones[c] < kBonesFault ? Severity::fault : Severity::warning,
        fmt::format("{:.0f} % of the limbs between the keypoints lie on its masks", 100.0 * bones[c]),
        "The masks have holes or lack limbs. Make them again, with other settings of the key or by another method." +
            about_labels(c));
  }

  void border(std::size_t c) {
    const double at_border = share(c, [](const ImageFacts& f) { return f.mask_at_border; });
    if (at_border < kBorderWarning) return;
    add(c, faults::kMaskBorder, Severity::note,
        fmt::format("its masks touch the border of the image in {:.0f} % of the frames", 100.0 * at_border),
        "A body that is cut off there is worth less for training. Aim the camera better, or zoom out.");
  }

  const Sightings& seen_;
  const RigExamination* rig_;
  const SequenceFootage& footage_;
  std::vector<Finding>& findings_;
};

}  // namespace

void examine_masks(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                   std::vector<Finding>& findings) {
  for (const SequenceFootage& sequence : footage) MaskJudge(seen, rig, sequence, findings).judge();
}

}  // namespace doppel
