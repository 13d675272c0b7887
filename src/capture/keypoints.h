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
/// Points of lower confidence neither determine a crop nor count as seen in reports (thesis 5.3).
inline constexpr float kSeenConfidence = 0.4f;

/// One person's points in the detector's order, and everybody in one image.
using Person = std::vector<Keypoint>;
using People = std::vector<Person>;

/// The points that a detector writes, in its order.
struct PointLayout {
  std::string name;                 ///< body25, coco18, coco17, or a name from a user's map
  std::vector<std::string> points;  ///< [n] unique names
};

/// Reads the people of one image from a JSON file. The content determines the format: OpenPose
/// (`people[].pose_keypoints_2d`), COCO results (`[{keypoints: [x, y, score, ...]}]`) and MMPose (`instances`,
/// `predictions` or `instance_info` with `keypoints: [[x, y], ...]` and `keypoint_scores`). Confidences are clamped to
/// 0..1; COCO's visibilities 0, 1, 2 count as 0, 0.5, 1.
/// @throws FileError: not JSON, another structure, another number of points than the layout has, not finite
People read_people(const std::filesystem::path& path, const PointLayout& layout);

/// Reads a JSON file of all images of one camera: COCO results, and MMPose's `[{frame_id, instances}]` (from 0) or
/// `instance_info` (from 1, unless a `frame_id` is 0). In COCO results, `image_id` is the frame number, or a file name
/// that ends in the frame number; if the file has a list `images`, their file names are used.
/// @return by frame; frames without people may be missing
/// @throws FileError as read_people, and for entries without a frame number
std::map<long, People> read_all_people(const std::filesystem::path& path, const PointLayout& layout);

/// Reads the rows of one camera from Doppel's own table, `frame,camera,name,x,y,confidence`: one person per frame;
/// points without a row are not seen.
/// @throws FileError (file:line) for a name that the layout does not have, a point given twice, a confidence outside of
/// 0..1, or a table without rows of this camera
std::map<long, People> read_keypoint_table(const std::filesystem::path& path, const PointLayout& layout,
                                           const std::string& camera);

/// Writes such a table for one camera: the seen points of the first person in each frame. When no point is seen in any
/// frame, the table gets one row with confidence 0, which records that the camera was processed.
void write_keypoint_table(const std::filesystem::path& path, const PointLayout& layout, const std::string& camera,
                          const std::map<long, People>& frames);

/// The person to follow. Of several people, this is the one with the largest sum of confidences over points inside the
/// mask. A point is outside when its distance from the mask exceeds 3 % of the mask's longer side. If nobody has a
/// point inside, or the mask is empty or not given, all points count.
/// @param mask of the image that contains the points, or empty
/// @return nothing when there are no people
std::optional<Person> choose_person(const People& people, const cv::Mat& mask = {});

/// The keypoint files of one camera in one sequence, in any supported format.
class KeypointSource {
 public:
  /// @param path a file per frame when it holds `{frame}`, else one file of all frames (.json, or .csv)
  /// @param camera the camera's name in the rows of a table
  /// @throws FileError when the file of all frames cannot be read
  KeypointSource(std::string path, const PointLayout& layout, const std::string& camera);

  /// All people in a frame; nothing when the file of this frame is missing. @throws FileError as read_people
  std::optional<People> people(long frame) const;

 private:
  std::string path_;
  PointLayout layout_;
  std::optional<std::map<long, People>> all_;
};

}  // namespace doppel
