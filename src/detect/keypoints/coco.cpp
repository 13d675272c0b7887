#include <algorithm>
#include <map>

#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;

/// Whether all third numbers are 0, 1 or 2 with at least one 2: labels, not confidences.
bool holds_visibilities(const json& list) {
  bool visible = false;
  for (std::size_t i = 2; list.is_array() && i < list.size(); i += 3) {
    if (list[i] != 0 && list[i] != 1 && list[i] != 2) return false;
    visible |= list[i] == 2;
  }
  return visible;
}

class CocoReader {
 public:
  CocoReader(const json& document, const FileLocation& where) : where_(where) {
    const json* annotations = find_key(document, {"annotations"});
    labelled_ = annotations != nullptr;
    if (const json* categories = find_key(document, {"categories"}); categories && categories->is_array())
      for (const json& category : *categories)
        if (result_.points.empty()) result_.points = json_names(find_key(category, {"keypoints"}));
    read_images(document);
    const json& entries = annotations ? *annotations : document;
    if (!entries.is_array()) fail_at(where_, "reading keypoints: `annotations` is not a list");
    for (const json& entry : entries) read_entry(entry);
  }
  Detections take() { return std::move(result_); }

 private:
  /// Images without an entry are there, too: nobody is in them.
  void read_images(const json& document) {
    const json* images = find_key(document, {"images"});
    if (!images || !images->is_array()) return;
    for (const json& image : *images) {
      const json *id = find_key(image, {"id"}), *name = find_key(image, {"file_name"});
      if (!id || !name || !name->is_string()) continue;
      names_[id->dump()] = name->get<std::string>();
      result_.images.push_back({std::nullopt, name->get<std::string>(), {}});
    }
  }

  void read_entry(const json& entry) {
    const json* list = find_key(entry, {"keypoints"});
    if (!list)
      fail_at(where_, "reading keypoints: an entry has no `keypoints`, as COCO's results and annotations have");
    const bool labels = labelled_ || holds_visibilities(*list);
    const ThirdNumber third = labels ? ThirdNumber::visibility : ThirdNumber::confidence;
    DetectedPerson person{flat_points(*list, where_, third), {}};
    for (const char* block : {"foot_kpts", "face_kpts", "lefthand_kpts", "righthand_kpts"}) {
      const json* more = find_key(entry, {block});
      const Person points = more ? flat_points(*more, where_, third) : Person();
      person.rest.insert(person.rest.end(), points.begin(), points.end());
    }
    DetectedImage image;
    name_image(find_key(entry, {"image_id"}), image);
    image.people.push_back(std::move(person));
    result_.images.push_back(std::move(image));
  }

  void name_image(const json* id, DetectedImage& image) const {
    const auto known = id ? names_.find(id->dump()) : names_.end();
    if (known != names_.end()) {
      image.name = known->second;
    } else if (id && id->is_string()) {
      image.name = id->get<std::string>();
    } else {
      image.frame = json_frame(id);
    }
  }

  FileLocation where_;
  bool labelled_ = false;
  std::map<std::string, std::string> names_;  ///< file names of images by id
  Detections result_;
};

/// COCO's keypoint results, which ViTPose, HRNet and the evaluation of MMPose write: a flat list of people {image_id,
/// keypoints: [x, y, score, ...], score}; and COCO's annotations: {images, annotations, categories}, whose third
/// numbers are visibilities 0, 1, 2. Results whose third numbers are visibilities are read as such. COCO-WholeBody
/// keeps feet, face and hands in lists of their own.
class CocoKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "coco"; }
  bool recognises(const KeypointFile& file) const override {
    if (!file.document) return false;
    if (find_key(*file.document, {"annotations"})) return true;
    return file.document->is_array() && (file.document->empty() || find_key((*file.document)[0], {"keypoints"}));
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    return CocoReader(*file.document, {file.path.string(), 0}).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_coco_keypoints() { return std::make_unique<CocoKeypoints>(); }

}  // namespace doppel
