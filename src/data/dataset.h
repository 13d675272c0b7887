#pragma once

#include <torch/torch.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/data/batch.h"
#include "doppel/capture/capture.h"
#include "doppel/capture/keypoints.h"
#include "doppel/capture/mask.h"
#include "doppel/capture/store.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A sequence of a prepared capture.
struct DatasetSequence {
  std::string name;
  Split split = Split::train;
  Motion motion;                         ///< without frames: none is known
  long first_frame = 0, last_frame = 0;  ///< motion rows that were prepared, both included
  std::vector<long> cuts;                ///< motion rows that begin a new segment

  long num_frames() const { return last_frame - first_frame + 1; }
  bool has_motion() const { return motion.num_frames() > 0; }
  /// The first row of the segment that `frame` belongs to: history never goes before it.
  long segment_start(long frame) const;
};

/// A frame of a sequence.
struct SampleId {
  int sequence = 0;
  long frame = 0;
  bool operator==(const SampleId& other) const { return sequence == other.sequence && frame == other.frame; }
};

/// What a silhouette loss needs of one camera at one frame.
struct SilhouetteCrop {
  bool valid = false;  ///< false: the person is not seen (or fills the window), everything else is empty
  CropBox box;
  int pixels = 0;                      ///< S
  std::vector<std::int16_t> distance;  ///< [S*S] signed distance in 1/steps_per_pixel
  int steps_per_pixel = 1;
  std::vector<ContourPixel> contour;
};

/// What a photometric loss needs of one camera at one frame.
struct ImageCrop {
  bool valid = false;  ///< false: the person is not seen, everything else is empty
  CropBox box;
  int pixels = 0;                        ///< I
  std::vector<std::uint8_t> rgb;         ///< [I*I*3]; black beyond the camera's image
  std::vector<std::uint8_t> foreground;  ///< [I*I] 1 = person; 0 beyond the camera's image
};

/// A prepared capture: poses, cameras without distortion, and the store of masks and images. Reading is thread-safe.
class Dataset {
 public:
  /// @param folder what `doppel prepare` wrote
  /// @throws Error when it is not a prepared folder, the preparation has not finished, or the store is damaged
  static Dataset open(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }
  const Capture& capture() const { return capture_; }
  std::filesystem::path character_path() const { return capture_.character_path(); }
  int num_dofs() const { return num_dofs_; }
  double fps() const { return capture_.fps; }

  /// The prepared cameras, without distortion. Indices of cameras everywhere count in this list.
  const std::vector<Camera>& cameras() const { return cameras_; }
  const Camera& camera(int index) const { return cameras_.at(index); }
  /// @throws UsageError listing the cameras there are
  int camera_index(const std::string& name) const;
  /// Indices of the named cameras, of all when `names` is empty.
  std::vector<int> camera_indices(const std::vector<std::string>& names) const;

  const std::vector<DatasetSequence>& sequences() const { return sequences_; }
  /// All frames of a split, by sequence and frame. @param every take each n-th frame of a sequence
  std::vector<SampleId> samples(Split split, int every = 1) const;

  /// Takes the last `share` of every sequence of the training split into the test split, in this object alone.
  /// @throws UsageError when that leaves nothing to train on, or nothing to test
  void hold_out(double share);

  /// The landmarks that keypoints were prepared for: [M], none when the capture had no keypoints.
  const std::vector<Marker>& landmarks() const { return landmarks_; }
  /// @throws UsageError that says how to prepare keypoints when there are none
  void require_landmarks() const;
  /// What was detected: [M] in the order of `landmarks()`, pixels of the image without distortion.
  std::vector<Keypoint> keypoints(const SampleId& sample, int camera) const;

  int mask_size() const { return mask_size_; }
  int image_size() const { return image_size_; }
  /// The side that images come with when `pixels` is asked for: 0 means as stored.
  /// @throws UsageError when `pixels` is negative or more than stored
  int image_pixels(int pixels) const;

  /// Motion rows frame-window .. frame as float32 [window+1, D], oldest first. Where the segment has no earlier row
  /// its first is repeated (thesis 6.9). @throws Error when the sequence was prepared without a motion
  torch::Tensor dof_window(const SampleId& sample, int past_frames) const;

  /// The whole mask, 0 or 255, at the camera's resolution.
  cv::Mat mask(const SampleId& sample, int camera) const;
  /// The square window that crop masks and images show; empty when nothing of the person is seen.
  CropBox crop_box(const SampleId& sample, int camera) const;
  /// The mask's window [S,S]; empty when nothing of the person is seen.
  cv::Mat crop_mask(const SampleId& sample, int camera) const;
  /// The image's window, BGR, image_size squared; empty when nothing of the person is seen.
  cv::Mat crop_image(const SampleId& sample, int camera) const;
  /// ReportImage and mask of the window at one resolution; the mask is cut from the whole one.
  /// @param pixels side; 0: as stored
  /// @throws UsageError as image_pixels
  ImageCrop image(const SampleId& sample, int camera, int pixels = 0) const;
  /// The empty studio, BGR, at the camera's resolution and without distortion; empty when the capture has none.
  /// @throws FileError when the image is missing or has another size
  cv::Mat background(int camera) const;
  /// Distance transform and contour of the mask's window.
  SilhouetteCrop silhouette(const SampleId& sample, int camera) const;

 private:
  Dataset() = default;
  cv::Mat decode_image(const FrameRecord& found, const SampleId& sample, int camera) const;
  FrameRecord record(const SampleId& sample, int camera) const;
  std::string key(const SampleId& sample, int camera) const;

  std::filesystem::path folder_;
  Capture capture_;
  std::vector<Camera> cameras_;
  std::vector<int> file_index_;  ///< [C] position of each camera in the calibration file
  std::vector<DatasetSequence> sequences_;
  std::vector<Marker> landmarks_;
  std::shared_ptr<Store> store_;
  int num_dofs_ = 0, mask_size_ = 0, image_size_ = 0;
};

/// The samples of a split with these frames, all of them without any.
/// @throws UsageError for a frame that no sequence of the split has; Error when the split has no samples
std::vector<SampleId> chosen_samples(const Dataset& dataset, Split split, const std::vector<long>& frames);

}  // namespace doppel
