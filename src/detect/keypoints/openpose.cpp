#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;

struct OpenPoseBlock {
  const char* key;
  std::size_t points;
};
constexpr OpenPoseBlock kOpenPoseRest[] = {
    {"face_keypoints_2d", 70}, {"hand_left_keypoints_2d", 21}, {"hand_right_keypoints_2d", 21}};

/// Face and hands; empty when OpenPose looked for none of them. Missing parts are filled with points not seen.
Person openpose_rest(const json& object, const FileLocation& where) {
  Person rest;
  bool any = false;
  for (const OpenPoseBlock& block : kOpenPoseRest) {
    const json* list = find_key(object, {block.key});
    Person points = list ? flat_points(*list, where) : Person();
    any |= !points.empty();
    if (!points.empty() && points.size() != block.points)
      fail_at(where, "reading keypoints: `{}` has {} points, OpenPose writes {}", block.key, points.size(),
              block.points);
    points.resize(block.points);
    rest.insert(rest.end(), points.begin(), points.end());
  }
  return any ? rest : Person();
}

/// The JSON files of OpenPose 1.2 and later, and of tools that copy them (Pose2Sim): one image per file,
/// `people[].pose_keypoints_2d` of x, y, confidence. (0, 0, 0) is a point that was not found. An image without people
/// has an empty list, or people that are null, {} or have empty lists. Neither the layout nor the frame is in the file.
/// Older files say `pose_keypoints`.
class OpenPoseKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "openpose"; }
  bool recognises(const KeypointFile& file) const override {
    return file.document && find_key(*file.document, {"people"});
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    const FileLocation where{file.path.string(), 0};
    const json& people = *find_key(*file.document, {"people"});
    if (!people.is_array()) fail_at(where, "reading keypoints: `people` is not a list");
    Detections result;
    result.images.emplace_back();
    for (const json& object : people) {
      if (!object.is_object() && !object.is_null()) fail_at(where, "reading keypoints: a person is not an object");
      const json* list = find_key(object, {"pose_keypoints_2d", "pose_keypoints"});
      if (list) result.images.back().people.push_back({flat_points(*list, where), openpose_rest(object, where)});
    }
    return result;
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_openpose_keypoints() { return std::make_unique<OpenPoseKeypoints>(); }

}  // namespace doppel
