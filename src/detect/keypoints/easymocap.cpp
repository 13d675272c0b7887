#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;

Person easymocap_rest(const json& object, const FileLocation& where) {
  Person rest;
  for (const char* key : {"face2d", "handl2d", "handr2d"}) {
    const json* list = find_key(object, {key});
    const Person points = list ? points_of_person(*list, nullptr, where) : Person();
    rest.insert(rest.end(), points.begin(), points.end());
  }
  return rest;
}

/// The `annots` of EasyMocap: one image per file, {filename, height, width, annots: [{personID, bbox, keypoints: [[x,
/// y, confidence], ...]}]}, with face2d, handl2d and handr2d where they were detected. The layout is not in the file.
class EasyMocapKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "easymocap"; }
  bool recognises(const KeypointFile& file) const override {
    return file.document && find_key(*file.document, {"annots"});
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    const FileLocation where{file.path.string(), 0};
    const json& people = *find_key(*file.document, {"annots"});
    if (!people.is_array()) fail_at(where, "reading keypoints: `annots` is not a list");
    Detections result;
    result.images.emplace_back();
    for (const json& object : people) {
      const json* list = find_key(object, {"keypoints"});
      if (!list) continue;  // a box without points
      result.images.back().people.push_back({points_of_person(*list, nullptr, where), easymocap_rest(object, where)});
    }
    return result;
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_easymocap_keypoints() { return std::make_unique<EasyMocapKeypoints>(); }

}  // namespace doppel
