#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/character/motion.h"
#include "doppel/character/skeleton.h"
#include "doppel/core/options.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/dataset/batch.h"
#include "doppel/data/prepare/store.h"
#include "doppel/detect/keypoints/keypoints.h"
#include "doppel/detect/masks/mask.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// A sequence of a prepared capture.
struct DatasetSequence {
  std::string name;
  Split split = Split::train;
  Motion motion;                         ///< no frames: the motion is unknown
  long first_frame = 0, last_frame = 0;  ///< motion rows that were prepared, both included
  std::vector<long> cuts;                ///< motion rows that begin a new segment

  long num_frames() const { return last_frame - first_frame + 1; }
  bool has_motion() const { return motion.num_frames() > 0; }
  /// The first row of the segment that contains `frame`. Motion windows do not reach before this row.
  long segment_start(long frame) const;
};

/// A frame of a sequence.
struct SampleId {
  int sequence = 0;
  long frame = 0;
  bool operator==(const SampleId& other) const { return sequence == other.sequence && frame == other.frame; }
};

/// The data of one view for silhouette losses.
struct SilhouetteCrop {
  bool valid = false;  ///< false: the person is not seen (or fills the crop); all other members are empty
  CropBox box;
  int pixels = 0;                      ///< S
  std::vector<std::int16_t> distance;  ///< [S*S] signed distance in 1/steps_per_pixel
  int steps_per_pixel = 1;
  std::vector<ContourPixel> contour;
};

/// The data of one view for photometric losses.
struct ImageCrop {
  bool valid = false;  ///< false: the person is not seen; all other members are empty
  CropBox box;
  int pixels = 0;                        ///< I
  std::vector<std::uint8_t> rgb;         ///< [I*I*3]; black beyond the camera's image
  std::vector<std::uint8_t> foreground;  ///< [I*I] 1 = person; 0 beyond the camera's image
};

/// Training frames to set aside for validation.
struct ValidationFrames {
  std::vector<std::string> sequences;  ///< whole training sequences
  std::vector<int> takes;              ///< segments between the cuts of the other training sequences, counted from 0
  double share = 0.0;                  ///< of every training sequence that is left, its last frames; 0: none
  bool empty() const { return sequences.empty() && takes.empty() && share == 0.0; }
};
void describe_keys(const Keys& keys, ValidationFrames& frames);

/// A prepared capture: poses, cameras, and the store of masks and images. Reading is thread-safe.
class Dataset {
 public:
  /// @param folder output of `doppel prepare`
  /// @throws Error when the folder is not a prepared capture, the preparation has not finished, or the store is damaged
  static Dataset open(const std::filesystem::path& folder);

  const std::filesystem::path& folder() const { return folder_; }
  const Capture& capture() const { return capture_; }
  std::filesystem::path character_path() const { return capture_.character_path(); }
  int num_dofs() const { return num_dofs_; }
  double fps() const { return capture_.fps; }

  /// The prepared cameras. All camera indices refer to this list.
  const std::vector<PinholeCamera>& cameras() const { return cameras_; }
  const PinholeCamera& camera(int index) const { return cameras_.at(index); }
  /// @throws UsageError listing the available cameras
  int camera_index(const std::string& name) const;
  /// The indices of the named cameras; of all cameras when `names` is empty.
  std::vector<int> camera_indices(const std::vector<std::string>& names) const;

  const std::vector<DatasetSequence>& sequences() const { return sequences_; }
  /// The samples of a split, ordered by sequence and frame. @param every take every n-th frame of a sequence
  std::vector<SampleId> samples(Split split, int every = 1) const;

  /// Moves the last `share` of every training sequence to another split. Affects this object only.
  /// @throws UsageError when no frame is left for training, or for the other split
  void hold_out(double share, Split split);
  /// Moves training frames to the validation split. Affects this object only.
  /// @throws UsageError for a sequence or take that is not one of the training, or when no training frame is left
  void hold_out(const ValidationFrames& frames);

  /// The landmarks of the prepared keypoints, [M]; none when the capture had no keypoints.
  const std::vector<Marker>& landmarks() const { return landmarks_; }
  /// @throws UsageError when there are none; the message says how to prepare keypoints
  void require_landmarks() const;
  /// The keypoints of a view: [M] in the order of `landmarks()`, pixels of the image without distortion.
  std::vector<Keypoint> keypoints(const SampleId& sample, int camera) const;

  /// A checksum of cameras, motions and the cropped masks of some samples.
  std::uint32_t checksum() const;

  int mask_size() const { return mask_size_; }
  int image_size() const { return image_size_; }
  /// The side of the images for a requested side `pixels`; 0 means as stored.
  /// @throws UsageError when `pixels` is negative or more than stored
  int image_pixels(int pixels) const;

  /// The motion window: motion rows frame - past_frames .. frame as float32 [past_frames+1, D], oldest first. Where the
  /// segment has no earlier row, its first row is repeated (thesis 6.9). @throws Error when the sequence was prepared
  /// without a motion
  torch::Tensor dof_window(const SampleId& sample, int past_frames) const;
  /// The motion windows of several samples: [B,past_frames+1,D]. @throws as above
  torch::Tensor dof_windows(const std::vector<SampleId>& samples, int past_frames) const;

  /// The mask of the whole image, 0 or 255, at the camera's resolution.
  cv::Mat mask(const SampleId& sample, int camera) const;
  /// The square window of the cropped masks and images; empty when the person is not seen.
  CropBox crop_box(const SampleId& sample, int camera) const;
  /// The cropped mask [S,S]; empty when the person is not seen.
  cv::Mat crop_mask(const SampleId& sample, int camera) const;
  /// The cropped image, BGR [I,I], I = image_size(); empty when the person is not seen.
  cv::Mat crop_image(const SampleId& sample, int camera) const;
  /// The cropped image and its mask at one resolution. The mask is cropped from the mask of the whole image.
  /// @param pixels side; 0: as stored
  /// @throws UsageError as image_pixels
  ImageCrop image(const SampleId& sample, int camera, int pixels = 0) const;
  /// The empty studio, BGR, at the camera's resolution and without distortion; empty when the capture has none.
  /// @throws FileError when the image is missing or has another size
  cv::Mat background(int camera) const;
  /// Distance field and contour pixels of the cropped mask.
  SilhouetteCrop silhouette(const SampleId& sample, int camera) const;

 private:
  Dataset() = default;
  void hold_out_takes(const std::vector<int>& takes);
  cv::Mat decode_image(const FrameRecord& found, const SampleId& sample, int camera) const;
  FrameRecord record(const SampleId& sample, int camera) const;
  std::string key(const SampleId& sample, int camera) const;

  std::filesystem::path folder_;
  Capture capture_;
  std::vector<PinholeCamera> cameras_;
  std::vector<int> file_index_;  ///< [C] position of each camera in the calibration file
  std::vector<DatasetSequence> sequences_;
  std::vector<Marker> landmarks_;
  std::shared_ptr<Store> store_;
  int num_dofs_ = 0, mask_size_ = 0, image_size_ = 0;
};

/// The samples of a split with these frames; all samples of the split when `frames` is empty.
/// @throws UsageError for a frame that no sequence of the split has; Error when the split has no samples
std::vector<SampleId> chosen_samples(const Dataset& dataset, Split split, const std::vector<long>& frames);

}  // namespace doppel
