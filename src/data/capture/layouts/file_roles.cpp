#include "doppel/data/capture/layouts/file_roles.h"

#include <algorithm>
#include <vector>

#include "doppel/data/capture/layouts/name_words.h"

namespace doppel {

namespace {

using Words = std::set<std::string>;

const Words kMaskWords{"mask",         "masks",        "msk",         "fg",    "foreground", "foregroundsegmentation",
                       "seg",          "silhouette",   "silhouettes", "matte", "alpha",      "mattes",
                       "segmentation", "segmentations"};
const Words kEmptyWords{"empty", "background", "backgrounds", "bg", "bkg", "backplate", "emptyscene"};
const Words kUnusedWords{"board",      "boards",     "checkerboard", "chessboard", "charuco", "calib",   "calibration",
                         "intrinsics", "extrinsics", "depth",        "normal",     "normals", "overlay", "overlays",
                         "preview",    "previews",   "render",       "renders",    "debug",   "texture", "textures"};
const Words kKindWords{"video",     "videos",     "image",   "images",   "img",       "imgs",      "rgb",
                       "rgbs",      "frame",      "frames",  "cam",      "camera",    "cameras",   "view",
                       "views",     "stream",     "streams", "color",    "colour",    "raw",       "footage",
                       "recording", "recordings", "hd",      "keypoint", "keypoints", "openpose",  "mmpose",
                       "alphapose", "pose",       "poses",   "json",     "jsons",     "detection", "detections",
                       "people",    "c",          "d",       "data",     "cihp"};

bool has_word(const std::vector<NameWord>& words, const Words& wanted) {
  return std::any_of(words.begin(), words.end(), [&](const NameWord& word) { return wanted.count(word.text) > 0; });
}

std::vector<std::string> words_in_order(const std::string& path) {
  std::vector<std::string> telling;
  for (const NameWord& word : words_of(path))
    if (!kMaskWords.count(word.text) && !kEmptyWords.count(word.text) && !kKindWords.count(word.text))
      telling.push_back(word.text);
  return telling;
}

}  // namespace

FileRole role_of_file(const std::string& path) {
  const std::vector<NameWord> words = words_of(path);
  if (has_word(words, kUnusedWords)) return FileRole::unused;
  if (has_word(words, kEmptyWords)) return FileRole::empty;
  return has_word(words, kMaskWords) ? FileRole::masks : FileRole::footage;
}

std::set<std::string> telling_words(const std::string& path) {
  const std::vector<std::string> words = words_in_order(path);
  return {words.begin(), words.end()};
}

std::string telling_name(const std::string& path) {
  std::string name;
  for (const std::string& word : words_in_order(path)) name += (name.empty() ? "" : "_") + word;
  return name;
}

}  // namespace doppel
