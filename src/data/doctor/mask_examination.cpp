#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>

#include "doppel/data/doctor/activity_examination.h"
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
constexpr double kShiftGain = 0.05;     ///< share of the bones that keypoints of other rows must bring on the masks
constexpr double kBorderWarning = 0.1;  ///< share of the frames
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

/// Keypoints and masks of a sequence that are of different times.
class TimeJudge {
 public:
  /// @param found of the masks of this sequence
  TimeJudge(const Sightings& seen, const RigExamination* rig, const SequenceFootage& footage,
            const std::vector<Finding>& found)
      : seen_(seen), rig_(rig), footage_(footage) {
    for (std::size_t c = 0; c < footage.size(); ++c)
      if (!footage[c].shifted_bones.empty() && footage[c].bones_at(0).count > 0) cameras_.push_back(c);
    const auto fails = std::count_if(cameras_.begin(), cameras_.end(), [&](std::size_t c) {
      return std::any_of(found.begin(), found.end(),
                         [&](const Finding& finding) { return is_of_masks(finding, seen_.cameras[c].name); });
    });
    most_fail_ = 2 * static_cast<std::size_t>(fails) > cameras_.size();
  }

  static bool is_of_masks(const Finding& finding, const std::string& camera) {
    return finding.camera == camera && (finding.fault == faults::kWrongMasks || finding.fault == faults::kMaskHoles);
  }
  /// Whether the masks of most cameras are not where the keypoints are.
  bool most_fail() const { return most_fail_; }

  /// The rows by which the keypoints that are on the masks are later; nothing if no time mends most cameras.
  std::optional<int> shift() const {
    const double before = bones_on_masks(0).value_or(1.0);
    double most = std::max(kBonesWarning, before + kShiftGain);
    std::optional<int> best;
    for (int shift = -kMaxKeypointShift; shift <= kMaxKeypointShift; ++shift)
      if (const auto on = bones_on_masks(shift); on && *on > most) {
        most = *on;
        best = shift;
      }
    return best;
  }

  /// Whether the sequence is too short to say anything about a shift.
  bool cannot_tell(int shift) const { return !bones_on_masks(shift).has_value(); }

  /// Whether the videos agree with the keypoints as they are, and the masks are those that are off. Masks that are
  /// computed from the images cannot be.
  bool masks_are_off(int shift) const {
    const bool files = std::any_of(footage_.begin(), footage_.end(),
                                   [](const FootageExamination& camera) { return camera.mask_values.has_value(); });
    return files && contrast_of_shift(seen_, rig_, footage_, 0) > contrast_of_shift(seen_, rig_, footage_, shift);
  }

  bool is_mended(std::size_t c, int shift) const {
    return !footage_[c].shifted_bones.empty() && footage_[c].bones_at(shift).count > 0 &&
           footage_[c].bones_at(shift).mean() >= kBonesFault;
  }

 private:
  /// The mean over the cameras of the limbs on the masks; nothing if a camera has too few images with such keypoints.
  std::optional<double> bones_on_masks(int shift) const {
    double sum = 0.0;
    for (const std::size_t c : cameras_) {
      if (2 * footage_[c].bones_at(shift).count < footage_[c].bones_at(0).count) return std::nullopt;
      sum += footage_[c].bones_at(shift).mean();
    }
    if (cameras_.empty()) return std::nullopt;
    return sum / static_cast<double>(cameras_.size());
  }

  const Sightings& seen_;
  const RigExamination* rig_;
  const SequenceFootage& footage_;
  std::vector<std::size_t> cameras_;  ///< with masks and keypoints
  bool most_fail_ = false;
};

/// `{"0": 3, ...}` with the numbers that mend a shift of the keypoints (or of the masks) of a sequence.
std::string offsets_text(const Sightings& seen, std::size_t sequence, int shift, bool masks) {
  std::vector<std::string> cameras;
  for (std::size_t c = 0; c < seen.cameras.size(); ++c) {
    const StatedTimes& times = seen.times[sequence][c];
    // The mask of a row fits the keypoints that are now `shift` rows later, so the files must be taken from there.
    const long frames = std::lround(shift * times.clock.rate);
    const long offset = masks ? times.mask_offset - frames : times.keypoint_offset + frames;
    cameras.push_back(fmt::format("\"{}\": {}", seen.cameras[c].name, offset));
  }
  return fmt::format("{{{}}}", fmt::join(cameras, ", "));
}

/// One finding for the sequences whose keypoints and masks are `shift` rows apart.
Finding finding_of_times(const Sightings& seen, const std::vector<std::size_t>& sequences, int shift, bool masks) {
  std::map<std::string, std::vector<std::string>> names;  // by the offsets
  for (const std::size_t s : sequences) names[offsets_text(seen, s, shift, masks)].push_back(seen.sequences[s]);
  std::vector<std::string> offsets;
  for (const auto& [text, of] : names)
    offsets.push_back(
        fmt::format("`{}: {}` for {}", masks ? "mask_offset" : "keypoint_offset", text, fmt::join(of, ", ")));
  const int rows = std::abs(shift);
  return {"", masks ? faults::kWrongMasks : faults::kWrongKeypoints, Severity::fault,
          fmt::format("the {} of all cameras are {} row{} {} the {}", masks ? "masks" : "keypoints", rows,
                      rows == 1 ? "" : "s", (shift < 0) != masks ? "later than" : "earlier than",
                      masks ? "keypoints and videos" : "masks and videos"),
          fmt::format("The numbers in the files are not those of the video's frames. Set {} in capture.yaml.",
                      fmt::join(offsets, ", and "))};
}

/// Where keypoints and masks are of different times, what was found of the masks is one fault of all cameras.
/// @param found [sequences] of the masks
void judge_times(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                 std::vector<std::vector<Finding>>& found, std::vector<Finding>& findings) {
  std::map<std::pair<int, bool>, std::vector<std::size_t>> sequences;  // by shift, and whether masks are off
  std::vector<TimeJudge> judges;
  for (std::size_t s = 0; s < footage.size(); ++s) {
    judges.emplace_back(seen, rig, footage[s], found[s]);
    if (!judges[s].most_fail()) continue;
    if (const auto shift = judges[s].shift()) sequences[{*shift, judges[s].masks_are_off(*shift)}].push_back(s);
  }
  // A sequence that is too short for a shift is taken to have that of the others.
  for (std::size_t s = 0; s < footage.size() && sequences.size() == 1; ++s)
    if (const int usual = sequences.begin()->first.first;
        judges[s].most_fail() && !judges[s].shift() && judges[s].cannot_tell(usual))
      sequences.begin()->second.push_back(s);
  for (const auto& [what, of] : sequences) {
    findings.push_back(finding_of_times(seen, of, what.first, what.second));
    for (const std::size_t s : of)
      for (std::size_t c = 0; c < footage[s].size(); ++c)
        if (judges[s].is_mended(c, what.first))
          std::erase_if(found[s],
                        [&](const Finding& finding) { return TimeJudge::is_of_masks(finding, seen.cameras[c].name); });
  }
}

}  // namespace

void examine_masks(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                   std::vector<Finding>& findings) {
  std::vector<std::vector<Finding>> found(footage.size());
  for (std::size_t s = 0; s < footage.size(); ++s) MaskJudge(seen, rig, footage[s], found[s]).judge();
  judge_times(seen, rig, footage, found, findings);
  for (std::vector<Finding>& of : found) std::move(of.begin(), of.end(), std::back_inserter(findings));
}

}  // namespace doppel
