#include "doppel/data/doctor/image_examination.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "doppel/data/doctor/activity_examination.h"
#include "doppel/data/doctor/statistics.h"

namespace doppel {

namespace {

constexpr double kExposureWarning = 0.7, kExposureFault = 1.0;  ///< stops against the median of the others
constexpr double kBalanceWarning = 0.3, kBalanceFault = 0.45;   ///< log2 of a ratio of channels, likewise
constexpr double kTimesSpread = 4.0;                            ///< and of the spread of the others
constexpr double kJumpOfExposure = 0.12;                        ///< stops between two images
constexpr double kBlurRatio = 1.7, kBlurPixels = 0.7;  ///< of the edges' width, against the median of the others
constexpr double kDoubled = 0.2, kMoving = 0.5;        ///< change of an image, of the usual change
constexpr double kMinChange = 0.15;                    ///< grey levels: below, nothing moves
constexpr double kJump = 1.7;                          ///< the same, over its neighbours and the other cameras
constexpr double kGapOfStamps = 1.6;                   ///< of the usual distance of time stamps
constexpr double kDoubledWarning = 0.02, kDoubledFault = 0.05;  ///< share of the frames
constexpr int kMinDoubled = 2;

const double kNone = std::numeric_limits<double>::quiet_NaN();

/// The median over a camera's images of one measure.
template <typename Measure>
double usual(const FootageExamination& footage, const Measure& measure) {
  std::vector<double> values;
  for (const ImageFacts& facts : footage.images)
    if (const double value = measure(facts); std::isfinite(value)) values.push_back(value);
  return values.size() < 3 ? kNone : median(values);
}

template <typename Measure>
std::vector<double> usual_of_cameras(const SequenceFootage& footage, const Measure& measure) {
  std::vector<double> values;
  for (const FootageExamination& camera : footage) values.push_back(usual(camera, measure));
  return values;
}

/// How far the surroundings of the person differ in a camera from those in the others; 0 when they do not more than the
/// others among each other, and when the person says the contrary. The person alone would not do: lamps and clothes
/// have sides.
double difference_of(const std::vector<double>& person, const std::vector<double>& scene, std::size_t camera) {
  const AgainstOthers around = against_others(scene, camera);
  if (around.others < 2 || std::abs(around.difference) < kTimesSpread * around.spread) return 0.0;
  const AgainstOthers on_person = against_others(person, camera);
  const bool contrary = on_person.others >= 2 && on_person.difference * around.difference < 0.0 &&
                        std::abs(on_person.difference) > 2.0 * on_person.spread + 0.5 * std::abs(around.difference);
  return contrary ? 0.0 : around.difference;
}

class ImageJudge {
 public:
  ImageJudge(const Sightings& seen, const SequenceFootage& footage, std::vector<Finding>& findings)
      : seen_(seen), footage_(footage), findings_(findings) {}

  /// @param by_keypoints whether the keypoints say where the person is
  void judge(bool by_keypoints) {
    for (std::size_t c = 0; c < footage_.size(); ++c) {
      unreadable(c);
      if (by_keypoints) {
        exposure(c);
        unsteady_exposure(c);
        balance(c);
      }
      blur(c);
      frames(c);
    }
  }

 private:
  void add(std::size_t camera, const char* fault, Severity severity, std::string figure, std::string advice) {
    findings_.push_back({seen_.cameras[camera].name, fault, severity, std::move(figure), std::move(advice)});
  }

  void unreadable(std::size_t c) {
    const FootageExamination& camera = footage_[c];
    if (camera.error.empty() || camera.frames <= 0) return;
    if (camera.missing_images > 0)
      add(c, faults::kUnreadable, Severity::fault,
          fmt::format("{} of its images cannot be read", camera.missing_images),
          camera.error + ". Copy the images again, or leave these frames out with `first_frame` and `last_frame`.");
    else
      add(c, faults::kUnreadable, Severity::fault, "a frame of its video cannot be read",
          camera.error + ". Copy the video again, or cut the sequence before this frame with `last_frame`.");
  }

