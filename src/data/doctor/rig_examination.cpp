#include "doppel/data/doctor/rig_examination.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <optional>

#include "doppel/data/doctor/explanation.h"
#include "doppel/data/doctor/statistics.h"
#include "doppel/data/doctor/view_fit.h"

namespace doppel {

namespace {

constexpr double kSuspectRatio = 1.35;     ///< of residual to expectation: worth trying explanations
constexpr double kFaultRatio = 1.7;        ///< the same: an explained camera is faulty
constexpr double kStandsOut = 1.4;         ///< and times the largest ratio among the cameras that agree
constexpr double kUnexplainedRatio = 3.0;  ///< the same: faulty without any explanation
constexpr double kBadWindowRatio = 2.2;    ///< the same for the median of one window
constexpr double kMinShare = 0.004;        ///< of the person's size: less is no fault
constexpr double kExplains = 0.65;         ///< share of the residual that an explanation may leave
constexpr int kManyParameters = 3;
constexpr double kTakesMost = 0.35;    ///< share of the residual that is left by an explanation that is not near
constexpr double kNearExpected = 4.0;  ///< of the expectation, within these shares of the person's size
constexpr double kNearShare = 0.04, kFarShare = 0.05;
constexpr double kExactExplains = 0.2, kMaxRemainder = 0.05;  ///< of the residual; of the person's size
constexpr double kTimeGain = 0.7;                             ///< ratio of what a changing and a constant offset leave
constexpr double kNoHarm = 1.3;                               ///< ratio of residuals with and without an explanation
constexpr double kWholeRigExplains = 0.5;                     ///< the same for an explanation of all cameras
constexpr double kOtherPerson = 0.06;       ///< share of the person's size: a larger residual is another person
constexpr double kMinShareOfWindows = 0.8;  ///< share of the windows: the fault holds all the time
constexpr double kMinWindows = 0.08;
constexpr double kDoubtfulQuality = 0.008;  ///< share of the person's size: mistakes with all cameras are tried
constexpr int kMaxCamerasTriedAlone = 4;
constexpr double kMinDelay = 0.75;  ///< rows
constexpr double kSureDelay = 2.0;  ///< rows
constexpr int kSearchedDelay = 15;  ///< rows
constexpr double kDelayExplains = 0.8;
/// Fitted faults that matter in any rig. Smaller ones are faults only where the other cameras are more precise.
constexpr double kLargeZoom = 0.03, kLargeShift = 0.025;  ///< of the focal length; of the image's longer side
constexpr double kLargeDelay = 1.0, kLargeMisfit = 0.06;  ///< rows; share of the person's size

std::string percent(double share) { return fmt::format("{:.1f} %", 100.0 * share); }

class RigExaminer {
 public:
  RigExaminer(const Sightings& seen, std::vector<Finding>& findings) : seen_(seen), findings_(findings) {}

  RigExamination examine() {
    result_.person = choose_detections(seen_);
    result_.views = calibrated_views(seen_);
    result_.faulty.assign(seen_.cameras.size(), false);
    result_.nominal = find_consensus(seen_, result_.views, result_.person);
    result_.explained.assign(seen_.cameras.size(), 0.0);
    if (!result_.nominal.found || result_.nominal.quality > kDoubtfulQuality) explain_whole_rig();
    if (!result_.nominal.found) {
      add("", faults::kDisagrees, Severity::fault,
          fmt::format("the best cameras differ by {} of the person's size", percent(result_.nominal.quality)),
          "No cameras agree on where the person is, and no usual mistake explains it. Check that calibration and "
          "videos "
          "belong together, in the right order, and that the videos are synchronous.");
      return std::move(result_);
    }
    improve_whole_rig();
    for (int c = 0; c < seen_.num_cameras(); ++c) examine_camera(c);
    for (const int c : unsuspected_) examine_small_delay(c);
    report_swaps();
    return std::move(result_);
  }

