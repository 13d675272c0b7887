#include "doppel/data/doctor/explanation.h"

#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/data/doctor/finding.h"
#include "doppel/data/doctor/statistics.h"
#include "doppel/data/doctor/view_fit.h"

namespace doppel {

namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;

constexpr double kPricePerParameter = 0.04;  ///< log of the residual that a fitted number must save
constexpr double kFloorOfChoice = 0.0015;    ///< shares below this do not differ
constexpr int kMaxDelay = 60;                ///< rows
constexpr int kFitInstants = 120;
constexpr double kMaxDrift = 0.32;  ///< rows per row, in the search
constexpr int kStepParameters = 4;  ///< that a step in each window is priced as
constexpr double kMaxFactor = 2.5;  ///< of the focal length, in the search
/// Share of a drift's residual that a jump may leave: pieces of a constant offset can follow a line, so a jump that is
/// only a little better is a drift as well.
constexpr double kClearJump = 0.8;

class Mistakes {
 public:
  Mistakes(const Sightings& seen, int camera) : seen_(seen), camera_(camera), nominal_(seen.cameras[camera]) {}

  std::vector<Explanation> list(bool swaps) {
    flips();
    quarter_turns();
    extrinsics();
    units();
    resolutions();
    lenses();
    sides();
    if (swaps) positions();
    return std::move(all_);
  }

 private:
  Explanation& add(const char* fault, std::string what, std::string advice) {
    Explanation explanation;
    explanation.fault = fault;
    explanation.view.camera = nominal_;
    explanation.what = std::move(what);
    explanation.advice = std::move(advice);
    all_.push_back(std::move(explanation));
    return all_.back();
  }

  void flips() {
    const double w = nominal_.width, h = nominal_.height;
    for (const bool sides : {true, false}) {
      Explanation& across =
          add(faults::kMirrored, "the images are mirrored left to right",
              "Mirror the videos, masks and keypoints back (ffmpeg -vf hflip), or switch off mirroring "
              "in the camera's software.");
      across.view.turn = Vector2d(-1.0, 1.0).asDiagonal();
      across.view.shift = {w, 0.0};
      across.view.sides_swapped = sides;
      Explanation& down = add(faults::kMirrored, "the images are mirrored top to bottom",
                              "Mirror the videos, masks and keypoints back (ffmpeg -vf vflip).");
      down.view.turn = Vector2d(1.0, -1.0).asDiagonal();
      down.view.shift = {0.0, h};
      down.view.sides_swapped = sides;
    }
    Explanation& turned = add(faults::kUpsideDown, "the images are turned by 180 degrees",
                              "Turn the videos, masks and keypoints by 180 degrees (ffmpeg -vf hflip,vflip), or "
                              "calibrate the camera as it hangs.");
    turned.view.turn = -Matrix2d::Identity();
    turned.view.shift = {w, h};
  }

  /// The images were calibrated before they were turned, so the calibration's own size counts.
  void quarter_turns() {
    Camera before = seen_.calibrated[camera_];
    if (before.width <= 0 || before.height <= 0) return;
    const double sx = static_cast<double>(nominal_.width) / before.height,
                 sy = static_cast<double>(nominal_.height) / before.width;
    for (const bool clockwise : {true, false}) {
      Explanation& turned = add(faults::kTurned, "the images are turned by 90 degrees against the calibration",
                                "Turn the videos, masks and keypoints back (ffmpeg -vf transpose), or calibrate the "
                                "images as they are now. If their metadata turn them, remove these (\"Turned videos "
                                "and images\" in docs/capture.md).");
      turned.view.camera = before;
      turned.view.turn =
          clockwise ? (Matrix2d() << 0, -sx, sy, 0).finished() : (Matrix2d() << 0, sx, -sy, 0).finished();
      turned.view.shift = clockwise ? Vector2d(sx * before.height, 0.0) : Vector2d(0.0, sy * before.width);
    }
  }

