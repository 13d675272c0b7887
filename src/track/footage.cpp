#include "doppel/track/footage.h"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "doppel/capture/capture_cameras.h"
#include "doppel/capture/capture_layouts.h"
#include "doppel/capture/evidence.h"
#include "doppel/capture/mask_source.h"
#include "doppel/capture/video.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/dataset.h"
#include "doppel/keypoints/keypoint_source.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

// ---- a prepared capture ----

class PreparedReader : public FootageReader {
 public:
  PreparedReader(const Dataset& dataset, int sequence, int outline_pixels)
      : dataset_(dataset), sequence_(sequence), outline_pixels_(outline_pixels) {}

  FootageFrame read(long frame, bool images) override {
    FootageFrame result;
    const SampleId sample{sequence_, frame};
    for (int c = 0; c < static_cast<int>(dataset_.cameras().size()); ++c) {
      result.masks.push_back(dataset_.mask(sample, c));
      result.evidence.push_back({dataset_.keypoints(sample, c), OutlineField(result.masks.back(), outline_pixels_)});
      if (images) result.images.push_back(image(frame, c));
    }
    return result;
  }

  /// Puts the stored window at its position in the image; the rest is not stored.
  cv::Mat image(long frame, int camera) override {
    const SampleId sample{sequence_, frame};
    const CropBox box = dataset_.crop_box(sample, camera);
    const PinholeCamera& seen = dataset_.camera(camera);
    cv::Mat whole(seen.height, seen.width, CV_8UC3, cv::Scalar::all(0));
    const cv::Mat crop = box.empty() ? cv::Mat() : dataset_.crop_image(sample, camera);
    if (crop.empty()) return whole;
    cv::Mat window;
    cv::resize(crop, window, {box.side, box.side}, 0.0, 0.0, cv::INTER_AREA);
    const cv::Rect place = cv::Rect(box.u0, box.v0, box.side, box.side) & cv::Rect({}, whole.size());
    window(place - cv::Point(box.u0, box.v0)).copyTo(whole(place));
    return whole;
  }

 private:
  const Dataset& dataset_;
  int sequence_, outline_pixels_;
};

class PreparedFootage : public Footage {
 public:
  PreparedFootage(const fs::path& folder, int outline_pixels)
      : dataset_(Dataset::open(folder)),
        character_(load_character(dataset_.character_path())),
        outline_pixels_(outline_pixels) {
    dataset_.require_landmarks();
    for (std::size_t i = 0; i < dataset_.sequences().size(); ++i) {
      const DatasetSequence& sequence = dataset_.sequences()[i];
      const std::string& motion = dataset_.capture().sequences[i].motion;
      sequences_.push_back({static_cast<int>(i), sequence.name, sequence.first_frame, sequence.last_frame,
                            sequence.cuts, motion.empty() ? "" : dataset_.capture().resolve(motion).string()});
    }
  }

  const Capture& capture() const override { return dataset_.capture(); }
  const Character& character() const override { return character_; }
  const std::vector<PinholeCamera>& cameras() const override { return dataset_.cameras(); }
  const std::vector<Marker>& landmarks() const override { return dataset_.landmarks(); }
  const std::vector<FootageSequence>& sequences() const override { return sequences_; }
  std::unique_ptr<FootageReader> read(int sequence) const override {
    return std::make_unique<PreparedReader>(dataset_, sequence, outline_pixels_);
  }

 private:
  Dataset dataset_;
  Character character_;
  int outline_pixels_;
  std::vector<FootageSequence> sequences_;
};

// ---- a capture's own files ----

/// A camera of a capture and its files of one sequence.
struct View {
  const SequenceEntry& entry;
  const Capture& capture;
  Camera camera;  ///< with its distortion
  int file_index;

  std::string source(const CameraPaths& paths) const { return capture.source(paths, file_index, camera.name); }
  std::unique_ptr<FrameReader> open_images() const { return open_frames(source(entry.videos), PixelFormat::colour); }
  /// Nothing for a sequence without masks.
  std::optional<MaskSource> open_masks() const {
    if (!entry.has_masks()) return std::nullopt;
    return MaskSource(capture, entry, camera, file_index);
  }
  FrameClock clock() const { return capture.clock(entry, camera.name); }
  bool has_images() const {
    const std::string path = source(entry.videos);
    return has_frame_placeholder(path) || fs::exists(path);
  }
};