 private:
  void add(const std::string& camera, const std::string& fault, Severity severity, std::string figure,
           std::string advice) {
    findings_.push_back({camera, fault, severity, std::move(figure), std::move(advice)});
  }

  // ---- faults of all cameras ----

  struct RigGuess {
    std::vector<SupposedView> views;
    double quality = kMaxShare;
    std::string camera, fault, what, advice;
    std::vector<int> cameras;  ///< that it changes; empty: all
  };

  void consider(RigGuess guess, std::optional<RigGuess>& best) const {
    guess.quality = consensus_quality(seen_, guess.views, result_.person);
    if (!best || guess.quality < best->quality) best = std::move(guess);
  }

  /// One mistake that was made with all cameras.
  void consider_common_mistakes(std::optional<RigGuess>& best) const {
    std::vector<std::vector<Explanation>> of;
    for (int c = 0; c < seen_.num_cameras(); ++c) of.push_back(usual_mistakes(seen_, c, false));
    for (std::size_t m = 0; m < of[0].size(); ++m) {
      const Explanation& mistake = of[0][m];
      RigGuess guess{{}, 0.0, "", mistake.fault, mistake.what, mistake.advice, {}};
      for (const auto& list : of) {
        const auto same = std::find_if(list.begin(), list.end(), [&](const Explanation& other) {
          return other.what == mistake.what && other.view.sides_swapped == mistake.view.sides_swapped &&
                 other.view.turn.isApprox(mistake.view.turn);
        });
        if (same == list.end()) break;
        guess.views.push_back(same->view);
      }
      if (guess.views.size() == of.size()) consider(std::move(guess), best);
    }
  }

  void consider_swaps(std::optional<RigGuess>& best) const {
    for (int a = 0; a < seen_.num_cameras(); ++a)
      for (int b = a + 1; b < seen_.num_cameras(); ++b) {
        RigGuess guess{result_.views, 0.0, "", faults::kSwapped, "", "", {a, b}};
        std::swap(guess.views[a], guess.views[b]);
        consider(std::move(guess), best);
      }
  }

  /// For rigs in which too few cameras would be left without the faulty ones.
  void consider_single_cameras(std::optional<RigGuess>& best) const {
    if (seen_.num_cameras() > kMaxCamerasTriedAlone) return;
    for (int c = 0; c < seen_.num_cameras(); ++c)
      for (const Explanation& mistake : usual_mistakes(seen_, c, true)) {
        RigGuess guess{result_.views, 0.0, seen_.cameras[c].name, mistake.fault, mistake.what, mistake.advice, {c}};
        guess.views[c] = mistake.view;
        consider(std::move(guess), best);
      }
  }

  void explain_whole_rig() {
    std::optional<RigGuess> best, single;
    consider_common_mistakes(best);
    if (seen_.num_cameras() > 3) consider_swaps(best);
    consider_single_cameras(single);
    if (single && (!best || single->quality < kExplains * best->quality)) best = single;
    const double before = consensus_quality(seen_, result_.views, result_.person);
    if (!best || best->quality > std::min(kAgreementShare, kWholeRigExplains * before)) return;
    accept(*best, before);
  }

  void accept(const RigGuess& guess, double before) {
    result_.views = guess.views;
    result_.nominal = find_consensus(seen_, result_.views, result_.person);
    const std::string figure = fmt::format(
        "{}: then the cameras agree within {} of the person's size, as they are within {}",
        guess.what.empty() ? "two cameras are exchanged" : guess.what, percent(guess.quality), percent(before));
    if (guess.fault == faults::kSwapped && guess.cameras.size() == 2) {
      add_swap(guess.cameras[0], guess.cameras[1], figure);
      return;
    }
    add(guess.camera, guess.fault, Severity::fault, figure, guess.advice);
    for (const int c : guess.cameras) result_.faulty[c] = true;
    result_.whole_rig_faulty = guess.cameras.empty();
  }