  void exposure(std::size_t c) {
    const double stops =
        difference_of(usual_of_cameras(footage_, [](const ImageFacts& f) { return f.exposure; }),
                      usual_of_cameras(footage_, [](const ImageFacts& f) { return f.scene_exposure; }), c);
    if (std::abs(stops) < kExposureWarning) return;
    add(c, faults::kExposure, std::abs(stops) > kExposureFault ? Severity::fault : Severity::warning,
        fmt::format("its images are {:.1f} stops {} than those of the other cameras", std::abs(stops),
                    stops < 0.0 ? "darker" : "brighter"),
        "Set the same exposure in all cameras, and switch automatic exposure off. Videos that exist can be corrected "
        "with "
        "`ffmpeg -vf exposure` where they are not clipped.");
  }

  void unsteady_exposure(std::size_t c) {
    const auto jumps = [](const FootageExamination& camera) {
      std::vector<double> values;
      for (std::size_t i = 1; i < camera.images.size(); ++i)
        if (const double jump = std::abs(camera.images[i].scene_exposure - camera.images[i - 1].scene_exposure);
            camera.images[i].after_previous && std::isfinite(jump))
          values.push_back(jump);
      return values.empty() ? kNone : quantile(values, 0.9);
    };
    std::vector<double> values;
    for (const FootageExamination& camera : footage_) values.push_back(jumps(camera));
    const AgainstOthers against = against_others(values, c);
    if (against.others < 2 || !(values[c] > kJumpOfExposure) || values[c] < 4.0 * (values[c] - against.difference))
      return;
    add(c, faults::kExposure, Severity::fault,
        fmt::format("its brightness changes by {:.2f} stops from frame to frame", values[c]),
        "Switch automatic exposure off, and set the shutter to a multiple of the lamps' period.");
  }

  void balance(std::size_t c) {
    const double red = difference_of(usual_of_cameras(footage_, [](const ImageFacts& f) { return f.red; }),
                                     usual_of_cameras(footage_, [](const ImageFacts& f) { return f.scene_red; }), c);
    const double blue = difference_of(usual_of_cameras(footage_, [](const ImageFacts& f) { return f.blue; }),
                                      usual_of_cameras(footage_, [](const ImageFacts& f) { return f.scene_blue; }), c);
    const double largest = std::max(std::abs(red), std::abs(blue));
    if (largest < kBalanceWarning) return;
    add(c, faults::kWhiteBalance, largest > kBalanceFault ? Severity::fault : Severity::warning,
        fmt::format("its colours differ from those of the other cameras: red {:+.2f}, blue {:+.2f} stops against green",
                    red, blue),
        "Set the same white balance in all cameras, and switch automatic white balance off.");
  }

  void blur(std::size_t c) {
    std::vector<double> widths =
        usual_of_cameras(footage_, [](const ImageFacts& f) { return f.edge_width < 0.0 ? kNone : f.edge_width; });
    for (std::size_t i = 0; i < widths.size(); ++i) widths[i] /= std::max(1, seen_.cameras[i].width);
    const AgainstOthers against = against_others(widths, c);
    if (against.others < 2) return;
    const double usual_width = widths[c] - against.difference, width = seen_.cameras[c].width;
    const bool blurred = widths[c] > kBlurRatio * usual_width && against.difference * width > kBlurPixels &&
                         against.difference > kTimesSpread * against.spread;
    if (!blurred) return;
    add(c, faults::kBlur, widths[c] > 1.3 * kBlurRatio * usual_width ? Severity::fault : Severity::warning,
        fmt::format("its sharpest edges are {:.1f} pixels wide, those of the other cameras {:.1f}", widths[c] * width,
                    usual_width * width),
        "Focus the camera, clean its lens, and switch autofocus off. Frames that are blurred cannot be sharpened.");
  }

  /// The change of each image over the usual change around it, by row.
  std::map<long, double> changes(std::size_t c) const {
    const std::vector<ImageFacts>& images = footage_[c].images;
    std::map<long, double> ratios;
    constexpr std::size_t kAround = 6;
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (images[i].change < 0.0) continue;
      std::vector<double> around;
      for (std::size_t j = i > kAround ? i - kAround : 0; j < std::min(images.size(), i + kAround + 1); ++j)
        if (j != i && images[j].change >= 0.0) around.push_back(images[j].change);
      // the upper half: in a video with many doubled frames, the median is none that changes
      const double level = quantile(around, 0.7);
      if (around.size() >= 4 && level > kMinChange) ratios[images[i].row] = images[i].change / level;
    }
    return ratios;
  }

  struct FrameCounts {
    int rows = 0, doubled = 0, jumps = 0, gaps = 0;
  };