  void extrinsics() {
    // The file's world may have another axis up; the mistake was made there.
    const Matrix3d world = seen_.up.size() == 2 ? y_up_from_file(seen_.up) : Matrix3d(Matrix3d::Identity());
    const Matrix3d R = nominal_.R * world;
    const auto with = [&](const char* fault, const char* what, const Matrix3d& file_R, const Eigen::Vector3d& t) {
      Explanation& explanation =
          add(fault, what, "Convert the calibration: R and t must bring a point of the world into the camera.");
      explanation.view.camera.R = file_R * world.transpose();
      explanation.view.camera.t = t;
    };
    with(faults::kInvertedExtrinsics, "rotation and translation are inverted (camera to world, not world to camera)",
         R.transpose(), -R.transpose() * nominal_.t);
    with(faults::kInvertedExtrinsics, "the translation is the camera's position, not that of the world in the camera",
         R, -R * nominal_.t);
    with(faults::kInvertedExtrinsics, "the rotation is inverted", R.transpose(), nominal_.t);
    const Matrix3d opengl = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
    with(faults::kCameraAxes, "the camera's axes are those of OpenGL (y up, z backwards)", opengl * R,
         opengl * nominal_.t);
  }

  void units() {
    for (const double factor : {10.0, 100.0, 1000.0, 0.1, 0.01, 0.001, 0.0254, 1.0 / 0.0254, 0.3048, 1.0 / 0.3048}) {
      Explanation& scaled =
          add(faults::kWrongUnit, fmt::format("its position is in another unit (times {:.4g})", factor),
              "State all cameras in one unit, or name it with `unit` in capture.yaml.");
      scaled.view.camera.t *= factor;
    }
  }

  void resolutions() {
    std::set<double> factors;
    for (const double a : {1.0, 2.0, 3.0, 4.0})
      for (const double b : {1.0, 2.0, 3.0, 4.0})
        if (a != b) factors.insert(a / b);
    for (const double factor : {3.0 / 8.0, 8.0 / 3.0}) factors.insert(factor);
    const Camera& calibrated = seen_.calibrated[camera_];
    if (calibrated.width > 0 && calibrated.width != nominal_.width)
      factors.insert(static_cast<double>(calibrated.width) / nominal_.width);
    for (const double factor : factors) {
      Explanation& scaled = add(
          faults::kWrongResolution,
          fmt::format("calibration and keypoints belong to other resolutions (keypoints times {:.3g})", factor),
          "State the calibration (width, height, K) for the resolution of the videos, and find the keypoints in the "
          "videos of this capture.");
      scaled.view.turn = factor * Matrix2d::Identity();
    }
  }

  void lenses() {
    const char* advice =
        "Check the lens coefficients: state them for these images, or zeros if the images were already "
        "undistorted.";
    if (!nominal_.has_distortion()) return;
    Explanation& none =
        add(faults::kDistortion, "the images have no lens distortion, but the calibration states some", advice);
    none.view.camera.distortion.fill(0.0);
    none.view.camera.lens = Lens::opencv;
    Explanation& opposite = add(faults::kDistortion, "the lens coefficients have the wrong sign", advice);
    for (double& coefficient : opposite.view.camera.distortion) coefficient = -coefficient;
    Explanation& other = add(faults::kDistortion, "the lens coefficients belong to another lens model", advice);
    other.view.camera.lens = nominal_.lens == Lens::fisheye ? Lens::opencv : Lens::fisheye;
  }

  void sides() {
    Explanation& swapped = add(faults::kLeftRight, "left and right of the keypoints are exchanged",
                               "Exchange the left and right points of this camera, or run the detector on images that "
                               "are not mirrored.");
    swapped.view.sides_swapped = true;
  }

  void positions() {
    for (int other = 0; other < seen_.num_cameras(); ++other) {
      if (other == camera_) continue;
      const Camera& there = seen_.cameras[other];
      Explanation& swapped = add(faults::kSwapped, fmt::format("its keypoints are those of camera {}", there.name),
                                 "Exchange the videos, masks and keypoints (or the calibrations) of these cameras in "
                                 "capture.yaml.");
      swapped.view.camera = there;
      swapped.other = other;
    }
  }

  const Sightings& seen_;
  int camera_;
  Camera nominal_;
  std::vector<Explanation> all_;
};

/// Explanations with fitted numbers.
class Fits {
 public:
  Fits(const Sightings& seen, int camera, const BodyTrack& body, const ChosenInstants& chosen)
      : seen_(seen), camera_(camera), body_(body), chosen_(chosen) {
    nominal_.camera = seen.cameras[camera];
  }

