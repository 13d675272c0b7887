#include "doppel/detect/keypoints/format.h"

namespace doppel {

const std::vector<std::unique_ptr<KeypointFormat>>& keypoint_formats() {
  static const std::vector<std::unique_ptr<KeypointFormat>> formats = [] {
    std::vector<std::unique_ptr<KeypointFormat>> all;
    all.push_back(make_openpose_keypoints());
    all.push_back(make_easymocap_keypoints());
    all.push_back(make_alphapose_keypoints());
    all.push_back(make_mmpose_keypoints());
    all.push_back(make_coco_keypoints());
    all.push_back(make_table_keypoints());
    all.push_back(make_deeplabcut_keypoints());
    all.push_back(make_wide_keypoints());
    all.push_back(make_freemocap_keypoints());
    return all;
  }();
  return formats;
}

}  // namespace doppel
