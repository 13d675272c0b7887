#include "doppel/data/dataset/dataset.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/calibration/formats/relative_intrinsics.h"
#include "doppel/character/character.h"
#include "doppel/core/as_size.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/prepare/store_layout.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr long kCheckedFrames = 16;  // of a sequence, whose masks a checksum reads

/// The finest power-of-two step for which distances up to the window's diagonal fit into 16 bits.
int distance_steps(int pixels) {
  const double longest = std::sqrt(2.0) * pixels;
  int steps = 256;
  while (steps > 1 && longest * steps > 32000.0) steps /= 2;
  return steps;
}

std::vector<std::int16_t> quantise(const cv::Mat& distance, int steps) {
  std::vector<std::int16_t> result(distance.total());
  const float* from = distance.ptr<float>();
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = static_cast<std::int16_t>(std::lrintf(from[i] * steps));
  return result;
}

/// The contour pixels of a crop except those at or beyond the image border, where the body is cut off.
std::vector<ContourPixel> contour_in_image(const cv::Mat& mask, const CropBox& box, cv::Size image) {
  const double scale = box.image_pixels_per_pixel(mask.cols);
  std::vector<ContourPixel> contour = contour_pixels(mask);
  const auto beyond = [&](const ContourPixel& pixel) {
    const double u = box.u0 + (pixel.x + 0.5) * scale, v = box.v0 + (pixel.y + 0.5) * scale;
    return u < 1.0 || v < 1.0 || u > image.width - 1.0 || v > image.height - 1.0;
  };
  contour.erase(std::remove_if(contour.begin(), contour.end(), beyond), contour.end());
  return contour;
}

/// Clears the mask beyond the camera's image, where the crop repeats border pixels.
void clear_beyond_image(cv::Mat& mask, const CropBox& box, cv::Size image) {
  const double scale = box.image_pixels_per_pixel(mask.cols);
  for (int i = 0; i < mask.cols; ++i) {
    const double u = box.u0 + (i + 0.5) * scale, v = box.v0 + (i + 0.5) * scale;
    if (u < 0.0 || u > image.width) mask.col(i).setTo(0);
    if (v < 0.0 || v > image.height) mask.row(i).setTo(0);
  }
}

/// Camera `index` of the calibration file at a given resolution, with its distortion.
Camera calibrated_camera(const Capture& capture, int index, int width, int height) {
  const std::vector<Camera> all = calibrated_cameras(capture);
  if (index < 0 || index >= static_cast<int>(all.size()))
    fail("{} has {} cameras; the capture was prepared with more", capture.calibration, all.size());
  const Camera& camera = all[index];
  if (camera.width == 0) return with_image_size(camera, width, height);
  return camera.width == width && camera.height == height ? camera : camera.scaled_to(width, height);
}

DatasetSequence make_sequence(const SequenceEntry& entry, const Capture& capture, int num_dofs) {
  DatasetSequence sequence;
  sequence.name = entry.name;
  sequence.split = entry.split;
  if (!entry.motion.empty()) sequence.motion = read_motion(capture.resolve(entry.motion), num_dofs);
  sequence.first_frame = entry.first_frame;
  sequence.last_frame = entry.last_frame.value_or(sequence.motion.num_frames() - 1);
  sequence.cuts = entry.cuts;
  if (entry.motion.empty() && !entry.last_frame)
    fail("{}: the sequence {} has neither a motion nor a last_frame; prepare it again with --overwrite",
         capture.file.string(), entry.name);
  if (sequence.has_motion() && sequence.last_frame >= sequence.motion.num_frames())
    fail("{}: the motion {} has {} rows, but the capture was prepared up to row {}; prepare it again with --overwrite",
         capture.file.string(), entry.motion, sequence.motion.num_frames(), sequence.last_frame);
  return sequence;
}