/// Reads keypoints and masks of one camera, frame by frame.
class ViewReader {
 public:
  ViewReader(const View& view, const EvidencePlan& plan, const FootageSequence& sequence)
      : first_frame_(sequence.first_frame),
        clock_(view.clock()),
        undistort_(view.camera),
        masks_(view.open_masks()),
        picker_(plan.map, plan.landmarks) {
    if (!view.entry.joints3d.empty())
      joints_ = read_joint_detections(view.source(view.entry.joints3d), plan.map.layout);
    if (view.has_images() || needs_image()) videos_ = view.open_images();
    follow(view, plan, sequence);
  }

  void read(long frame, bool images, int outline_pixels, FootageFrame& result) {
    const cv::Mat filmed = images || needs_image() ? filmed_image(frame) : cv::Mat();
    const cv::Mat mask = masks_ ? masks_->read(clock_.frame(frame), filmed) : cv::Mat();
    const auto row = as_size(frame - first_frame_);
    result.evidence.push_back({track_.frames.at(row), outline_of(mask, outline_pixels)});
    result.masks.push_back(mask);
    if (images) result.images.push_back(undistorted(filmed));
    const auto joints = joints_.find(clock_.frame(frame));
    result.joints.push_back(joints == joints_.end() ? std::vector<JointDetection>{} : picker_.pick(joints->second));
  }
  cv::Mat image(long frame) { return undistorted(filmed_image(frame)); }

 private:
  static OutlineField outline_of(const cv::Mat& mask, int pixels) {
    return mask.empty() ? OutlineField() : OutlineField(mask, pixels);
  }
  bool needs_image() const { return masks_ && masks_->needs_image(); }
  cv::Mat filmed_image(long frame) { return videos_ ? videos_->read(clock_.frame(frame)) : cv::Mat(); }
  cv::Mat undistorted(const cv::Mat& filmed) { return filmed.empty() ? filmed : undistort_.apply(filmed); }

  /// The mask selects one of several people in an image. These masks are read separately.
  void follow(const View& view, const EvidencePlan& plan, const FootageSequence& sequence) {
    const KeypointSource source(view.source(view.entry.keypoints), plan.map.layout,
                                keypoint_camera(view.camera, view.file_index));
    std::optional<MaskSource> masks;
    std::unique_ptr<FrameReader> images;
    const auto mask_of = [&](long row) {
      if (!view.entry.has_masks()) return cv::Mat();
      if (!masks) {
        masks = view.open_masks();
        if (masks->needs_image()) images = view.open_images();
      }
      const long frame = clock_.frame(row);
      return masks->read(frame, images ? images->read(frame) : cv::Mat());
    };
    track_ =
        follow_person([&](long frame) { return source.people(frame); }, mask_of, picker_, view.camera,
                      {sequence.first_frame, sequence.last_frame, sequence.cuts, clock_}, view.capture.keypoint_filter);
    for (const std::string& doubt : keypoint_doubts(track_.facts))
      log::warn("sequence {}, camera {}: {}", view.entry.name, view.camera.name, doubt);
  }

  long first_frame_;
  FrameClock clock_;
  Undistorter undistort_;
  std::unique_ptr<FrameReader> videos_;
  std::optional<MaskSource> masks_;
  LandmarkPicker picker_;
  KeypointTrack track_;
  std::map<long, std::vector<JointDetection>> joints_;  ///< by video frame, in the layout's order
};

class CaptureReader : public FootageReader {
 public:
  CaptureReader(std::vector<std::unique_ptr<ViewReader>> views, int outline_pixels)
      : views_(std::move(views)), outline_pixels_(outline_pixels) {}

  FootageFrame read(long frame, bool images) override {
    FootageFrame result;
    for (const auto& view : views_) view->read(frame, images, outline_pixels_, result);
    return result;
  }
  cv::Mat image(long frame, int camera) override { return views_[as_size(camera)]->image(frame); }

 private:
  std::vector<std::unique_ptr<ViewReader>> views_;
  int outline_pixels_;
};

class CaptureFootage : public Footage {
 public:
  CaptureFootage(const fs::path& path, int outline_pixels, const std::string& camera)
      : capture_(with_camera(find_capture(path), camera)),
        character_(load_character(capture_.character_path())),
        plan_(plan_evidence(capture_, character_)),
        outline_pixels_(outline_pixels) {
    if (plan_.landmarks.empty())
      fail(
          "{}: nothing can be tracked without keypoints on landmarks; name `keypoints` in every sequence, and "
          "`landmarks` when the skeleton has no markers of these names (docs/capture.md)",
          capture_.file.empty() ? path.string() : capture_.file.string());
    choose_cameras();
    for (const SequenceEntry& entry : capture_.sequences) add_sequence(entry);
  }

