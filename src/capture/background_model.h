#pragma once

#include <memory>
#include <opencv2/core.hpp>

namespace doppel {

/// How to tell the person from what the camera saw before the person came.
struct BackgroundOptions {
  double threshold = 4.0;  ///< how far a colour may lie from those learnt, standard deviations
  /// A darker shade of what was learnt is a shadow, and so background, down to this share of its brightness; 1: shadows
  /// count as the person.
  double shadow = 0.5;
  bool refine = true;  ///< lay the outline along the image's own edges; takes most of the time
};

/// The empty scene of one camera that stands still: learns from empty images (a mixture of Gaussians per pixel), then
/// cuts one person out of others without learning any more. Images are independent of each other, and the same
/// image always gives the same mask. Not thread-safe.
///
/// Usage:
/// @code
///   BackgroundModel model;
///   for (long f = 0; f < 20; ++f) model.learn(video->read(f));
///   cv::Mat mask = model.mask(video->read(20));
/// @endcode
class BackgroundModel {
 public:
  /// @throws UsageError for a threshold that is not positive, or a shadow that is not in (0, 1]
  explicit BackgroundModel(const BackgroundOptions& options = {});
  ~BackgroundModel();
  BackgroundModel(BackgroundModel&&) noexcept;
  BackgroundModel& operator=(BackgroundModel&&) noexcept;

  /// Learns from an empty image, 8-bit BGR; all weigh the same. A dozen or more show the sensor's noise, one will do.
  /// @throws UsageError after the first mask; Error when the size or the type differs from the images before
  void learn(const cv::Mat& image);
  int num_learnt() const;

  /// The person in an image: 255, elsewhere 0; of several parts the largest, and nothing where it is a mere speck.
  /// 1. The exposure is brought to that of the empty images, channel by channel: the background may have become up to
  ///    a quarter brighter or darker.
  /// 2. Pixels that fit neither what was learnt nor a shadow of it are the person; gaps are closed.
  /// 3. With `refine`, a graph cut (GrabCut) between what is surely the person and what surely is not moves the outline
  ///    to the image's edges. It brings back what step 2 took for a shadow, and drops halos.
  /// @throws UsageError before anything was learnt; Error for another size or type
  cv::Mat mask(const cv::Mat& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