/// Landmarks name joints of the character by index, and motions hold one number per DoF: with another character than
/// that of the preparation they would mean something else. Stores of versions without a fingerprint are checked by
/// their counts.
void check_skeleton(const StoreLayout& layout, const Capture& capture, const fs::path& folder) {
  const fs::path path = capture.character_path();
  const Skeleton skeleton = read_character_skeleton(path);
  bool same = layout.num_dofs == skeleton.num_dofs();
  for (const Marker& landmark : layout.landmarks) same = same && landmark.joint < skeleton.num_joints();
  if (!layout.skeleton.empty()) same = same && layout.skeleton == fingerprint_of(skeleton);
  if (!same)
    fail(
        "{} was prepared for a character of {} DoFs whose joints or DoFs are not those of {} (now {} DoFs, {} joints); "
        "put the character of the preparation back, or prepare the capture again with --overwrite",
        folder.string(), layout.num_dofs, path.string(), skeleton.num_dofs(), skeleton.num_joints());
}

/// The prepared capture.yaml lists the cameras in the order of the store.
void check_camera_names(const StoreLayout& layout, const Capture& capture) {
  std::string stored;
  for (const PinholeCamera& camera : layout.cameras) stored += (stored.empty() ? "" : ", ") + camera.name;
  const std::string named = fmt::format("{}", fmt::join(capture.cameras, ", "));
  if (!capture.cameras.empty() && named != stored)
    fail("{}: `cameras` are {}, but those of the store are {}; name these, or prepare the capture again",
         capture.file.string(), named, stored);
}

/// The names of the sequences of a split, for a message.
std::string names_of(const std::vector<DatasetSequence>& sequences, Split split) {
  std::string names;
  for (const DatasetSequence& sequence : sequences)
    if (sequence.split == split) names += (names.empty() ? "" : ", ") + sequence.name;
  return names.empty() ? "none" : names;
}

}  // namespace

long DatasetSequence::segment_start(long frame) const {
  const auto after = std::upper_bound(cuts.begin(), cuts.end(), frame);
  return after == cuts.begin() ? 0 : *(after - 1);
}

Dataset Dataset::open(const fs::path& folder) {
  if (!fs::exists(folder / "capture.yaml") || !fs::is_directory(folder / kStoreFolder))
    fail<UsageError>(
        "{} is not a prepared capture: it must hold capture.yaml and {}/; `doppel prepare CAPTURE --out {}` makes one",
        folder.string(), kStoreFolder, folder.string());
  Dataset dataset;
  dataset.folder_ = folder;
  dataset.store_ = std::make_shared<Store>(folder / kStoreFolder, Store::Mode::read);
  const StoreLayout layout = read_store_layout(*dataset.store_);
  if (!layout.complete)
    fail("{}: the preparation has not finished; run `doppel prepare` again to continue it", folder.string());
  dataset.capture_ = read_capture(folder);
  check_skeleton(layout, dataset.capture_, folder);
  check_camera_names(layout, dataset.capture_);
  dataset.cameras_ = layout.cameras;
  dataset.file_index_ = layout.file_index;
  dataset.num_dofs_ = layout.num_dofs;
  dataset.mask_size_ = layout.mask_size;
  dataset.image_size_ = layout.image_size;
  dataset.landmarks_ = layout.landmarks;
  for (const SequenceEntry& entry : dataset.capture_.sequences)
    dataset.sequences_.push_back(make_sequence(entry, dataset.capture_, layout.num_dofs));
  return dataset;
}

int Dataset::camera_index(const std::string& name) const {
  std::string names;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    if (cameras_[i].name == name) return static_cast<int>(i);
    names += (i ? ", " : "") + cameras_[i].name;
  }
  fail<UsageError>("there is no camera '{}' in {}; there are {}", name, folder_.string(), names);
}

std::vector<int> Dataset::camera_indices(const std::vector<std::string>& names) const {
  std::vector<int> indices;
  for (const std::string& name : names) {
    indices.push_back(camera_index(name));
    if (std::count(indices.begin(), indices.end(), indices.back()) > 1)
      fail<UsageError>("camera {} is named twice; name each camera once", name);
  }
  if (names.empty())
    for (std::size_t i = 0; i < cameras_.size(); ++i) indices.push_back(static_cast<int>(i));
  return indices;
}