  FrameCounts count_frames(std::size_t c, const std::vector<std::map<long, double>>& all) const {
    FrameCounts counts;
    for (const auto& [row, ratio] : all[c]) {
      std::vector<double> others;
      for (std::size_t o = 0; o < all.size(); ++o)
        if (const auto found = all[o].find(row); o != c && found != all[o].end()) others.push_back(found->second);
      const double usual_ratio = others.empty() ? 1.0 : median(others);
      const auto at = [&](long other) { return all[c].count(other) > 0 ? all[c].at(other) : 1.0; };
      ++counts.rows;
      counts.doubled += ratio < kDoubled && usual_ratio > kMoving;
      counts.jumps += ratio > kJump * std::max({at(row - 1), at(row + 1), usual_ratio, 0.5});
    }
    std::vector<double> steps;
    const std::vector<ImageFacts>& images = footage_[c].images;
    for (std::size_t i = 1; i < images.size(); ++i)
      if (images[i].after_previous && images[i].seconds && images[i - 1].seconds)
        steps.push_back(*images[i].seconds - *images[i - 1].seconds);
    const double step = median(steps);
    for (const double value : steps) counts.gaps += step > 0.0 && value > kGapOfStamps * step;
    return counts;
  }

  /// The largest number of rows that half of the cameras have, and the first row that one of these films; 0 rows where
  /// cameras were stopped one by one, so that their numbers say nothing.
  std::pair<long, double> usual_rows() const {
    std::map<long, std::vector<double>> starts;  // by the number of rows
    std::size_t readable = 0;
    for (const FootageExamination& camera : footage_) {
      if (camera.rows < 0) continue;
      starts[camera.rows].push_back(camera.start);
      ++readable;
    }
    for (auto of = starts.rbegin(); readable >= 3 && of != starts.rend(); ++of)
      if (of->second.size() >= 2 && 2 * of->second.size() >= readable)
        return {of->first, *std::min_element(of->second.begin(), of->second.end())};
    return {0, 0.0};
  }

  /// Rows that a camera has fewer than most others, without those before it was started.
  long missing_frames(std::size_t c) const {
    if (footage_[c].rows < 0) return 0;
    const auto [rows, start] = usual_rows();
    const double late = std::max(0.0, footage_[c].start - start);
    return std::max(0L, rows - footage_[c].rows - static_cast<long>(std::ceil(late)));
  }

  void frames(std::size_t c) {
    std::vector<std::map<long, double>> all;
    for (std::size_t o = 0; o < footage_.size(); ++o) all.push_back(changes(o));
    const FrameCounts counts = count_frames(c, all);
    const long missing = missing_frames(c);
    const double doubled = counts.rows == 0 ? 0.0 : static_cast<double>(counts.doubled) / counts.rows;
    const bool many_doubled = counts.doubled >= kMinDoubled && doubled > kDoubledWarning;
    const bool fault =
        (many_doubled && doubled > kDoubledFault) || counts.gaps > 0 || (missing > 0 && counts.jumps > 0);
    if (!fault && !many_doubled && missing == 0) return;
    std::string figure;
    const auto say = [&](long count, const char* what) {
      if (count > 0) figure += fmt::format("{}{} {}", figure.empty() ? "" : ", ", count, what);
    };
    say(many_doubled ? counts.doubled : 0, "doubled frames");
    say(counts.gaps, "gaps of the time stamps");
    say(missing, "frames fewer than the other cameras");
    say(counts.jumps, "positions where the image jumps");
    add(c, faults::kFrameDrops, fault ? Severity::fault : Severity::warning, figure,
        "Frames were lost or doubled in recording or copying. Restore them by their time stamps (ffmpeg -fps_mode), or "
        "split the sequence there; a faster disk or a lower rate avoids it.");
  }

  const Sightings& seen_;
  const SequenceFootage& footage_;
  std::vector<Finding>& findings_;
};

}  // namespace

bool examine_images(const Sightings& seen, const RigExamination* rig, const std::vector<SequenceFootage>& footage,
                    std::vector<Finding>& findings) {
  bool of_footage = true;
  for (const SequenceFootage& sequence : footage) {
    const bool by_keypoints = examine_activity(seen, rig, sequence, findings);
    ImageJudge(seen, sequence, findings).judge(by_keypoints);
    of_footage = of_footage && by_keypoints;
  }
  return of_footage;
}

}  // namespace doppel