  std::vector<Explanation> list() {
    delay();
    focal();
    part({.principal_point = true}, faults::kPrincipalPoint, "the principal point is off");
    part({.distortion = true}, faults::kDistortion, "the lens distorts in another way than the calibration states");
    intrinsics();
    pose();
    return std::move(all_);
  }

 private:
  void add(const char* fault, int parameters, const SupposedView& view, std::string what, std::string advice) {
    Explanation explanation;
    explanation.fault = fault;
    explanation.parameters = parameters;
    explanation.view = view;
    explanation.what = std::move(what);
    explanation.advice = std::move(advice);
    all_.push_back(std::move(explanation));
  }

  void delay() {
    const auto found = find_delay(seen_, camera_, nominal_, body_, chosen_, kMaxDelay);
    if (!found) return;
    SupposedView view = nominal_;
    view.delay = *found;
    add(faults::kOutOfSync, 1, view, fmt::format("its frames show the person {} than they should", rows_off(*found)),
        advice_of_delay(seen_, camera_, *found, chosen_));
  }

  SupposedView fit(const SupposedView& start, const FreeParts& parts) const {
    return fit_view(seen_, camera_, start, body_, chosen_, parts);
  }
  double residual(const SupposedView& view) const {
    return residuals_of(seen_, camera_, view, body_, chosen_).mean_of_windows(seen_.windows.size());
  }

  /// The search for the focal length begins at several factors, because far from it the person is elsewhere.
  void focal() {
    SupposedView best = nominal_;
    double least = std::numeric_limits<double>::infinity();
    for (double factor = 1.0 / kMaxFactor; factor <= kMaxFactor; factor *= 1.1) {
      SupposedView view = nominal_;
      view.camera.K.topLeftCorner<2, 2>() *= factor;
      if (const double value = residual(view); value < least) {
        least = value;
        best = view;
      }
    }
    best = fit(best, {.focal = true});
    add(faults::kFocalLength, 1, best,
        fmt::format("the focal length is {:.4g} times that of the calibration", focal_factor(best)),
        "Calibrate the intrinsics of this camera again; the zoom was changed, or this is the calibration of another "
        "lens.");
  }
  double focal_factor(const SupposedView& view) const { return view.camera.K(0, 0) / nominal_.camera.K(0, 0); }

  void part(const FreeParts& parts, const char* fault, const char* what) {
    const SupposedView view = fit(nominal_, parts);
    std::string text = what;
    if (parts.principal_point) {
      const Vector2d moved = shift_of(view);
      text += fmt::format(" by {:.1f}, {:.1f} pixels", moved.x(), moved.y());
    } else {
      text += fmt::format(" (k1 {:.3f} and k2 {:.3f})", view.camera.distortion[0], view.camera.distortion[1]);
    }
    add(fault, parts.parameters(), view, text,
        parts.principal_point
            ? "Calibrate the intrinsics of this camera again; the images may have been cropped or moved "
              "by stabilisation since. A camera that was turned looks alike."
            : "Calibrate the lens of this camera again.");
  }
  Vector2d shift_of(const SupposedView& view) const {
    return view.camera.K.topRightCorner<2, 1>() - nominal_.camera.K.topRightCorner<2, 1>();
  }

  void intrinsics() {
    const SupposedView view = fit(all_.back().view.camera.K.isApprox(nominal_.camera.K) ? nominal_ : all_.back().view,
                                  {.focal = true, .principal_point = true});
    const bool zoomed = std::abs(std::log(focal_factor(view))) * seen_.size[camera_] > shift_of(view).norm();
    add(zoomed ? faults::kFocalLength : faults::kPrincipalPoint, 3, view,
        fmt::format("the intrinsics are off: focal length times {:.4g}, principal point by {:.1f}, {:.1f} pixels",
                    focal_factor(view), shift_of(view).x(), shift_of(view).y()),
        "Calibrate the intrinsics of this camera again.");
  }