std::uint32_t Dataset::checksum() const {
  std::uint32_t sum = 0;
  const auto add = [&](const void* data, std::size_t bytes) { sum = crc32c(data, bytes, sum); };
  for (const PinholeCamera& camera : cameras_) {
    add(camera.K.data(), sizeof(double) * 9);
    add(camera.R.data(), sizeof(double) * 9);
    add(camera.t.data(), sizeof(double) * 3);
  }
  std::size_t checked = 0;  // masks; the cameras take turns
  for (std::size_t s = 0; s < sequences_.size(); ++s) {
    const DatasetSequence& sequence = sequences_[s];
    for (const std::vector<double>& row : sequence.motion.frames) add(row.data(), row.size() * sizeof(double));
    const long step = std::max(1L, sequence.num_frames() / kCheckedFrames);
    for (long frame = sequence.first_frame; frame <= sequence.last_frame; frame += step) {
      const auto camera = static_cast<int>(checked++ % cameras_.size());
      const cv::Mat mask = crop_mask({static_cast<int>(s), frame}, camera);
      add(mask.data, mask.total());
    }
  }
  return sum;
}

std::vector<SampleId> Dataset::samples(Split split, int every) const {
  if (every < 1) fail<UsageError>("every {}th frame cannot be taken; the step must be at least 1", every);
  std::vector<SampleId> result;
  for (std::size_t i = 0; i < sequences_.size(); ++i)
    if (sequences_[i].split == split)
      for (long frame = sequences_[i].first_frame; frame <= sequences_[i].last_frame; frame += every)
        result.push_back({static_cast<int>(i), frame});
  return result;
}

void describe_keys(const Keys& keys, ValidationFrames& frames) {
  keys("sequences", frames.sequences, "whole training sequences that choose checkpoints");
  keys("takes", frames.takes, "segments between the cuts of the other training sequences, counted from 0");
  keys("share", frames.share, between(0.0, 0.9), "of every other training sequence, its last frames; 0: none");
}

/// Splits the training sequences at their cuts and moves some of the segments.
void Dataset::hold_out_takes(const std::vector<int>& takes) {
  std::vector<DatasetSequence> segments, others;
  for (const DatasetSequence& sequence : sequences_) {
    if (sequence.split != Split::train) {
      others.push_back(sequence);
      continue;
    }
    DatasetSequence segment = sequence;
    for (const long cut : sequence.cuts) {
      if (cut <= segment.first_frame || cut > sequence.last_frame) continue;
      segment.last_frame = cut - 1;
      segments.push_back(segment);
      segment.first_frame = cut;
      segment.last_frame = sequence.last_frame;
    }
    segments.push_back(segment);
  }
  if (segments.empty()) fail<UsageError>("validation: {} has no training sequence left for takes", folder_.string());
  for (const int take : takes) {
    if (take < 0 || as_size(take) >= segments.size())
      fail<UsageError>("validation: there is no take {}; the training sequences of {} have takes 0 to {}", take,
                       folder_.string(), segments.size() - 1);
    segments[take].split = Split::validation;
  }
  segments.insert(segments.end(), others.begin(), others.end());
  sequences_ = std::move(segments);
}

void Dataset::hold_out(const ValidationFrames& frames) {
  for (const std::string& name : frames.sequences) {
    const auto found = std::find_if(sequences_.begin(), sequences_.end(), [&](const DatasetSequence& sequence) {
      return sequence.name == name && sequence.split == Split::train;
    });
    if (found == sequences_.end())
      fail<UsageError>("validation: {} has no training sequence \"{}\"; it has {}", folder_.string(), name,
                       names_of(sequences_, Split::train));
    found->split = Split::validation;
  }
  if (!frames.takes.empty()) hold_out_takes(frames.takes);
  if (!(frames.sequences.empty() && frames.takes.empty()) && samples(Split::train).empty())
    fail<UsageError>("validation: all training sequences of {} are set aside; leave at least one to train on",
                     folder_.string());
  if (frames.share > 0.0) hold_out(frames.share, Split::validation);
}

void Dataset::hold_out(double share, Split split) {
  std::vector<DatasetSequence> held_out;
  for (DatasetSequence& sequence : sequences_) {
    if (sequence.split != Split::train) continue;
    const long held = std::lround(share * static_cast<double>(sequence.num_frames()));
    if (held < 1 || held >= sequence.num_frames())
      fail<UsageError>("{}: of the {} frames of sequence {}, a share of {} cannot be held out", folder_.string(),
                       sequence.num_frames(), sequence.name, share);
    held_out.push_back(sequence);
    held_out.back().split = split;
    held_out.back().first_frame = sequence.last_frame - held + 1;
    sequence.last_frame -= held;
  }
  if (held_out.empty()) fail<UsageError>("{}: there is no sequence to train on", folder_.string());
  sequences_.insert(sequences_.end(), held_out.begin(), held_out.end());
}

