#include "doppel/data/doctor/image_facts.h"

#include <algorithm>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/doctor/statistics.h"
#include "doppel/detect/masks/components.h"
#include "doppel/detect/masks/mask.h"

namespace doppel {

namespace {

constexpr int kSmallWidth = 160;                        ///< of the images whose differences are measured
constexpr int kEdgeEvery = 6;                           ///< images between two measurements of sharpness
constexpr int kMaxSmallImages = 24;                     ///< small images that are kept of a sequence
constexpr double kFineSigma = 0.8, kCoarseSigma = 2.5;  ///< pixels, scales of the edges
constexpr double kEdgeShare = 0.985;  ///< quantile of the coarse gradient from which on a pixel is an edge
constexpr double kWeakestEdge = 2.0;  ///< grey levels per pixel
constexpr double kMaskReach = 0.03;   ///< of the person's size, by which a point may miss the mask
constexpr int kSamplesPerBone = 5;

const std::array<float, 256>& linear_light() {
  static const std::array<float, 256> kTable = [] {
    std::array<float, 256> table{};
    for (std::size_t i = 0; i < 256; ++i) table[i] = std::pow(static_cast<float>(i) / 255.0f, 2.2f);
    return table;
  }();
  return kTable;
}

struct Light {
  double stops = 0.0, red = 0.0, blue = 0.0, overexposed = 0.0;
};

/// Mean linear light of an image where a mask is set. @param mask empty: everywhere
Light light_of(const cv::Mat& image, const cv::Mat& mask) {
  const auto& table = linear_light();
  std::array<double, 3> sum{};
  long count = 0, bright = 0;
  for (int y = 0; y < image.rows; y += 2) {
    const auto* row = image.ptr<cv::Vec3b>(y);
    const auto* inside = mask.empty() ? nullptr : mask.ptr<std::uint8_t>(y);
    for (int x = 0; x < image.cols; x += 2) {
      if (inside && inside[x] == 0) continue;
      for (int channel = 0; channel < 3; ++channel) sum[channel] += table[row[x][channel]];
      bright += std::max({row[x][0], row[x][1], row[x][2]}) >= 252;
      ++count;
    }
  }
  if (count == 0) return {NAN, NAN, NAN, 0.0};
  constexpr double kBlack = 1e-4;
  for (double& value : sum) value = value / static_cast<double>(count) + kBlack;
  return {std::log2((sum[0] + sum[1] + sum[2]) / 3.0), std::log2(sum[2] / sum[1]), std::log2(sum[0] / sum[1]),
          static_cast<double>(bright) / static_cast<double>(count)};
}

cv::Mat gradient_of(const cv::Mat& grey, double sigma) {
  cv::Mat smooth, dx, dy, length;
  cv::GaussianBlur(grey, smooth, {}, sigma);
  cv::Sobel(smooth, dx, CV_32F, 1, 0, 3, 0.125);
  cv::Sobel(smooth, dy, CV_32F, 0, 1, 3, 0.125);
  cv::magnitude(dx, dy, length);
  return length;
}

/// The sigma of the blur of the sharpest edges. A step that was blurred by s has, after smoothing by f, a slope
/// proportional to 1/sqrt(s^2 + f^2); the ratio of the slopes at two scales gives s. The tenth of the edges with the
/// largest ratio counts.
double edge_width_of(const cv::Mat& image) {
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  const cv::Mat fine = gradient_of(grey, kFineSigma), coarse = gradient_of(grey, kCoarseSigma);
  std::vector<double> strengths;
  for (int y = 4; y < coarse.rows - 4; y += 2)
    for (int x = 4; x < coarse.cols - 4; x += 2) strengths.push_back(coarse.at<float>(y, x));
  if (strengths.empty()) return -1.0;
  const double strong = std::max(kWeakestEdge, quantile(strengths, kEdgeShare));
  std::vector<double> ratios;
  for (int y = 4; y < coarse.rows - 4; ++y)
    for (int x = 4; x < coarse.cols - 4; ++x)
      if (coarse.at<float>(y, x) >= strong) ratios.push_back(fine.at<float>(y, x) / coarse.at<float>(y, x));
  if (ratios.size() < 50) return -1.0;
  const double ratio = std::max(1.02, quantile(ratios, 0.8)), squared = ratio * ratio;
  const double width = (kCoarseSigma * kCoarseSigma - squared * kFineSigma * kFineSigma) / (squared - 1.0);
  return std::sqrt(std::max(0.0, width));
}

cv::Mat small_grey(const cv::Mat& image) {
  cv::Mat grey, small;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  const double scale = static_cast<double>(kSmallWidth) / image.cols;
  cv::resize(grey, small, {kSmallWidth, std::max(1, static_cast<int>(std::lround(image.rows * scale)))}, 0, 0,
             cv::INTER_AREA);
  return small;
}

/// The pixels of the trunk, by a person's points; empty without a trunk.
cv::Mat trunk_of(const Sightings& seen, const SeenPerson& person, cv::Size size) {
  std::vector<cv::Point> corners;
  for (const char* key : {"left_shoulder", "right_shoulder", "left_hip", "right_hip"}) {
    const int k = seen.point(key);
    if (k >= 0 && person[k].seen)
      corners.emplace_back(static_cast<int>(person[k].pixel.x()), static_cast<int>(person[k].pixel.y()));
  }
  if (corners.size() < 3) return {};
  std::vector<cv::Point> hull;
  cv::convexHull(corners, hull);
  cv::Mat mask = cv::Mat::zeros(size, CV_8UC1);
  cv::fillConvexPoly(mask, hull, 255);
  cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
  return cv::countNonZero(mask) < 30 ? cv::Mat() : mask;
}

bool is_on(const cv::Mat& mask, const Eigen::Vector2d& pixel) {
  const cv::Point at(static_cast<int>(std::floor(pixel.x())), static_cast<int>(std::floor(pixel.y())));
  return at.x >= 0 && at.y >= 0 && at.x < mask.cols && at.y < mask.rows && mask.at<std::uint8_t>(at) > 0;
}

cv::Mat grown(const cv::Mat& mask, double reach) {
  cv::Mat distance;
  cv::distanceTransform(~mask, distance, cv::DIST_L2, cv::DIST_MASK_3);
  return distance <= reach;
}

class FootageReading {
 public:
  FootageReading(const Capture& capture, int sequence, const Sightings& seen, int camera, const RigExamination* rig)
      : capture_(capture), entry_(capture.sequences[sequence]), seen_(seen), camera_(camera), rig_(rig) {
    for (int i = 0; i < seen.num_instants(); ++i)
      if (seen.instants[i].sequence == sequence) instants_.push_back(i);
  }