  void pose() {
    const FreeParts all{.rotation = true, .translation = true};
    SupposedView best = fit(nominal_, all);
    if (const auto found = find_pose(seen_, camera_, nominal_, body_, chosen_)) {
      const SupposedView other = fit(*found, all);
      if (residual(other) < residual(best)) best = other;
    }
    const Eigen::AngleAxisd turn(best.camera.R * nominal_.camera.R.transpose());
    const double moved = (best.camera.centre() - nominal_.camera.centre()).norm() / seen_.scale;
    const std::string what =
        fmt::format("the camera stands elsewhere than calibrated: turned by {:.2g} degrees, moved by {:.3g} m",
                    turn.angle() * 180.0 / M_PI, moved);
    const char* advice = "Calibrate its pose again; the camera was moved after the calibration.";
    add(faults::kMovedCamera, 3, fit(nominal_, {.rotation = true}), "the camera was turned since the calibration",
        advice);
    add(faults::kMovedCamera, 6, best, what, advice);
  }

  const Sightings& seen_;
  int camera_;
  const BodyTrack& body_;
  const ChosenInstants& chosen_;
  SupposedView nominal_;
  std::vector<Explanation> all_;
};

}  // namespace

std::vector<Explanation> usual_mistakes(const Sightings& seen, int camera, bool swaps) {
  return Mistakes(seen, camera).list(swaps);
}

std::vector<Explanation> explain_camera(const Sightings& seen, int camera, const BodyTrack& body,
                                        const ChosenInstants& chosen) {
  std::vector<Explanation> all = usual_mistakes(seen, camera, true);
  std::vector<int> windows = chosen.window;
  windows.erase(std::unique(windows.begin(), windows.end()), windows.end());
  const ChosenInstants some = instants_of(seen, windows, kFitInstants);
  std::vector<Explanation> fitted = Fits(seen, camera, body, some).list();
  all.insert(all.end(), std::make_move_iterator(fitted.begin()), std::make_move_iterator(fitted.end()));
  for (Explanation& explanation : all)
    explanation.residual =
        residuals_of(seen, camera, explanation.view, body, chosen).mean_of_windows(seen.windows.size());
  return all;
}

namespace {

/// A delay that grows in a line. The search begins at the line with the median slope of all pairs of windows (Theil and
/// Sen) and at lines through a common start, and goes on in ever smaller steps.
/// @param found row and delay of windows
SupposedView growing_delay(const Sightings& seen, int camera, const SupposedView& nominal, const BodyTrack& body,
                           const ChosenInstants& chosen, const std::vector<std::pair<double, double>>& found) {
  const auto left_by = [&](const SupposedView& view) {
    return residuals_of(seen, camera, view, body, chosen).mean_of_windows(seen.windows.size());
  };
  std::vector<double> slopes, starts;
  for (std::size_t a = 0; a < found.size(); ++a)
    for (std::size_t b = a + 1; b < found.size(); ++b)
      if (found[a].first != found[b].first)
        slopes.push_back((found[b].second - found[a].second) / (found[b].first - found[a].first));
  SupposedView best = nominal;
  best.drift = median(slopes);
  for (const auto& [row, delay] : found) starts.push_back(delay - best.drift * row);
  best.delay = median(starts);
  double least = left_by(best);
  const auto consider = [&](double delay, double drift) {
    SupposedView view = nominal;
    view.delay = delay;
    view.drift = drift;
    if (const double value = left_by(view); value < least) {
      least = value;
      best = view;
    }
  };
  for (double drift = -kMaxDrift; drift <= kMaxDrift; drift += kMaxDrift / 16.0) consider(0.0, drift);
  for (double step = 1.0; step > 0.1; step *= 0.5) {
    const SupposedView from = best;
    for (const double sign : {-1.0, 1.0}) {
      consider(from.delay + sign * step, from.drift);
      consider(from.delay, from.drift + sign * step * kMaxDrift / 16.0);
      consider(from.delay - sign * step, from.drift + sign * step * kMaxDrift / 16.0);
    }
  }
  return best;
}

/// A delay that jumps once: from a window of a sequence on, the median delay of the windows that follow in it.
/// @param delays [windows]
SupposedView jumping_delay(const Sightings& seen, int camera, const SupposedView& nominal, const BodyTrack& body,
                           const ChosenInstants& chosen, const std::vector<double>& delays) {
  const auto sequence = [&](std::size_t window) { return seen.instants[seen.windows[window].front()].sequence; };
  SupposedView best = nominal;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t first = 0; first < delays.size(); ++first) {
    SupposedView view = nominal;
    view.steps.assign(delays.size(), 0.0);
    std::vector<double> after;
    for (std::size_t w = first; w < delays.size() && sequence(w) == sequence(first); ++w) after.push_back(delays[w]);
    std::fill_n(view.steps.begin() + static_cast<std::ptrdiff_t>(first), after.size(), median(after));
    const double left = residuals_of(seen, camera, view, body, chosen).mean_of_windows(seen.windows.size());
    if (left < least) {
      least = left;
      best = view;
    }
  }
  return best;
}

}  // namespace