torch::Tensor Dataset::dof_window(const SampleId& sample, int past_frames) const {
  const DatasetSequence& sequence = sequences_.at(sample.sequence);
  if (!sequence.has_motion())
    fail("{}: the sequence {} was prepared without a motion, but poses are needed; run `doppel track {}`",
         folder_.string(), sequence.name, folder_.string());
  const long start = sequence.segment_start(sample.frame);
  torch::Tensor result = torch::empty({past_frames + 1, num_dofs_}, torch::kFloat32);
  float* to = result.data_ptr<float>();
  for (int i = 0; i <= past_frames; ++i) {
    const std::vector<double>& row = sequence.motion.frames.at(std::max(sample.frame - past_frames + i, start));
    to = std::transform(row.begin(), row.end(), to, [](double value) { return static_cast<float>(value); });
  }
  return result;
}

torch::Tensor Dataset::dof_windows(const std::vector<SampleId>& samples, int past_frames) const {
  std::vector<torch::Tensor> windows;
  for (const SampleId& sample : samples) windows.push_back(dof_window(sample, past_frames));
  return torch::stack(windows);
}

std::string Dataset::key(const SampleId& sample, int camera) const {
  return record_key(sequences_.at(sample.sequence).name, cameras_.at(camera).name, sample.frame);
}

FrameRecord Dataset::record(const SampleId& sample, int camera) const {
  const std::string name = key(sample, camera);
  const std::optional<std::string> bytes = store_->get(name);
  if (!bytes) fail("{}: the store has no record {}; the frame was not prepared", folder_.string(), name);
  return decode_record(*bytes, folder_.string() + ": " + name);
}

cv::Mat Dataset::mask(const SampleId& sample, int camera) const {
  const FrameRecord found = record(sample, camera);
  return decode_mask(found.full_mask, {found.width, found.height}, key(sample, camera));
}

CropBox Dataset::crop_box(const SampleId& sample, int camera) const {
  const std::string name = key(sample, camera);
  const std::optional<std::string> bytes = store_->get_head(name, kRecordHeadBytes);
  if (!bytes) fail("{}: the store has no record {}; the frame was not prepared", folder_.string(), name);
  return decode_record_head(*bytes, name).box;
}

cv::Mat Dataset::crop_mask(const SampleId& sample, int camera) const {
  const FrameRecord found = record(sample, camera);
  if (found.box.empty()) return {};
  return decode_mask(found.crop_mask, {found.mask_size, found.mask_size}, key(sample, camera));
}

cv::Mat Dataset::decode_image(const FrameRecord& found, const SampleId& sample, int camera) const {
  const cv::Mat bytes(1, static_cast<int>(found.crop_image.size()), CV_8U, const_cast<char*>(found.crop_image.data()));
  const cv::Mat image = cv::imdecode(bytes, cv::IMREAD_COLOR);
  if (image.size() != cv::Size(found.image_size, found.image_size))
    fail("{}: the image of {} cannot be decoded; the store is damaged", folder_.string(), key(sample, camera));
  return image;
}

cv::Mat Dataset::crop_image(const SampleId& sample, int camera) const {
  const FrameRecord found = record(sample, camera);
  return found.box.empty() ? cv::Mat() : decode_image(found, sample, camera);
}

int Dataset::image_pixels(int pixels) const {
  if (pixels < 0 || pixels > image_size_)
    fail<UsageError>(
        "images of {} pixels per side are requested, but {} was prepared with {}; request at most that, or prepare it "
        "again with --image-size {}",
        pixels, folder_.string(), image_size_, pixels);
  return pixels == 0 ? image_size_ : pixels;
}