  void add_swap(int a, int b, const std::string& figure) {
    for (const auto& [one, other] : {std::pair(a, b), std::pair(b, a)}) {
      add(seen_.cameras[one].name, faults::kSwapped, Severity::fault, figure,
          fmt::format("The footage of cameras {} and {} is exchanged. Exchange their videos, masks and keypoints, or "
                      "their calibrations, in capture.yaml.",
                      seen_.cameras[one].name, seen_.cameras[other].name));
      result_.faulty[one] = true;
    }
    result_.exchanged.emplace_back(a, b);
  }

  /// Mistakes with all lenses leave cameras that agree, but not well.
  void improve_whole_rig() {
    if (result_.whole_rig_faulty || seen_.num_cameras() < 3 || result_.nominal.noise < kMinShare) return;
    std::optional<RigGuess> best;
    for (const double factor : {0.5, 0.67, 0.75, 0.8, 0.85, 0.9, 0.95, 1.05, 1.1, 1.15, 1.2, 1.25, 1.33, 1.5, 2.0}) {
      RigGuess guess{result_.views,
                     0.0,
                     "",
                     faults::kFocalLength,
                     fmt::format("all focal lengths are about {:.2f} times those of the calibration", factor),
                     "Calibrate the intrinsics again: this is the calibration of another lens or zoom.",
                     {}};
      for (SupposedView& view : guess.views) view.camera.K.topLeftCorner<2, 2>() *= factor;
      consider(std::move(guess), best);
    }
    for (const bool opposite : {false, true}) {
      RigGuess guess{result_.views,
                     0.0,
                     "",
                     faults::kDistortion,
                     opposite ? "all lens coefficients have the wrong sign" : "the images have no lens distortion",
                     "Check the lens coefficients of the calibration: their signs, and whether the images were already "
                     "undistorted.",
                     {}};
      bool any = false;
      for (SupposedView& view : guess.views) {
        any = any || view.camera.has_distortion();
        for (double& coefficient : view.camera.distortion) coefficient *= opposite ? -1.0 : 0.0;
      }
      if (any) consider(std::move(guess), best);
    }
    const double before = consensus_quality(seen_, result_.views, result_.person);
    if (best && best->quality < kWholeRigExplains * before) accept(*best, before);
  }

  // ---- one camera ----

  /// The body that the other cameras see.
  BodyTrack body_without(int camera) const {
    std::vector<int> others;
    for (const int member : result_.nominal.members)
      if (member != camera) others.push_back(member);
    if (others.size() < 3 || others.size() == result_.nominal.members.size()) return result_.nominal.body;
    const ChosenInstants all = all_instants(seen_);
    return SightTable(seen_, result_.views, result_.person, all).triangulate(others, all);
  }

  /// The windows in which a camera disagrees, of those in which it has points.
  struct BadWindows {
    std::vector<int> bad, all;
    bool always() const {
      return static_cast<double>(bad.size()) >= kMinShareOfWindows * static_cast<double>(all.size());
    }
    bool some() const { return static_cast<double>(bad.size()) >= kMinWindows * static_cast<double>(all.size()); }
  };
  BadWindows bad_windows(int camera, double expected) const {
    BadWindows windows;
    const std::vector<double>& shares = result_.nominal.by_window[camera];
    for (std::size_t w = 0; w < shares.size(); ++w) {
      if (shares[w] < 0.0) continue;
      windows.all.push_back(static_cast<int>(w));
      if (shares[w] > std::max(kBadWindowRatio * expected, kMinShare)) windows.bad.push_back(static_cast<int>(w));
    }
    return windows;
  }

