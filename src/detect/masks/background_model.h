#pragma once

#include <memory>
#include <opencv2/core.hpp>

namespace doppel {

/// Settings of background subtraction.
struct BackgroundOptions {
  double threshold = 4.0;  ///< largest distance of a background colour from the learnt colours, standard deviations
  /// A darker shade of a learnt colour counts as shadow, and so as background, down to this share of its brightness.
  /// With 1, shadows count as the person.
  double shadow = 0.5;
  bool refine = true;  ///< move the outline to the edges of the image; takes most of the time
};

/// A model of the empty scene in one static camera. The model learns from images of the empty scene (a mixture of
/// Gaussians per pixel), then segments one person in other images without learning from them. A mask does not depend on
/// earlier images: the same image always gives the same mask. Not thread-safe.
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
  BackgroundModel(const BackgroundModel&) = delete;
  BackgroundModel& operator=(const BackgroundModel&) = delete;
  BackgroundModel(BackgroundModel&&) noexcept;
  BackgroundModel& operator=(BackgroundModel&&) noexcept;

  /// Learns from an image of the empty scene, 8-bit BGR. All images have the same weight. One image suffices; a dozen
  /// or more also show the noise of the sensor.
  /// @throws UsageError after the first mask; Error when the size or the type differs from the images before
  void learn(const cv::Mat& image);

  /// The mask of the person in an image: 255 on the person, 0 elsewhere. Only the largest connected part is kept. The
  /// mask is empty when this part is too small to be a person.
  /// 1. The exposure is matched to that of the empty scene, channel by channel. The background may be up to a quarter
  ///    brighter or darker.
  /// 2. Pixels that match neither the learnt colours nor a shadow of them belong to the person; gaps are closed.
  /// 3. With `refine`, a graph cut (GrabCut) between certain foreground and certain background moves the outline to the
  ///    edges of the image. The cut recovers parts of the person that step 2 took for shadow, and removes halos.
  /// @throws UsageError before the first `learn`; Error for another size or type
  cv::Mat mask(const cv::Mat& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