ImageCrop Dataset::image(const SampleId& sample, int camera, int pixels) const {
  ImageCrop crop;
  crop.pixels = image_pixels(pixels);
  const FrameRecord found = record(sample, camera);
  if (found.box.empty()) return crop;
  crop.valid = true;
  crop.box = found.box;
  cv::Mat image = decode_image(found, sample, camera), mask;
  if (image.cols != crop.pixels) cv::resize(image, image, {crop.pixels, crop.pixels}, 0.0, 0.0, cv::INTER_AREA);
  crop.rgb.resize(3 * image.total());
  cv::Mat rgb(crop.pixels, crop.pixels, CV_8UC3, crop.rgb.data());
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  const cv::Mat whole = decode_mask(found.full_mask, {found.width, found.height}, key(sample, camera));
  mask = doppel::crop_mask(whole, found.box, crop.pixels);
  clear_beyond_image(mask, found.box, whole.size());
  crop.foreground.resize(mask.total());
  cv::Mat foreground(mask.size(), CV_8U, crop.foreground.data());
  cv::min(mask, 1, foreground);
  return crop;
}

cv::Mat Dataset::background(int camera) const {
  if (capture_.background.empty()) return {};
  const Camera& pinhole = cameras_.at(camera);
  const fs::path path = capture_.resolve(expand_camera(capture_.background, file_index_.at(camera), pinhole.name));
  const cv::Mat image = read_colour_image(path);
  if (image.cols != pinhole.width || image.rows != pinhole.height)
    fail_at({path, 0}, "the image of the empty studio is {}x{}, camera {} is {}x{}; they must be equal", image.cols,
            image.rows, pinhole.name, pinhole.width, pinhole.height);
  return Undistorter(calibrated_camera(capture_, file_index_.at(camera), pinhole.width, pinhole.height)).apply(image);
}

SilhouetteCrop Dataset::silhouette(const SampleId& sample, int camera) const {
  const FrameRecord found = record(sample, camera);
  SilhouetteCrop crop;
  if (found.box.empty()) return crop;
  const cv::Mat mask = decode_mask(found.crop_mask, {found.mask_size, found.mask_size}, key(sample, camera));
  const int area = cv::countNonZero(mask);
  if (area == 0 || area == static_cast<int>(mask.total())) return crop;
  crop.valid = true;
  crop.box = found.box;
  crop.pixels = found.mask_size;
  crop.steps_per_pixel = distance_steps(found.mask_size);
  crop.distance = quantise(signed_distance(mask), crop.steps_per_pixel);
  crop.contour = contour_in_image(mask, found.box, {found.width, found.height});
  return crop;
}

void Dataset::require_landmarks() const {
  if (landmarks_.empty())
    fail<UsageError>(
        "{} was prepared without keypoints; name `keypoints` and `landmarks` in the original capture.yaml "
        "(docs/capture.md) and prepare it again with --overwrite",
        folder_.string());
}

std::vector<Keypoint> Dataset::keypoints(const SampleId& sample, int camera) const {
  require_landmarks();
  const std::string name = keypoints_key(sequences_.at(sample.sequence).name, cameras_.at(camera).name, sample.frame);
  const std::optional<std::string> bytes = store_->get(name);
  if (!bytes) fail("{}: the store has no {}; the frame was not prepared", folder_.string(), name);
  return decode_keypoints(*bytes, landmarks_.size(), folder_.string() + ": " + name);
}

std::vector<SampleId> chosen_samples(const Dataset& dataset, Split split, const std::vector<long>& frames) {
  const std::vector<SampleId> all = dataset.samples(split);
  if (all.empty())
    fail("{}: no sequence has `split: {}`, so there is nothing to load", dataset.folder().string(), to_string(split));
  if (frames.empty()) return all;
  const auto is_chosen = [&](const SampleId& sample) {
    return std::find(frames.begin(), frames.end(), sample.frame) != frames.end();
  };
  for (long frame : frames)
    if (std::none_of(all.begin(), all.end(), [&](const SampleId& sample) { return sample.frame == frame; }))
      fail<UsageError>("frames: no sequence with `split: {}` has a frame {}; the first has {} to {}", to_string(split),
                       frame, dataset.sequences()[all.front().sequence].first_frame,
                       dataset.sequences()[all.front().sequence].last_frame);
  std::vector<SampleId> chosen;
  std::copy_if(all.begin(), all.end(), std::back_inserter(chosen), is_chosen);
  return chosen;
}

}  // namespace doppel
