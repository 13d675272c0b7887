#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// A point that a detector found, in pixels of the image as the detector wrote it (no shift is applied).
struct Keypoint {
  float x = 0.0f, y = 0.0f;
  float confidence = 0.0f;  ///< 0..1; 0: not seen, and then x = y = 0
};
/// Less is taken for a guess: such points neither choose a window nor count as seen in reports (thesis 5.3).
inline constexpr float kSeenConfidence = 0.4f;

/// One person's points in the detector's order, and everybody in one image.
using Person = std::vector<Keypoint>;
using People = std::vector<Person>;

/// Which points a detector writes, in its order.
struct PointLayout {
  std::string name;                 ///< body25, coco18, coco17, or what a user's own map says
  std::vector<std::string> points;  ///< [n] unique names
};

/// Reads the people of one image from a JSON file, told apart by content: OpenPose (`people[].pose_keypoints_2d`),
/// COCO results (`[{keypoints: [x, y, score, ...]}]`) and MMPose (`instances`, `predictions` or `instance_info` with
/// `keypoints: [[x, y], ...]` and `keypoint_scores`). Confidences are held to 0..1; COCO's visibilities 0, 1, 2 count
/// as 0, 0.5, 1.
/// @throws FileError: no JSON, another structure, another number of points than the layout has, not finite
People read_people(const std::filesystem::path& path, const PointLayout& layout);

/// Reads a JSON file of all images of one camera: COCO results (`image_id` is the frame's number, or a file name
/// whose last digits are; with `images` their file names count), and MMPose's `[{frame_id, instances}]` (from 0) or
/// `instance_info` (from 1, unless a `frame_id` is 0). @return by frame; frames of nobody may be missing
/// @throws FileError as read_people, and for entries without a frame's number
std::map<long, People> read_all_people(const std::filesystem::path& path, const PointLayout& layout);

/// Reads the rows of one camera from our own table, `frame,camera,name,x,y,confidence`: one person per frame, points
/// not named are not seen.
/// @throws FileError (file:line) for a name the layout does not have, a point given twice, a confidence outside of
///         0..1, or when no row is of this camera
std::map<long, People> read_keypoint_table(const std::filesystem::path& path, const PointLayout& layout,
                                           const std::string& camera);

/// Writes such a table for one camera: the first person of each frame, points that are seen. When no point is seen in
/// any frame, one row with confidence 0 says that the camera was looked at.
void write_keypoint_table(const std::filesystem::path& path, const PointLayout& layout, const std::string& camera,
                          const std::map<long, People>& frames);

/// The person to follow: the only one; of several the one with the largest sum of confidences, where points outside of
/// the mask do not count. A point is outside when it is farther from the mask than 3 % of the mask's longer side. If no
/// one has a point inside, or the mask is empty or not given, all points count.
/// @param mask of the image the points are in, or empty
/// @return nothing when there is no one
std::optional<Person> choose_person(const People& people, const cv::Mat& mask = {});

/// The keypoint files of one camera in one sequence, whatever their form.
class KeypointSource {
 public:
  /// @param path a file per frame when it holds `{frame}`, else one file of all frames (.json, or .csv)
  /// @param camera the name that rows of a table carry
  /// @throws FileError when the one file cannot be read
  KeypointSource(std::string path, const PointLayout& layout, const std::string& camera);

  /// Everybody in a frame; nothing when the frame's file is missing. @throws FileError as read_people
  std::optional<People> people(long frame) const;

 private:
  std::string path_;
  PointLayout layout_;
  std::optional<std::map<long, People>> all_;
};

}  // namespace doppel