std::vector<Explanation> explain_by_time(const Sightings& seen, int camera, const BodyTrack& body,
                                         const ChosenInstants& chosen) {
  SupposedView nominal;
  nominal.camera = seen.cameras[camera];
  SupposedView steps = nominal;
  steps.steps.assign(seen.windows.size(), 0.0);
  std::vector<std::pair<double, double>> found;  // row, delay
  std::set<int> windows(chosen.window.begin(), chosen.window.end());
  for (const int window : windows) {
    const ChosenInstants part = instants_of(seen, {window});
    const auto delay = find_delay(seen, camera, nominal, body, part, kMaxDelay / 2);
    if (!delay) continue;
    steps.steps[window] = *delay;
    found.emplace_back(seen.instants[part.instants[part.instants.size() / 2]].row, *delay);
  }
  std::vector<Explanation> all(3);
  all[0].view = growing_delay(seen, camera, nominal, body, chosen, found);
  all[0].fault = faults::kRollingOffset;
  all[0].parameters = 2;
  all[0].what = fmt::format("its offset grows by {:.3g} rows in 100", 100.0 * all[0].view.drift);
  all[0].advice = "Correct the camera's rate with `camera_fps`: it films at another rate than the capture says.";
  all[1].view = steps;
  all[1].fault = faults::kFrameDrops;
  all[1].parameters = kStepParameters;
  const auto [low, high] = std::minmax_element(steps.steps.begin(), steps.steps.end());
  all[1].what = fmt::format("its offset jumps during the recording, between {:.3g} and {:.3g} rows", *low, *high);
  all[1].advice =
      "Frames were lost or doubled. Restore them by their time stamps, or cut the sequence where they are lost.";
  all[2] = all[1];
  all[2].parameters = 2;
  all[2].view = jumping_delay(seen, camera, nominal, body, chosen, steps.steps);
  for (Explanation& explanation : all)
    explanation.residual =
        residuals_of(seen, camera, explanation.view, body, chosen).mean_of_windows(seen.windows.size());
  const double most = kClearJump * all[0].residual;
  std::erase_if(all, [&](const Explanation& explanation) {
    return explanation.fault == faults::kFrameDrops && explanation.residual > most;
  });
  return all;
}

std::string rows_off(double delay) {
  return fmt::format("{:.4g} rows {}", std::abs(delay), delay < 0.0 ? "earlier" : "later");
}

std::string advice_of_delay(const Sightings& seen, int camera, double delay, const ChosenInstants& chosen) {
  std::set<int> sequences;
  for (const int instant : chosen.instants) sequences.insert(seen.instants[instant].sequence);
  std::map<double, std::vector<std::string>> names;  // by the offset that is stated
  for (const int s : sequences) names[seen.times[s][camera].clock.offset].push_back(seen.sequences[s]);
  // Frame r * rate + offset shows row r + delay, so with an offset of delay * rate less it is that of row r + delay.
  const auto rounded = [](double offset) { return std::round(100.0 * offset) / 100.0 + 0.0; };
  std::string values;
  for (const auto& [offset, of] : names) {
    const double rate = seen.times[*sequences.begin()][camera].clock.rate;
    values += fmt::format("{} to {} (it is {})", values.empty() ? "" : ",", rounded(offset - delay * rate), offset);
    if (of.size() < seen.sequences.size()) values += fmt::format(" in {}", fmt::join(of, ", "));
  }
  return fmt::format("Set `frame_offset` of {}{}.", seen.cameras[camera].name, values);
}

const Explanation* best_explanation(const std::vector<Explanation>& explanations) {
  const Explanation* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Explanation& explanation : explanations) {
    const double score =
        std::log(std::max(explanation.residual, kFloorOfChoice)) + kPricePerParameter * explanation.parameters;
    if (score < least) {
      least = score;
      best = &explanation;
    }
  }
  return best;
}

}  // namespace doppel
