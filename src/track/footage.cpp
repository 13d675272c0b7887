#include "doppel/track/footage.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/evidence.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/people_in_cameras.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/geometry/undistorter.h"

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
    const cv::Rect position = cv::Rect(box.u0, box.v0, box.side, box.side) & cv::Rect({}, whole.size());
    window(position - cv::Point(box.u0, box.v0)).copyTo(whole(position));
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
  bool has_images() const { return doppel::has_images(capture, entry, camera, file_index); }
};

/// The masks of a view, read apart from its images. They select one of several people.
class ViewMasks {
 public:
  explicit ViewMasks(const View& view) : view_(view), clock_(view.clock()) {}
  /// @param row ascending @return empty without masks
  cv::Mat read(long row) {
    if (!view_.entry.has_masks()) return cv::Mat();
    if (!masks_) masks_.emplace(view_.capture, view_.entry, view_.camera, view_.file_index);
    return masks_->read(clock_.frame(row));
  }

 private:
  View view_;
  FrameClock clock_;
  std::optional<MaskReader> masks_;
};

/// The keypoint files of a sequence, and who of the people in them is followed.
struct SequencePeople {
  std::vector<PeopleOfFrame> people;  ///< [C]
  std::vector<ChoiceOfFrame> chosen;  ///< [C]
};

SequencePeople read_people_of(const std::vector<View>& views, const PointLayout& layout,
                              const FootageSequence& sequence) {
  const SequenceEntry& entry = views.front().entry;
  PeopleInCameras seen{sequence.name, {}, {}, {}, sequence.first_frame, sequence.last_frame};
  std::vector<ViewMasks> masks;
  for (const View& view : views) {
    seen.cameras.push_back(view.camera);
    seen.clocks.push_back(view.clock());
    const auto source = std::make_shared<const KeypointSource>(view.source(entry.keypoints), layout,
                                                               keypoint_camera(view.camera, view.file_index),
                                                               entry.keypoint_offset_of(view.camera.name));
    seen.people.emplace_back([source](long frame) { return source->people(frame); });
    masks.emplace_back(view);
  }
  MaskOfCamera mask;
  if (entry.has_masks()) mask = [&](std::size_t camera, long row) { return masks[camera].read(row); };
  std::vector<ChoiceOfFrame> chosen = follow_if_several(seen, layout, views.front().capture.person_of(entry), mask);
  return {std::move(seen.people), std::move(chosen)};
}

/// Reads keypoints and masks of one camera, frame by frame.
class ViewReader {
 public:
  ViewReader(const View& view, const EvidencePlan& plan, const FootageSequence& sequence, const PeopleOfFrame& people,
             const ChoiceOfFrame& chosen)
      : first_frame_(sequence.first_frame),
        clock_(view.clock()),
        undistort_(view.camera),
        masks_(view.open_masks()),
        picker_(plan.map, plan.landmarks) {
    if (!view.entry.joints3d.empty())
      joints_ = read_joint_detections(view.source(view.entry.joints3d), plan.map.layout);
    if (view.has_images() || needs_image()) videos_ = view.open_images();
    ViewMasks masks(view);
    track_ = follow_person(
        people, [&](long row) { return masks.read(row); }, picker_, view.camera,
        {sequence.first_frame, sequence.last_frame, sequence.cuts, clock_}, view.capture.keypoint_filter, chosen);
    for (const std::string& doubt : keypoint_doubts(track_.facts))
      log::warn("sequence {}, camera {}: {}", view.entry.name, view.camera.name, doubt);
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
  cv::Mat image(long frame, int camera) override { return views_[camera]->image(frame); }

 private:
  std::vector<std::unique_ptr<ViewReader>> views_;
  int outline_pixels_;
};

class CaptureFootage : public Footage {
 public:
  CaptureFootage(Capture capture, Character character, int outline_pixels)
      : capture_(std::move(capture)),
        character_(std::move(character)),
        plan_(plan_evidence(capture_, character_)),
        outline_pixels_(outline_pixels) {
    if (plan_.landmarks.empty())
      fail(
          "{}: nothing can be tracked without keypoints on landmarks; name `keypoints` in every sequence, and "
          "`landmarks` when the skeleton has no markers of these names (docs/capture.md)",
          (capture_.file.empty() ? capture_.root : capture_.file).string());
    choose_cameras();
    for (const SequenceEntry& entry : capture_.sequences) add_sequence(entry);
  }

