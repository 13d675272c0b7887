#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// What a reader may need to know of the camera whose keypoints it reads.
struct KeypointCamera {
  std::string name;           ///< chooses the rows of a table
  int index = -1;             ///< position in the calibration; chooses from a file of all cameras (FreeMoCap)
  int width = 0, height = 0;  ///< pixels of its images; needed where x and y are parts of the image's size
};

/// One person as a file has it.
struct DetectedPerson {
  Person body;
  Person rest;  ///< what the file keeps apart from the body: feet, face, left hand, right hand, in this order
};

/// The people of one image. A file may list an image several times, once per person.
struct DetectedImage {
  std::optional<long> frame;  ///< as the file counts; nothing if it does not say
  std::string name;           ///< of the image's file, or empty
  std::vector<DetectedPerson> people;
};

/// What x and y are.
enum class PointUnit {
  unknown,  ///< read_detections finds it by the content
  pixels,
  fractions  ///< of the image's width and height
};

/// The people of one file, as the file has them.
struct Detections {
  std::string format;
  std::vector<DetectedImage> images;
  std::vector<std::string> points;  ///< names of the body's points if the file states them, otherwise empty
  bool by_name = false;             ///< the order of `points` means nothing; any subset may be there
  PointUnit unit = PointUnit::unknown;
};

/// A file to be read.
struct KeypointFile {
  std::filesystem::path path;
  std::string head;                                ///< the first 16 kB
  std::shared_ptr<const nlohmann::json> document;  ///< of a JSON file; null: it is none
};

/// One format of keypoint files. A new format is one file that implements this class, and one line in formats.cpp.
class KeypointFormat {
 public:
  virtual ~KeypointFormat() = default;
  /// The name in messages: lower case, no blanks.
  virtual std::string name() const = 0;
  /// Whether the file has this format, by its content. Must not throw for any content.
  virtual bool recognises(const KeypointFile& file) const = 0;
  /// Reads all people of the file; those of `camera`, if the file holds several cameras. Confidences are 0..1.
  /// @throws FileError for a file that is damaged, or holds nothing of this camera
  virtual Detections read(const KeypointFile& file, const KeypointCamera& camera) const = 0;
};

/// All formats, in the order in which `recognises` is asked.
const std::vector<std::unique_ptr<KeypointFormat>>& keypoint_formats();

std::unique_ptr<KeypointFormat> make_openpose_keypoints();   // openpose.cpp
std::unique_ptr<KeypointFormat> make_easymocap_keypoints();  // easymocap.cpp: annots
std::unique_ptr<KeypointFormat> make_alphapose_keypoints();  // alphapose.cpp: its three containers
std::unique_ptr<KeypointFormat> make_mmpose_keypoints();  // mmpose.cpp: inferencer and demo scripts, RTMPose, Sapiens
std::unique_ptr<KeypointFormat> make_coco_keypoints();    // coco.cpp: results and annotations, ViTPose, HRNet
std::unique_ptr<KeypointFormat> make_table_keypoints();   // keypoint_table.cpp: Doppel's own table
std::unique_ptr<KeypointFormat> make_deeplabcut_keypoints();  // deeplabcut.cpp
std::unique_ptr<KeypointFormat> make_wide_keypoints();        // wide_table.cpp: one row per frame, MediaPipe
std::unique_ptr<KeypointFormat> make_freemocap_keypoints();   // freemocap.cpp: 2D .npy

}  // namespace doppel