  void examine_camera(int c) {
    const double residual = result_.nominal.residual[c], expected = result_.nominal.expected[c];
    result_.explained[c] = residual;
    if (result_.faulty[c] || result_.whole_rig_faulty) return;
    const BadWindows windows = bad_windows(c, expected);
    if (windows.all.empty()) return;
    const BodyTrack body = body_without(c);
    const bool high = residual > std::max(kSuspectRatio * expected, kMinShare);
    if (!high && !windows.some()) {
      unsuspected_.push_back(c);
      return;
    }
    const bool part = windows.some() && !windows.always();
    const ChosenInstants chosen = instants_of(seen_, part ? windows.bad : windows.all);
    const double before = residuals_of(seen_, c, result_.views[c], body, chosen).mean_of_windows(seen_.windows.size());
    const std::vector<Explanation> explanations = explain_camera(seen_, c, body, chosen);
    const Explanation best = best_of(explanations, before, expected);
    const bool always = explains(best, before, expected) && (!part || holds_always(c, best, body, windows));
    if (always && best.fault != faults::kOutOfSync) {
      judge(c, BadWindows(), best, before, expected);
      return;
    }
    const ChosenInstants all = instants_of(seen_, windows.all);
    const Explanation by_time = best_of(explain_by_time(seen_, c, body, all), residual, expected);
    const bool time_explains = explains(by_time, residual, expected) &&
                               (!explains(best, before, expected) || (!always && best.fault == faults::kOutOfSync) ||
                                by_time.residual / residual < (always ? kTimeGain : 1.0) * best.residual / before);
    if (time_explains)
      judge(c, BadWindows(), by_time, residual, expected);
    else
      judge(c, part && !always ? windows : BadWindows(), best, before, expected);
  }

  /// The best of those that explain the residual, or of all if none does. A mistake without fitted numbers that takes
  /// nearly all of the residual away is no coincidence, and what it leaves are small errors of the calibration.
  static Explanation best_of(const std::vector<Explanation>& explanations, double before, double expected) {
    std::vector<Explanation> good, exact;
    for (const Explanation& explanation : explanations) {
      if (explains(explanation, before, expected)) good.push_back(explanation);
      if (explanation.parameters == 0 &&
          explanation.residual < std::min(kExactExplains * before, kMaxRemainder + expected))
        exact.push_back(explanation);
    }
    if (!exact.empty()) return *best_explanation(exact);
    return *best_explanation(good.empty() ? explanations : good);
  }

  /// Whether an explanation of the bad windows does no harm in the others: then the fault is there all the time, but
  /// does not always show, as a delay while the person stands still.
  bool holds_always(int c, const Explanation& explanation, const BodyTrack& body, const BadWindows& windows) const {
    std::vector<int> good;
    std::set_difference(windows.all.begin(), windows.all.end(), windows.bad.begin(), windows.bad.end(),
                        std::back_inserter(good));
    const ChosenInstants chosen = instants_of(seen_, good);
    const auto residual = [&](const SupposedView& view) {
      return residuals_of(seen_, c, view, body, chosen).mean_of_windows(seen_.windows.size());
    };
    return residual(explanation.view) < kNoHarm * residual(result_.views[c]);
  }

  /// Any mistake that is supposed lowers the residual of any points a little, so it must bring them near what is
  /// expected, or take most of the residual away.
  static bool explains(const Explanation& explanation, double before, double expected) {
    const bool near = explanation.residual < std::clamp(kNearExpected * expected, kNearShare, kFarShare) ||
                      (explanation.parameters < kManyParameters && explanation.residual < kTakesMost * before);
    return near && explanation.residual < kExplains * before;
  }

  /// The largest ratio of residual to expectation among the cameras that agree, each against all others: how precise
  /// this rig is.
  double precision() {
    if (precision_ > 0.0) return precision_;
    const ChosenInstants all = all_instants(seen_);
    const SightTable sights(seen_, result_.views, result_.person, all);
    precision_ = 1.0;
    for (const int member : result_.nominal.members) {
      std::vector<int> others;
      for (int c = 0; c < seen_.num_cameras(); ++c)
        if (c != member) others.push_back(c);
      if (others.size() < 3) continue;
      const BodyTrack body = sights.triangulate(others, all);
      const double residual =
          residuals_of(seen_, member, result_.views[member], body, all).mean_of_windows(seen_.windows.size());
      precision_ =
          std::max(precision_, residual / (result_.nominal.noise * expected_factor(sights, others, member, body)));
    }
    return precision_;
  }