  const Capture& capture() const override { return capture_; }
  const Character& character() const override { return character_; }
  const std::vector<PinholeCamera>& cameras() const override { return cameras_; }
  const std::vector<Marker>& landmarks() const override { return plan_.landmarks; }
  const std::vector<FootageSequence>& sequences() const override { return sequences_; }
  std::unique_ptr<FootageReader> read(int sequence) const override {
    const FootageSequence& rows = sequences_[sequence];
    const std::vector<View> views = views_of(capture_.sequences[sequence]);
    const SequencePeople people = read_people_of(views, plan_.map.layout, rows);
    std::vector<std::unique_ptr<ViewReader>> readers;
    for (std::size_t c = 0; c < views.size(); ++c)
      readers.push_back(std::make_unique<ViewReader>(views[c], plan_, rows, people.people[c], people.chosen[c]));
    return std::make_unique<CaptureReader>(std::move(readers), outline_pixels_);
  }

 private:
  std::vector<View> views_of(const SequenceEntry& entry) const {
    std::vector<View> views;
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      views.push_back({entry, capture_, filmed_.cameras[c], filmed_.file_index[c]});
    return views;
  }

  void choose_cameras() {
    filmed_ = filmed_cameras(capture_);
    for (const Camera& camera : filmed_.cameras) cameras_.push_back(Undistorter(camera).pinhole());
  }

  /// Adds a sequence. Its last frame is the last one that all cameras have, unless the capture states it.
  void add_sequence(const SequenceEntry& entry) {
    if (entry.keypoints.empty())
      fail("sequence {} of {} names no `keypoints`, which tracking needs{}", entry.name, capture_.name,
           capture_.detector ? ". Prepare the capture, which runs its detector, and track the prepared folder"
                             : "; `doppel detect` finds them (docs/detect.md)");
    const RowRange rows = rows_of_sequence(capture_, entry, filmed_);
    FootageSequence sequence{
        static_cast<int>(sequences_.size()), entry.name, rows.first, rows.last, {}, {}, entry.has_masks()};
    sequence.cuts = entry.cuts;
    if (!entry.motion.empty() && fs::exists(capture_.resolve(entry.motion)))
      sequence.motion = capture_.resolve(entry.motion).string();
    sequences_.push_back(std::move(sequence));
  }

  Capture capture_;
  Character character_;
  EvidencePlan plan_;
  int outline_pixels_;
  CaptureCameras filmed_;               ///< [C] with distortion
  std::vector<PinholeCamera> cameras_;  ///< [C] without
  std::vector<FootageSequence> sequences_;
};

/// @param reason why a prepared folder will not do
Capture unprepared_capture(const fs::path& path, const std::string& reason) {
  if (fs::is_directory(path / "store"))
    fail<UsageError>("{} is a prepared folder, {}; give the capture itself", path.string(), reason);
  return find_capture(path);
}

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
  if (!fs::is_directory(path / "store")) {
    Capture capture = find_capture(path);
    if (!camera.empty()) capture.cameras = {camera};
    Character character = load_character(capture.character_path());
    return std::make_unique<CaptureFootage>(std::move(capture), std::move(character), outline_pixels);
  }
  if (!camera.empty())
    fail<UsageError>("{} is a prepared folder; a single camera of it cannot be chosen: give the capture itself",
                     path.string());
  return std::make_unique<PreparedFootage>(path, outline_pixels);
}

std::unique_ptr<Footage> Footage::open_unprepared(const fs::path& path, int outline_pixels, const std::string& reason) {
  static_cast<void>(unprepared_capture(path, reason));
  return open(path, outline_pixels);
}

std::unique_ptr<Footage> Footage::open_for(Character character, const fs::path& file, const fs::path& path,
                                           int outline_pixels) {
  Capture capture = unprepared_capture(path, "made for one character");
  capture.character = fs::absolute(file).lexically_normal().string();
  capture.landmarks.clear();
  return std::make_unique<CaptureFootage>(std::move(capture), std::move(character), outline_pixels);
}

std::unique_ptr<Footage> Footage::open_with_landmarks(const fs::path& placement, const fs::path& path,
                                                      int outline_pixels) {
  Capture capture = unprepared_capture(path, "made for its landmarks");
  capture.landmarks = fs::absolute(placement).lexically_normal().string();
  Character character = load_character(capture.character_path());
  return std::make_unique<CaptureFootage>(std::move(capture), std::move(character), outline_pixels);
}

}  // namespace doppel