  FootageExamination read() {
    const Camera& camera = seen_.cameras[camera_];
    const FrameClock clock = capture_.clock(entry_, camera.name);
    open(camera);
    if (found_.frames >= 0) found_.rows = std::lround(static_cast<double>(found_.frames) / clock.rate);
    found_.start = -clock.offset / clock.rate;
    // Rows of a camera of another rate may repeat a frame, or leave one out.
    const long step = std::max(1L, static_cast<long>(std::floor(clock.rate)));
    for (const int instant : instants_) {
      if (stopped_ && !found_.mask_error.empty()) break;
      const long row = seen_.instants[instant].row, frame = clock.frame(row);
      if (frame < 0) continue;
      ImageFacts facts;
      facts.row = row;
      facts.after_previous =
          !found_.images.empty() && found_.images.back().row == row - 1 && frame - clock.frame(row - 1) == step;
      const cv::Mat image = read_image(frame), mask = read_mask(frame, image);
      if (image.empty()) small_before_.release();
      if (image.empty() && mask.empty()) continue;
      if (!mask.empty()) measure_mask(instant, mask, facts);
      if (!image.empty()) measure_image(instant, image, mask, facts);
      keep_sample(instant, image, mask);
      found_.images.push_back(facts);
    }
    return std::move(found_);
  }

 private:
  void open(const Camera& camera) {
    const int index = seen_.file_index[camera_];
    const long expected = instants_.empty() ? 0 : seen_.instants[instants_.back()].row + 1;
    try {
      const std::string source = capture_.source(entry_.videos, index, camera.name);
      per_image_ = has_frame_placeholder(source) || std::filesystem::is_directory(source);
      images_ = open_frames(source, PixelFormat::colour);
      found_.frames = images_->num_frames(expected);
    } catch (const Error& error) {
      found_.error = error.what();
      stopped_ = true;
    }
    if (!entry_.has_masks()) {
      found_.mask_error = "none";
      return;
    }
    try {
      Camera straight = camera;  // masks are compared with keypoints as filmed
      straight.distortion.fill(0.0);
      masks_.emplace(capture_, entry_, straight, index);
      if (entry_.masks.empty()) return;
      const std::string source = capture_.source(entry_.masks, index, camera.name);
      found_.mask_frames = open_masks(capture_, entry_, camera.name, index)->num_frames(expected);
      found_.mask_values = look_at_masks(source);
      found_.mask_threshold = entry_.mask_threshold;
    } catch (const Error& error) {
      found_.mask_error = error.what();
    }
  }

  cv::Mat read_image(long frame) {
    if (stopped_ || (found_.frames >= 0 && frame >= found_.frames)) return {};
    try {
      return images_->read(frame);
    } catch (const Error& error) {
      if (found_.error.empty()) found_.error = error.what();
      found_.missing_images += per_image_;
      stopped_ = !per_image_;
      return {};
    }
  }

