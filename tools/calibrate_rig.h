#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "doppel/calibration/estimation/outline_tracks.h"
#include "doppel/calibration/estimation/point_tracks.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel::tools {

using CalibrationWriting =
    std::function<void(const std::filesystem::path&, const std::vector<Camera>&, const std::string& format)>;

/// What `doppel calibrate sync`, `refine` and `world` work on: a sequence of a capture and what its cameras saw of the
/// person.
struct RigFootage {
  Capture capture;
  std::size_t sequence = 0;  ///< index into capture.sequences
  CaptureCameras filmed;
  PointTracks tracks;

  const SequenceEntry& entry() const { return capture.sequences[sequence]; }
};

/// The capture, and the index of the sequence of a name; without a name the first that has keypoints, otherwise the
/// first. @throws UsageError for an unknown name; FileError and Error as `find_capture`
RigFootage open_rig_footage(const std::filesystem::path& path, const std::string& sequence);
/// Reads the person's points. Points with a confidence below 0.1 count as not seen.
/// @throws Error as read_tracks_of_rough_rig
void read_tracks(RigFootage& footage);
/// The outlines of the person at some times, of the sequence whose tracks were read. A camera whose masks cannot be
/// read has none, and a line of the log says so.
/// @param times seconds @return [C]; empty for a sequence without masks
std::vector<OutlineTrack> read_outlines(const RigFootage& footage, const std::vector<double>& times);
/// The same for the first frames of all cameras, at most 1500.
std::vector<OutlineTrack> read_first_outlines(const RigFootage& footage);

/// The folder of the capture.yaml; for a capture that was recognised from a folder, this folder.
std::filesystem::path folder_of(const Capture& capture);
/// `out`, or without it NAME`ending`.yml in this folder, NAME being that of the capture's calibration.
std::filesystem::path calibration_to_write(const Capture& capture, const std::string& out, const std::string& ending);

/// `check_calibration_target` for cameras that are about to be refined. @throws as it
void check_refined_target(const std::filesystem::path& out, const Capture& capture);
/// Writes a result that took long. When this fails, the cameras are written to `out`.yml instead.
/// @param format empty: by the extension @param write write_calibration or write_intrinsics
/// @throws Error with the reason and the name of the file that was written instead
void write_result(const std::filesystem::path& out, const std::vector<Camera>& cameras, const std::string& format = "",
                  const CalibrationWriting& write = write_calibration);
/// Says how to use the calibration that was written, where keys of the capture would change how it is read.
void print_keys_to_remove(const Capture& capture);

}  // namespace doppel::tools