  /// Whether a fault would spoil results in a rig of any precision.
  bool is_large(int c, const Explanation& best, double before) const {
    const Camera &nominal = seen_.cameras[c], &fitted = best.view.camera;
    if (best.parameters == 0 || before > kLargeMisfit || best.fault == faults::kRollingOffset ||
        best.fault == faults::kFrameDrops)
      return true;
    if (best.fault == faults::kFocalLength) return std::abs(std::log(fitted.K(0, 0) / nominal.K(0, 0))) > kLargeZoom;
    if (best.fault == faults::kPrincipalPoint)
      return (fitted.K - nominal.K).topRightCorner<2, 1>().norm() >
             kLargeShift * std::max(nominal.width, nominal.height);
    return best.fault == faults::kOutOfSync && std::abs(best.view.delay) >= kLargeDelay;
  }

  Severity severity_of(int c, const Explanation& best, double before, double ratio) {
    if (ratio < kFaultRatio) return is_large(c, best, before) ? Severity::warning : Severity::note;
    return is_large(c, best, before) || ratio > kStandsOut * precision() ? Severity::fault : Severity::note;
  }

  void judge(int c, const BadWindows& part, const Explanation& best, double before, double expected) {
    const std::string& name = seen_.cameras[c].name;
    const double ratio = before / expected;
    const std::string when = part.bad.empty() ? "" : " " + time_of(part);
    if (explains(best, before, expected)) {
      const auto [fault, advice] = named(part, best);
      add(name, fault, severity_of(c, best, before, ratio),
          fmt::format("its keypoints are {} of the person's size off{}, {:.1f} times as much as expected; {} if {}",
                      percent(before), when, ratio, percent(best.residual), best.what),
          advice);
      if (findings_.back().severity == Severity::note) {
        unsuspected_.push_back(c);
        return;
      }
      result_.faulty[c] = true;
      result_.explained[c] = best.residual;
      if (part.bad.empty()) result_.views[c] = best.view;
      if (best.other >= 0) swaps_.emplace_back(c, best.other);
      return;
    }
    if (ratio < kUnexplainedRatio || ratio < kStandsOut * precision()) {
      unsuspected_.push_back(c);
      return;
    }
    const bool other_person = before > kOtherPerson;
    result_.faulty[c] = true;
    add(name, other_person ? faults::kWrongPerson : faults::kDisagrees,
        other_person ? Severity::fault : Severity::warning,
        fmt::format(
            "its keypoints are {} of the person's size off{}, {:.1f} times as much as expected, and no mistake of "
            "the camera explains it (best: {}, {})",
            percent(before), when, ratio, best.what, percent(best.residual)),
        other_person
            ? "The keypoints of this camera show another person, or come from another recording. Detect them "
              "again. Of several people, `doppel detect CAPTURE --person CAMERA X Y` follows the one at this pixel in "
              "all cameras."
            : "Look at the images of this camera in the report. Calibrate the camera again if its keypoints are "
              "right.");
  }

  /// A fault in part of the time has other causes than the same fault all the time.
  std::pair<std::string, std::string> named(const BadWindows& part, const Explanation& best) const {
    if (part.bad.empty() || is_whole_sequences(part)) return {best.fault, best.advice};
    const bool stands = best.fault == faults::kMovedCamera || best.fault == faults::kPrincipalPoint ||
                        best.fault == faults::kFocalLength || best.fault == faults::kDistortion;
    if (stands)
      return {
          faults::kMovedCamera,
          "The camera was moved or zoomed during the recording. Split the sequence there, and calibrate the pose of "
          "both parts."};
    if (best.fault == faults::kOutOfSync)
      return {faults::kFrameDrops,
              "Frames were lost or doubled where the offset changes. Restore them by their time stamps, or split the "
              "sequence there."};
    return {best.fault, best.advice};
  }

