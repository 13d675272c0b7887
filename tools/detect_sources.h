#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "doppel/data/capture/frame_clock.h"
#include "doppel/data/capture/video.h"
#include "doppel/detect/keypoints/person_choice.h"
#include "doppel/geometry/camera.h"

namespace doppel::tools {

/// The images of one camera in which people are to be found.
struct DetectSource {
  std::string sequence;                 ///< of a capture; empty otherwise
  std::string camera;                   ///< the camera's name in a capture, otherwise the name of the file or folder
  std::string images;                   ///< what `open_frames` opens
  std::vector<long> frames;             ///< numbers of the frames, ascending
  std::optional<Camera> calibration{};  ///< of a capture; width and height 0 if the calibration does not state them
  FrameClock clock{};                   ///< of a capture
  PersonChoiceOptions person{};         ///< of a capture: whom it names in this sequence
};

/// The first and the last row of the motion whose frames a camera of a capture has.
std::pair<long, long> filmed_rows(const DetectSource& source);

/// Whether the name of a file ends as those of images.
bool is_image(const std::filesystem::path& path);

/// The cameras of what the user named: a video file, a folder of images whose names end in the frame number, or a
/// capture (its videos, within the frames that each sequence uses).
/// @throws UsageError for anything else; FileError and Error as `find_capture` and `open_frames`
std::vector<DetectSource> detect_sources(const std::filesystem::path& path);

}  // namespace doppel::tools