  cv::Mat read_mask(long frame, const cv::Mat& image) {
    if (!masks_ || !found_.mask_error.empty() || (masks_->needs_image() && image.empty())) return {};
    if (found_.mask_frames >= 0 && frame >= found_.mask_frames) return {};
    try {
      return masks_->read(frame, image).clone();
    } catch (const Error& error) {
      found_.mask_error = error.what();
      return {};
    }
  }

  /// The person among the detections; null: nobody.
  const SeenPerson* person_at(int instant) const {
    const auto& people = seen_.people[camera_][instant];
    if (people.empty()) return nullptr;
    const int index = rig_ ? rig_->person[camera_][instant] : 0;
    return index < 0 ? nullptr : &people[index];
  }

  void measure_image(int instant, const cv::Mat& image, const cv::Mat& mask, ImageFacts& facts) {
    const SeenPerson* person = person_at(instant);
    cv::Mat region = person ? trunk_of(seen_, *person, image.size()) : cv::Mat();
    if (region.empty() && !mask.empty() && mask.size() == image.size() && cv::countNonZero(mask) > 30) region = mask;
    const Light scene = light_of(image, around_person(person, mask, image.size()));
    const Light on_person = region.empty() ? Light{NAN, NAN, NAN, 0.0} : light_of(image, region);
    facts.exposure = on_person.stops;
    facts.scene_exposure = scene.stops;
    facts.red = on_person.red;
    facts.blue = on_person.blue;
    facts.scene_red = scene.red;
    facts.scene_blue = scene.blue;
    facts.overexposed = on_person.overexposed;
    facts.seconds = images_->seconds();
    if (found_.images.size() % kEdgeEvery == 0) facts.edge_width = edge_width_of(image);
    const cv::Mat small = small_grey(image);
    if (!small_before_.empty() && facts.after_previous)
      facts.change = cv::norm(small, small_before_, cv::NORM_L1) / small.total();
    small_before_ = small;
    const std::size_t stride = std::max<std::size_t>(1, instants_.size() / kMaxSmallImages);
    if (found_.images.size() % stride == 0) {
      found_.small.push_back(small);
      found_.small_instants.push_back(instant);
    }
  }

  /// The image without the person: all that lies outside of the box of points and mask, grown by a fifth of its size.
  static cv::Mat around_person(const SeenPerson* person, const cv::Mat& mask, cv::Size size) {
    Eigen::AlignedBox2d box;
    for (std::size_t k = 0; person && k < person->size(); ++k)
      if ((*person)[k].seen) box.extend((*person)[k].pixel);
    if (mask.size() == size)
      if (const cv::Rect around = cv::boundingRect(mask); !around.empty()) {
        box.extend(Eigen::Vector2d(around.x, around.y));
        box.extend(Eigen::Vector2d(around.x + around.width, around.y + around.height));
      }
    cv::Mat outside(size, CV_8UC1, cv::Scalar(255));
    if (box.isEmpty()) return outside;
    const double margin = 0.2 * box.sizes().maxCoeff();
    const cv::Rect person_box(static_cast<int>(box.min().x() - margin), static_cast<int>(box.min().y() - margin),
                              static_cast<int>(box.sizes().x() + 2.0 * margin),
                              static_cast<int>(box.sizes().y() + 2.0 * margin));
    outside(person_box & cv::Rect({}, size)).setTo(0);
    return 20 * cv::countNonZero(outside) < size.area() ? cv::Mat(size, CV_8UC1, cv::Scalar(255)) : outside;
  }

  void measure_mask(int instant, const cv::Mat& mask, ImageFacts& facts) {
    const MaskFacts mask_facts = inspect_mask(mask);
    facts.mask_area = static_cast<double>(mask_facts.area) / static_cast<double>(mask.total());
    facts.mask_at_border = mask_facts.touches_border;
    const double size = seen_.size[camera_];
    const cv::Mat near = mask_facts.area > 0 ? grown(mask, kMaskReach * size) : mask;
    if (const SeenPerson* person = person_at(instant)) {
      facts.points_on_mask = share_of_points(*person, near);
      facts.bones_on_mask = share_of_bones(*person, mask);
      measure_margins(*person, mask, facts);
    }
    if (rig_ && rig_->nominal.found) {
      facts.body_on_mask = share_of_body(instant, near, rig_->views[camera_]);
      if (rig_->is_exchanged(camera_)) {
        SupposedView calibrated;
        calibrated.camera = seen_.cameras[camera_];
        facts.calibrated_on_mask = share_of_body(instant, near, calibrated);
      }
    }
    try_other_rows(instant, mask);
    measure_flicker(mask, facts);
  }