  const Capture& capture() const override { return capture_; }
  const Character& character() const override { return character_; }
  const std::vector<PinholeCamera>& cameras() const override { return cameras_; }
  const std::vector<Marker>& landmarks() const override { return plan_.landmarks; }
  const std::vector<FootageSequence>& sequences() const override { return sequences_; }
  std::unique_ptr<FootageReader> read(int sequence) const override {
    const auto s = as_size(sequence);
    std::vector<std::unique_ptr<ViewReader>> views;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      views.push_back(std::make_unique<ViewReader>(view(capture_.sequences[s], c), plan_, sequences_[s]));
    return std::make_unique<CaptureReader>(std::move(views), outline_pixels_);
  }

 private:
  static Capture with_camera(Capture capture, const std::string& camera) {
    if (!camera.empty()) capture.cameras = {camera};
    return capture;
  }
  View view(const SequenceEntry& entry, std::size_t c) const { return {entry, capture_, filmed_[c], file_index_[c]}; }

  void choose_cameras() {
    CaptureCameras chosen = doppel::choose_cameras(capture_);
    filmed_ = std::move(chosen.cameras);
    file_index_ = std::move(chosen.file_index);
    for (std::size_t c = 0; c < filmed_.size(); ++c) {
      filmed_[c] = as_filmed(view(capture_.sequences.front(), c));
      cameras_.push_back(Undistorter(filmed_[c]).pinhole());
    }
  }

  /// The calibration at the resolution of the video, in whose pixels keypoints are given. Without videos it is
  /// unchanged.
  static Camera as_filmed(const View& view) {
    const std::string source = view.source(view.entry.videos);
    if (view.has_images()) return fit_to_images(view.camera, open_frames(source, PixelFormat::colour)->size(), source);
    log::info(
        "camera {}: there is no video {}; its calibration is assumed to be at the resolution of the keypoints' images",
        view.camera.name, source);
    return view.camera;
  }

  /// Adds a sequence. Its last frame is the last one that all cameras have, unless the capture states it.
  void add_sequence(const SequenceEntry& entry) {
    if (entry.keypoints.empty())
      fail("sequence {} of {} names no `keypoints`, which tracking needs{}", entry.name, capture_.name,
           capture_.detector ? ". Prepare the capture, which runs its detector, and track the prepared folder" : "");
    long frames = std::numeric_limits<long>::max();
    long expected = entry.last_frame.value_or(-1) + 1;
    for (std::size_t c = 0; c < filmed_.size(); ++c) {
      const View seen = view(entry, c);
      if (entry.masks.empty() && entry.last_frame && !seen.has_images()) {  // keypoints alone
        frames = std::min(frames, *entry.last_frame + 1);
        continue;
      }
      const auto reader =
          entry.masks.empty() ? seen.open_images() : open_frames(seen.source(entry.masks), PixelFormat::grey);
      const long found = reader->num_frames(expected);
      frames = std::min(frames, seen.clock().num_rows(found));
      if (!entry.last_frame) expected = found;
    }
    FootageSequence sequence{static_cast<int>(sequences_.size()),
                             entry.name,
                             entry.first_frame,
                             entry.last_frame.value_or(frames - 1),
                             {},
                             {},
                             entry.has_masks()};
    if (sequence.last_frame >= frames || sequence.first_frame > sequence.last_frame)
      fail("sequence {}: frames {} to {} are requested, but all cameras together have frames 0 to {}", entry.name,
           sequence.first_frame, sequence.last_frame, frames - 1);
    sequence.cuts = entry.cuts;
    if (!entry.motion.empty() && fs::exists(capture_.resolve(entry.motion)))
      sequence.motion = capture_.resolve(entry.motion).string();
    sequences_.push_back(std::move(sequence));
  }

  Capture capture_;
  Character character_;
  EvidencePlan plan_;
  int outline_pixels_;
  std::vector<Camera> filmed_;          ///< [C] with distortion
  std::vector<PinholeCamera> cameras_;  ///< [C] without
  std::vector<int> file_index_;         ///< [C]
  std::vector<FootageSequence> sequences_;
};

}  // namespace

bool FootageSequence::begins_segment(long frame) const {
  return std::find(cuts.begin(), cuts.end(), frame) != cuts.end();
}

std::vector<long> FootageSequence::cuts_from_first() const {
  std::vector<long> counted;
  for (const long cut : cuts) counted.push_back(cut - first_frame);
  return counted;
}

std::unique_ptr<Footage> Footage::open(const fs::path& path, int outline_pixels, const std::string& camera) {
  if (!fs::is_directory(path / "store")) return std::make_unique<CaptureFootage>(path, outline_pixels, camera);
  if (!camera.empty())
    fail<UsageError>("{} is a prepared folder; a single camera of it cannot be chosen: give the capture itself",
                     path.string());
  return std::make_unique<PreparedFootage>(path, outline_pixels);
}

}  // namespace doppel
