#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "doppel/calibration/formats/calibration.h"
#include "doppel/core/config.h"
#include "doppel/data/capture/camera_paths.h"
#include "doppel/data/capture/frame_clock.h"
#include "doppel/detect/keypoints/keypoint_filter.h"
#include "doppel/detect/keypoints/person_choice.h"
#include "doppel/detect/masks/background_model.h"
#include "doppel/detect/masks/chroma_key.h"
#include "doppel/detect/networks/network_options.h"

namespace doppel {

/// What a sequence is for. Settings are chosen on `validation` frames, never on `test` frames.
enum class Split { train, test, validation };
/// The words of the splits: "train", "test", "validation".
const std::vector<std::string>& split_words();
/// @throws UsageError for a word that is not one of `split_words`
Split parse_split(const std::string& word);
std::string to_string(Split split);

/// Background subtraction for a static camera without masks: the pixels that differ from the empty scene are the
/// person.
struct BackgroundSubtraction {
  CameraPaths empty;     ///< the empty scene: a video, an image per frame or a single image; "": the sequence's videos
  long first_frame = 0;  ///< of `empty`, video frames
  std::optional<long> last_frame;  ///< the last of `empty` if not given; always given for the sequence's videos
  BackgroundOptions model;
};

/// One continuous take, seen by all cameras. Paths are as written in the file: relative to `Capture::root`, with the
/// placeholders `{camera}`, `{name}` and `{frame}` (path_pattern.h).
struct SequenceEntry {
  std::string name;
  Split split = Split::train;
  CameraPaths videos;  ///< a video per camera, or an image per frame when it holds {frame}
  CameraPaths masks;   ///< the same; empty when one of the next two is set, or when there are no masks
  std::optional<ChromaKey> chroma_key;
  std::optional<BackgroundSubtraction> subtraction;
  std::map<std::string, long> mask_offset;      ///< camera name -> number of video frame 0 in its mask files
  int mask_threshold = 128;                     ///< pixels >= this value are the person
  bool largest_component = false;               ///< keep only the largest connected part of a mask
  CameraPaths keypoints;                        ///< keypoint files (JSON or a table), or empty
  std::map<std::string, long> keypoint_offset;  ///< camera name -> number of video frame 0 in its keypoint files
  std::optional<PersonChoiceOptions> person;    ///< of several people, the one to follow; nothing: as the capture says
  std::string joints3d;                         ///< table of 3D joints (joint_detections.h), or empty
  std::string motion;                           ///< Skeletool motion file, row f is the pose of frame f; or empty
  std::map<std::string, double> frame_offset;   ///< camera name -> time of motion row 0, in frames of its video
  long first_frame = 0;                         ///< first motion row to use
  std::optional<long> last_frame;               ///< last motion row to use; the last of the motion if not given
  std::vector<long> cuts;                       ///< motion rows that begin a new segment, ascending

  /// Whether masks are computed from the images instead of read from files.
  bool masks_from_images() const { return chroma_key || subtraction; }
  bool has_masks() const { return masks_from_images() || !masks.empty(); }
  /// The number of video frame 0 in the mask files or keypoint files of a camera.
  long mask_offset_of(const std::string& camera) const;
  long keypoint_offset_of(const std::string& camera) const;
  /// @param command that needs the masks, for the message @throws Error without masks; says how to get them
  void require_masks(const std::string& command) const;
};

/// A capture as described by its `capture.yaml` (schema version 1, docs/capture.md): calibrated cameras, synchronised
/// video, masks, and poses where they are known.
struct Capture {
  std::string name;
  std::filesystem::path file;                ///< the capture.yaml this came from; empty when recognised from a folder
  std::filesystem::path root;                ///< absolute; relative paths below start here
  std::string character;                     ///< `.character` file; empty: not made yet
  std::string calibration;                   ///< file or folder of any format that `load_calibration` knows
  CalibrationOptions calibration_options;    ///< keys `unit` and `up`: what the calibration does not state
  double fps = 25.0;                         ///< of the motions
  std::map<std::string, double> camera_fps;  ///< frames per second of the cameras that differ from `fps`, by name
  std::vector<std::string> cameras;          ///< names of the cameras to use; empty: all of the calibration file
  std::string background;                    ///< image of the empty studio per camera, or empty
  std::string landmarks;                     ///< placement file of the landmarks; empty: the skeleton's markers
  std::string keypoint_map;                  ///< a built-in map's name or a file; empty: chosen by the keypoint files
  KeypointFilter keypoint_filter;
  PersonChoiceOptions person;                    ///< of several people, the one to follow: key `person`
  std::optional<PersonNetworkOptions> detector;  ///< for sequences without `keypoints`; paths as written in the file
  std::vector<SequenceEntry> sequences;

  /// The absolute path of `written`. Relative paths start at `root`.
  std::filesystem::path resolve(const std::string& written) const;
  /// The absolute path of one camera's files, or a pattern with `{frame}`.
  /// @param file_index index of the camera in the calibration file
  /// @throws Error when the paths are named by camera, and this camera has none
  std::string source(const CameraPaths& paths, int file_index, const std::string& camera) const;
  /// When the rows of a sequence's motion were filmed by a camera.
  FrameClock clock(const SequenceEntry& sequence, const std::string& camera) const;
  /// Which person of a sequence is followed. @pre one of this capture's sequences
  const PersonChoiceOptions& person_of(const SequenceEntry& sequence) const {
    return sequence.person ? *sequence.person : person;
  }
  /// @throws Error when the capture names no character; says how to make one
  std::filesystem::path character_path() const;
  std::filesystem::path calibration_path() const { return resolve(calibration); }
  /// Whether any sequence has keypoint files, or the capture has a detector.
  bool has_keypoints() const;
};

/// Reads a `capture.yaml`, or the one in a folder. Every value is checked on its own; `prepare` checks whether the
/// files exist and agree with each other.
/// @throws FileError with file:line:key
Capture read_capture(const std::filesystem::path& file_or_folder);
/// Writes a capture, including `root`, so that `read_capture` returns the same capture. `root` is written as a relative
/// path when it is in or beside the folder of the file, otherwise as an absolute path.
/// @param comments lines at the top of the file
void write_capture(const std::filesystem::path& path, const Capture& capture,
                   const std::vector<std::string>& comments = {});
/// Protects a `capture.yaml` that a user wrote. The commands begin theirs with the comment "Written by `doppel ...".
/// @throws UsageError when `path` exists and its first line is not this comment
void check_capture_out(const std::filesystem::path& path);

}  // namespace doppel
