#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/data/background_model.h"
#include "doppel/data/keypoint_filter.h"
#include "doppel/data/pose_detector.h"

namespace doppel {

/// What a sequence is for.
enum class Split { train, test };
/// "train" or "test". @throws UsageError for another word.
Split parse_split(const std::string& word);
std::string to_string(Split split);

/// How to cut a person out of a uniformly coloured studio when there are no masks. A pixel is background when its
/// chroma is near that of the key, which is either one colour or the picture of the empty studio.
struct ChromaKey {
  enum class Space { hsv, ycrcb };
  Space space = Space::ycrcb;
  bool against_background = false;      ///< compare with the picture `Capture::background` pixel by pixel
  std::vector<int> colour{0, 177, 64};  ///< R G B of the studio, used unless against_background
  /// hsv: degrees of hue (0..180); ycrcb: distance in the (Cr, Cb) plane at the key's brightness (0..181).
  double tolerance = 20.0;
  double min_saturation = 0.25;  ///< hsv only: a background pixel is at least this saturated, 0..1
  int smooth = 3;                ///< diameter of the median filter on the result, odd; 1 = none
};

/// How to cut a person out of pictures of a camera that stands still, when there are no masks: what differs from the
/// empty scene is the person.
struct BackgroundSubtraction {
  std::string empty;     ///< the empty scene: a video, an image per frame or a single image; "": the sequence's videos
  long first_frame = 0;  ///< of `empty`, video frames
  std::optional<long> last_frame;  ///< the last of `empty` if not given; always given for the sequence's videos
  BackgroundOptions model;
};

/// One continuous take, seen by all cameras. Paths are as written in the file: relative to `Capture::root`, with the
/// placeholders `{camera}`, `{name}` and `{frame}` (see `expand_pattern`).
struct SequenceEntry {
  std::string name;
  Split split = Split::train;
  std::string videos;  ///< a video per camera, or an image per frame when it holds {frame}
  std::string masks;   ///< the same; empty when one of the next two is set
  std::optional<ChromaKey> chroma_key;
  std::optional<BackgroundSubtraction> subtraction;
  int mask_threshold = 128;                  ///< a pixel >= this is the person
  bool largest_component = false;            ///< keep only the largest connected part of a mask
  std::string keypoints;                     ///< keypoint files (JSON or a table), or empty
  std::string joints3d;                      ///< table of joints in space (joint_detections.h), or empty
  std::string motion;                        ///< Skeletool motion file; row f belongs to the f-th instant; or empty
  std::map<std::string, long> frame_offset;  ///< camera name -> video frame = motion row + offset
  long first_frame = 0;                      ///< first motion row to use
  std::optional<long> last_frame;            ///< last motion row to use; the last of the motion if not given
  std::vector<long> cuts;                    ///< motion rows that begin a new segment, ascending

  long offset(const std::string& camera) const;
  /// Whether masks are cut out of the pictures instead of read from files.
  bool masks_from_pictures() const { return chroma_key || subtraction; }
};

/// A capture as its `capture.yaml` (schema version 1, docs/capture.md) describes it: calibrated cameras, synchronised
/// video, masks, poses where they are known.
struct Capture {
  std::string name;
  std::filesystem::path file;  ///< the capture.yaml this came from; empty when recognised from a folder
  std::filesystem::path root;  ///< absolute; relative paths below start here
  std::string character;       ///< `.character` file
  std::string calibration;
  double fps = 25.0;
  std::vector<std::string> cameras;  ///< names to use, empty: all of the calibration file
  std::string background;            ///< picture of the empty studio per camera, or empty
  std::string landmarks;             ///< placement file of the landmarks; empty: the skeleton's markers
  std::string keypoint_map;          ///< a built-in map's name or a file; empty: as the keypoint files suggest
  KeypointFilter keypoint_filter;
  std::optional<PoseDetectorOptions> detector;  ///< for sequences without `keypoints`; paths as written
  std::vector<SequenceEntry> sequences;

  /// `written` made absolute: relative paths start at `root`.
  std::filesystem::path resolve(const std::string& written) const;
  /// Absolute path, or pattern with `{frame}`, of one camera's files. @param file_index its place in the calibration
  /// file
  std::string source(const std::string& pattern, int file_index, const std::string& camera) const;
  std::filesystem::path character_path() const { return resolve(character); }
  std::filesystem::path calibration_path() const { return resolve(calibration); }
  /// Whether any sequence names keypoints, or a detector can find some.
  bool has_keypoints() const;
};

/// Reads a `capture.yaml`, or the one in a folder. Every value is checked on its own; whether files exist and agree is
/// the business of `prepare`.
/// @throws FileError with file:line:key
Capture read_capture(const std::filesystem::path& file_or_folder);
/// Writes it, `root` included, so that `read_capture` gives the same capture. `root` is written relative to the file's
/// folder when it lies in it or beside it, else absolute.
void write_capture(const std::filesystem::path& path, const Capture& capture);

/// Fills in the placeholders of a path pattern.
/// - `{camera}` the camera's index in the calibration file, `{camera:03}` with at least three digits
/// - `{name}` its name, `{frame}` and `{frame:012}` the frame number
/// @param frame not needed when the pattern has no {frame}
/// @throws Error for an unknown placeholder, an unclosed brace, or more than 20 digits
std::string expand_pattern(const std::string& pattern, int camera, const std::string& name,
                           std::optional<long> frame = std::nullopt);
/// As above, but keeps `{frame...}` as it stands.
std::string expand_camera(const std::string& pattern, int camera, const std::string& name);
/// Whether a pattern holds {frame}.
bool has_frame_placeholder(const std::string& pattern);

}  // namespace doppel