  static double share_of_points(const SeenPerson& person, const cv::Mat& near) {
    int on = 0, all = 0;
    for (const SeenPoint& point : person) {
      on += point.seen && is_on(near, point.pixel);
      all += point.seen;
    }
    return all == 0 ? -1.0 : static_cast<double>(on) / all;
  }

  /// The keypoints of rows before and after on a mask.
  void try_other_rows(int instant, const cv::Mat& mask) {
    found_.shifted_bones.resize(2 * kMaxKeypointShift + 1);
    const Instant& here = seen_.instants[instant];
    for (int shift = -kMaxKeypointShift; shift <= kMaxKeypointShift; ++shift) {
      const int other = instant + shift;
      if (other < 0 || other >= seen_.num_instants()) continue;
      const Instant& there = seen_.instants[other];
      if (there.sequence != here.sequence || there.row != here.row + shift) continue;
      const SeenPerson* person = person_at(other);
      const double share = person ? share_of_bones(*person, mask) : -1.0;
      if (share < 0.0) continue;
      SharesSum& sum = found_.shifted_bones[static_cast<std::size_t>(shift + kMaxKeypointShift)];
      sum.sum += share;
      ++sum.count;
    }
  }

  double share_of_body(int instant, const cv::Mat& near, const SupposedView& view) const {
    int on = 0, all = 0;
    for (int k = 0; k < seen_.num_points(); ++k) {
      if (!rig_->nominal.body.known(instant, k)) continue;
      const auto pixel = view.pixel(rig_->nominal.body.at(instant, k));
      on += pixel && is_on(near, *pixel);
      ++all;
    }
    return all == 0 ? -1.0 : static_cast<double>(on) / all;
  }

  double share_of_bones(const SeenPerson& person, const cv::Mat& mask) const {
    int on = 0, all = 0;
    for (const auto& [a, b] : seen_.bones) {
      if (!person[a].seen || !person[b].seen) continue;
      for (int i = 1; i < kSamplesPerBone; ++i) {
        const double share = static_cast<double>(i) / kSamplesPerBone;
        on += is_on(mask, (1.0 - share) * person[a].pixel + share * person[b].pixel);
        ++all;
      }
    }
    return all == 0 ? -1.0 : static_cast<double>(on) / all;
  }

  void measure_margins(const SeenPerson& person, const cv::Mat& mask, ImageFacts& facts) const {
    Eigen::AlignedBox2d box;
    for (const SeenPoint& point : person)
      if (point.seen) box.extend(point.pixel);
    const cv::Rect around = cv::boundingRect(largest_component(mask));
    if (box.isEmpty() || around.empty()) return;
    const double size = seen_.size[camera_];
    facts.margins = {(box.min().x() - around.x) / size, (box.min().y() - around.y) / size,
                     (around.x + around.width - box.max().x()) / size,
                     (around.y + around.height - box.max().y()) / size};
    facts.has_margins = true;
  }

  /// The flicker of the mask before this one becomes known with this one.
  void measure_flicker(const cv::Mat& mask, const ImageFacts& facts) {
    const bool consecutive = facts.after_previous && !mask_before_.empty() && mask_before_.size() == mask.size();
    if (consecutive && !mask_two_before_.empty()) {
      const cv::Mat toggled = (mask_before_ ^ mask_two_before_) & (mask_before_ ^ mask);
      const int area = std::max({1, cv::countNonZero(mask_two_before_), cv::countNonZero(mask)});
      found_.images.back().flicker = static_cast<double>(cv::countNonZero(toggled)) / area;
    }
    mask_two_before_ = consecutive ? mask_before_ : cv::Mat();
    mask_before_ = mask;
  }

  void keep_sample(int instant, const cv::Mat& image, const cv::Mat& mask) {
    const bool middle = instant == instants_[instants_.size() / 2];
    if (image.empty() || (!found_.sample.empty() && !middle)) return;
    found_.sample = image.clone();
    found_.sample_mask = mask.clone();
    found_.sample_instant = instant;
  }

  const Capture& capture_;
  const SequenceEntry& entry_;
  const Sightings& seen_;
  int camera_;
  const RigExamination* rig_;
  std::vector<int> instants_;
  std::unique_ptr<FrameReader> images_;
  bool per_image_ = false;  ///< files per frame: one that is missing does not hide the next
  bool stopped_ = false;    ///< no further image can be read
  std::optional<MaskSource> masks_;
  cv::Mat small_before_, mask_before_, mask_two_before_;
  FootageExamination found_;
};

}  // namespace

FootageExamination examine_footage(const Capture& capture, int sequence, const Sightings& seen, int camera,
                                   const RigExamination* rig) {
  return FootageReading(capture, sequence, seen, camera, rig).read();
}

}  // namespace doppel
