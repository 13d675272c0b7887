#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;

/// The people of an image in the containers `open` and `cmu`; null: the object is none.
const json* alphapose_people(const json& object) {
  const json* people = find_key(object, {"people", "bodies"});
  return people && people->is_array() ? people : nullptr;
}

void read_alphapose_image(const std::string& name, const json& people, const FileLocation& where, Detections& result) {
  result.images.push_back({std::nullopt, name, {}});
  for (const json& object : people)
    if (const json* list = find_key(object, {"pose_keypoints_2d", "joints"}))
      result.images.back().people.push_back({flat_points(*list, where), {}});
}

void read_alphapose_entry(const json& entry, const FileLocation& where, Detections& result) {
  const json* image = find_key(entry, {"image_id"});
  const json* list = find_key(entry, {"keypoints"});
  if (!image || !list) fail_at(where, "reading keypoints: an entry of AlphaPose lacks `image_id` or `keypoints`");
  DetectedImage found;
  if (image->is_string())
    found.name = image->get<std::string>();
  else
    found.frame = json_frame(image);
  found.people.push_back({flat_points(*list, where), {}});
  result.images.push_back(std::move(found));
}

/// The JSON files of AlphaPose. By default a flat list of people {image_id, category_id, keypoints, score, box, idx};
/// `image_id` is the name of an image's file. With `--format open` and `--format cmu` an object of images, which hold
/// `people` as OpenPose has them, or `bodies` with `joints`. Images without people are missing. The points'
/// confidences come from heatmaps and may exceed 1; `score`, of the whole person, is not used.
class AlphaPoseKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "alphapose"; }
  bool recognises(const KeypointFile& file) const override {
    if (!file.document || file.document->empty()) return false;
    const json& document = *file.document;
    if (document.is_object()) return find_key(document, {"bodies"}) || alphapose_people(*document.begin());
    if (!document.is_array()) return false;
    const json* image = find_key(document[0], {"image_id"});
    return image && find_key(document[0], {"keypoints"}) &&
           (image->is_string() || find_key(document[0], {"box", "idx"}));
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    const FileLocation where{file.path.string(), 0};
    const json& document = *file.document;
    Detections result;
    if (document.is_array()) {
      for (const json& entry : document) read_alphapose_entry(entry, where, result);
    } else if (find_key(document, {"bodies"})) {
      if (!alphapose_people(document)) fail_at(where, "reading keypoints: `bodies` is not a list");
      read_alphapose_image("", *alphapose_people(document), where, result);
    } else {
      for (const auto& [image, object] : document.items()) {
        if (!alphapose_people(object))
          fail_at(where, "reading keypoints: an image of AlphaPose has neither `people` nor `bodies`");
        read_alphapose_image(image, *alphapose_people(object), where, result);
      }
    }
    return result;
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_alphapose_keypoints() { return std::make_unique<AlphaPoseKeypoints>(); }

}  // namespace doppel
