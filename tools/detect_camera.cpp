#include "detect_camera.h"

#include <fmt/format.h>

#include <map>

#include "detect_masks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/detect/blazepose/mask_sharpening.h"
#include "doppel/detect/blazepose/possible_parts.h"
#include "doppel/detect/face/face_search.h"
#include "doppel/detect/hands/hand_search.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/geometry/image_file.h"

namespace doppel::tools {

namespace {

constexpr std::size_t kLeftHip = 23, kRightHip = 24;
constexpr double kMillimetresPerMetre = 1000.0;

/// Rows of the table of points in space: millimetres relative to the middle of the hips.
std::string joint_rows(long frame, const BodyPose& pose) {
  const Eigen::Vector3d root = 0.5 * (pose.world[kLeftHip] + pose.world[kRightHip]);
  std::string rows;
  for (std::size_t i = 0; i < pose.world.size(); ++i) {
    const Eigen::Vector3d point = kMillimetresPerMetre * (pose.world[i] - root);
    rows += fmt::format("{},{},{},{:.2f},{:.2f},{:.2f}\n", frame, i, kBodyLandmarkNames[i], point.x(), point.y(),
                        point.z());
  }
  return rows;
}

/// Collects the results of one camera.
class DetectTables {
 public:
  explicit DetectTables(PointLayout layout) : layout_(std::move(layout)) {}

  void add_nobody(long frame) {
    frames_[frame] = {};
    ++report_.frames;
  }

  /// @param person of the layout
  void add(long frame, const BodyPose& pose, const Person& person) {
    frames_[frame] = {person};
    ++report_.frames;
    ++report_.with_person;
    joints_ += joint_rows(frame, pose);
    for (std::size_t i = 0; i < pose.landmarks.size(); ++i) confidence_ += person[i].confidence;
  }

  DetectReport write(const DetectFiles& files) {
    write_keypoint_table(files.keypoints, layout_, frames_);
    write_atomically(files.joints, "frame,index,name,x_mm,y_mm,z_mm\n" + joints_);
    if (report_.with_person > 0)
      report_.mean_confidence = confidence_ / static_cast<double>(report_.with_person * kNumBodyLandmarks);
    return report_;
  }

 private:
  PointLayout layout_;
  std::map<long, People> frames_;
  std::string joints_;
  double confidence_ = 0.0;
  DetectReport report_;
};

cv::Mat mask_of_all(BodyDetector& detector, const cv::Mat& image) {
  cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
  for (const BodyPose& pose : detector.detect_all(image)) cv::max(mask, pose.mask, mask);
  return mask;
}

PersonPoints points_of(const PersonDetectors& detectors) {
  if (!detectors.hands) return PersonPoints::body;
  return detectors.face ? PersonPoints::body_face_hands : PersonPoints::body_hands;
}

Person read_person(const cv::Mat& image, const BodyPose& pose, PersonDetectors& detectors) {
  if (!detectors.hands) return person_of_pose(pose);
  const HandPair hands = detectors.hands->read_hands(image, pose);
  if (!detectors.face) return person_of_pose(pose, hands);
  return person_of_pose(pose, detectors.face->read_face(image, pose), hands);
}

void add_hands(const BodyPose& pose, const HandPair& hands, Person& person) {
  for (const HandSide side : kHandSides) {
    const std::optional<HandPose>& hand = hands[as_size(side)];
    for (std::size_t i = 0; i < as_size(kNumHandPoints); ++i)
      person.push_back(hand ? Keypoint{static_cast<float>(hand->points[i].x()), static_cast<float>(hand->points[i].y()),
                                       static_cast<float>(hand_confidence(*hand, pose, side))}
                            : Keypoint());
  }
}

void add_face(const BodyPose& pose, const std::optional<FacePose>& face, Person& person) {
  for (std::size_t i = 0; i < as_size(kNumFacePoints); ++i)
    person.push_back(face ? Keypoint{static_cast<float>(face->points[i].x()), static_cast<float>(face->points[i].y()),
                                     static_cast<float>(face_confidence(*face, pose))}
                          : Keypoint());
}

}  // namespace

PointLayout mediapipe_layout(PersonPoints points) {
  PointLayout layout{"mediapipe33", {kBodyLandmarkNames.begin(), kBodyLandmarkNames.end()}};
  if (points == PersonPoints::body) return layout;
  layout.name = "mediapipe75";
  if (points == PersonPoints::body_face_hands) {
    layout.name = "mediapipe543";
    for (int i = 0; i < kNumFacePoints; ++i) layout.points.push_back(face_point_name(i));
  }
  for (const std::string side : {"left_", "right_"})
    for (const char* name : kHandPointNames) layout.points.push_back(side + name);
  return layout;
}

Person person_of_pose(const BodyPose& pose) {
  Person person;
  for (std::size_t i = 0; i < pose.landmarks.size(); ++i)
    person.push_back({static_cast<float>(pose.landmarks[i].x), static_cast<float>(pose.landmarks[i].y),
                      static_cast<float>(landmark_confidence(pose, i))});
  return person;
}

Person person_of_pose(const BodyPose& pose, const HandPair& hands) {
  Person person = person_of_pose(pose);
  add_hands(pose, hands, person);
  return person;
}

Person person_of_pose(const BodyPose& pose, const std::optional<FacePose>& face, const HandPair& hands) {
  Person person = person_of_pose(pose);
  add_face(pose, face, person);
  add_hands(pose, hands, person);
  return person;
}

std::optional<DetectReport> detect_camera(const DetectSource& source, const DetectFiles& files,
                                          PersonDetectors& detectors, const PersonGuide& guide, bool sharpen,
                                          const std::function<bool()>& advance) {
  StaticBackground background;
  if (sharpen)
    background = learn_background_of(source, [&](const cv::Mat& image) { return mask_of_all(detectors.body, image); });
  const auto images = open_frames(source.images, PixelFormat::colour);
  BodyTracker tracker(detectors.body, guide.start());
  DetectTables tables(mediapipe_layout(points_of(detectors)));
  for (const long frame : source.frames) {
    const cv::Mat image = images->read(frame);
    const std::optional<BodyPose> pose = tracker.track(image, guide.at(frame));
    if (pose)
      tables.add(frame, *pose, read_person(image, *pose, detectors));
    else
      tables.add_nobody(frame);
    if (!files.masks.empty()) {
      cv::Mat mask = pose ? pose->mask : cv::Mat::zeros(image.size(), CV_8U);
      if (sharpen) mask = sharpen_mask(image, mask, background);
      if (files.possible_parts) mark_possible_parts(image, mask, background);
      write_image(mask_file(files.masks, frame), mask);
    }
    if (!advance()) return std::nullopt;
  }
  return tables.write(files);
}

}  // namespace doppel::tools
