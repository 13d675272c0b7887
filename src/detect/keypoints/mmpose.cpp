#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;

constexpr int kMaxListDepth = 4;  ///< of lists of people in lists of images; no known tool nests deeper

const json* mmpose_list(const json& object) { return find_key(object, {"instances", "predictions", "instance_info"}); }

bool is_mmpose_person(const json& object) {
  const json* points = find_key(object, {"keypoints"});
  return points && points->is_array() && (points->empty() || (*points)[0].is_array());
}

/// Whether the first object in nested lists is a person, or an image with a list of people.
bool begins_with_mmpose(const json& node, int depth = 0) {
  if (node.is_array()) return depth < kMaxListDepth && !node.empty() && begins_with_mmpose(node[0], depth + 1);
  return mmpose_list(node) || is_mmpose_person(node);
}

class MmposeReader {
 public:
  MmposeReader(const json& document, const FileLocation& where) : where_(where) {
    const json* meta = find_key(document, {"meta_info"});
    if (meta) result_.points = json_names(find_key(*meta, {"keypoint_id2name"}));
    // The demo scripts count the frames of a video from 1.
    from_one_ = find_key(document, {"instance_info"}) != nullptr;
    collect(document, 0, std::nullopt);
    for (const DetectedImage& image : result_.images) from_one_ &= image.frame != 0;
  }

  Detections take() {
    for (DetectedImage& image : result_.images)
      if (from_one_ && image.frame) --*image.frame;
    return std::move(result_);
  }

 private:
  void collect(const json& node, int depth, std::optional<long> frame) {
    if (depth > kMaxListDepth) fail_at(where_, "reading keypoints: lists are nested deeper than any known file's");
    if (node.is_array()) {
      for (const json& item : node) collect(item, depth + 1, frame);
    } else if (const json* list = mmpose_list(node)) {
      if (const json* number = find_key(node, {"frame_id"})) {
        frame = json_frame(number);
        if (!frame) fail_at(where_, "reading keypoints: a `frame_id` is not an integer from 0");
        result_.images.push_back({frame, "", {}});  // it may have no people
      }
      collect(*list, depth + 1, frame);
    } else if (is_mmpose_person(node)) {
      const json* scores = find_key(node, {"keypoint_scores", "keypoints_scores"});
      const Person points = nested_points(*find_key(node, {"keypoints"}), scores, where_);
      result_.images.push_back({frame, "", {{points, {}}}});
    } else {
      fail_at(where_,
              "reading keypoints: a person has no `keypoints` of the form [[x, y], ...], as MMPose writes them");
    }
  }

  FileLocation where_;
  Detections result_;
  bool from_one_ = false;
};

/// The JSON files of MMPose 1.x, hence of RTMPose and Sapiens: of an image a list of people {keypoints: [[x, y], ...],
/// keypoint_scores}, or {instances} or {predictions: [[...]]}; of a video a list of {frame_id, instances} counted from
/// 0. Demo scripts write {meta_info, instance_info}, which counts frames from 1 and names the points. Scores of RTMPose
/// may exceed 1.
class MmposeKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "mmpose"; }
  bool recognises(const KeypointFile& file) const override {
    return file.document && begins_with_mmpose(*file.document);
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    return MmposeReader(*file.document, {file.path.string(), 0}).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_mmpose_keypoints() { return std::make_unique<MmposeKeypoints>(); }

}  // namespace doppel