  bool is_whole_sequences(const BadWindows& part) const {
    const auto sequence = [&](int window) { return seen_.instants[seen_.windows[window].front()].sequence; };
    return std::all_of(part.bad.begin(), part.bad.end(), [&](int bad) {
      return std::all_of(part.all.begin(), part.all.end(), [&](int window) {
        return sequence(window) != sequence(bad) ||
               std::find(part.bad.begin(), part.bad.end(), window) != part.bad.end();
      });
    });
  }

  std::string time_of(const BadWindows& part) const {
    const Instant &first = seen_.instants[seen_.windows[part.bad.front()].front()],
                  &last = seen_.instants[seen_.windows[part.bad.back()].back()];
    return first.sequence == last.sequence
               ? fmt::format("from frame {} to {} of sequence {}", first.row, last.row, first.sequence + 1)
               : fmt::format("from frame {} of sequence {} to frame {} of sequence {}", first.row, first.sequence + 1,
                             last.row, last.sequence + 1);
  }

  /// A delay hardly raises the residual while the person moves little, but correcting it lowers the residual.
  void examine_small_delay(int c) {
    std::vector<int> others;
    for (int other = 0; other < seen_.num_cameras(); ++other)
      if (other != c && !result_.faulty[other]) others.push_back(other);
    if (others.size() < 2) return;
    const ChosenInstants all = all_instants(seen_);
    const BodyTrack body = SightTable(seen_, result_.views, result_.person, all).triangulate(others, all);
    const SupposedView& nominal = result_.views[c];
    const double before = residuals_of(seen_, c, nominal, body, all).mean_of_windows(seen_.windows.size());
    const auto delay = find_delay(seen_, c, nominal, body, all, kSearchedDelay);
    if (!delay || std::abs(*delay) < kMinDelay) return;
    SupposedView view = nominal;
    view.delay = *delay;
    const double after = residuals_of(seen_, c, view, body, all).mean_of_windows(seen_.windows.size());
    if (after > kDelayExplains * before) return;
    add(seen_.cameras[c].name, faults::kOutOfSync, std::abs(*delay) >= kSureDelay ? Severity::fault : Severity::warning,
        fmt::format("its keypoints are {} of the person's size off, {} if its frames show the person {} than they "
                    "should",
                    percent(before), percent(after), rows_off(*delay)),
        advice_of_delay(seen_, c, *delay, all));
    result_.views[c] = view;
  }

  void report_swaps() {
    for (const auto& [camera, other] : swaps_) {
      const bool both = std::find(swaps_.begin(), swaps_.end(), std::pair(other, camera)) != swaps_.end();
      const std::string &name = seen_.cameras[camera].name, &there = seen_.cameras[other].name;
      if (both && camera < other) result_.exchanged.emplace_back(camera, other);
      for (Finding& finding : findings_)
        if (finding.camera == name && finding.fault == faults::kSwapped)
          finding.advice = both ? fmt::format(
                                      "The footage of cameras {} and {} is exchanged. Exchange their videos, masks and "
                                      "keypoints, or their calibrations, in capture.yaml.",
                                      name, there)
                                : fmt::format(
                                      "The footage or the keypoints of camera {} are those of camera {}. Correct the "
                                      "paths in capture.yaml.",
                                      name, there);
    }
  }

  const Sightings& seen_;
  std::vector<Finding>& findings_;
  RigExamination result_;
  std::vector<std::pair<int, int>> swaps_;
  std::vector<int> unsuspected_;
  double precision_ = 0.0;
};

}  // namespace

bool RigExamination::is_exchanged(int camera) const {
  return std::any_of(exchanged.begin(), exchanged.end(),
                     [&](const auto& pair) { return pair.first == camera || pair.second == camera; });
}

std::optional<RigExamination> examine_rig(const Sightings& seen, std::vector<Finding>& findings) {
  if (seen.num_cameras() < 2 || !seen.has_people()) return std::nullopt;
  return RigExaminer(seen, findings).examine();
}

}  // namespace doppel
