#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/calibration/formats/calibration.h"

namespace doppel {

/// What the user named: a file, or a folder (of a COLMAP model, of EasyMocap's two files, of XMP files).
struct CalibrationSource {
  std::filesystem::path path;
  std::string head;  ///< the first 16 kB of the file; empty for a folder
  bool is_folder = false;
  std::string subject{};  ///< as in CalibrationOptions; empty when the user names none

  /// Whether the head holds a text.
  bool has(std::string_view text) const { return head.find(text) != std::string::npos; }
  /// Whether a line of the head begins with a text.
  bool has_line(std::string_view begin) const { return head.starts_with(begin) || has("\n" + std::string(begin)); }
};

/// One format of calibration files. A new format is one file that implements this class, and one line in formats.cpp.
class CalibrationFormat {
 public:
  virtual ~CalibrationFormat() = default;
  /// The name in messages, in `doppel info --json` and after `doppel calibrate convert --to`: lower case, no blanks.
  virtual std::string name() const = 0;
  /// Whether the source has this format. Decides by content, never by the name of the file alone. Must not throw for
  /// any content.
  virtual bool recognises(const CalibrationSource& source) const = 0;
  /// Reads the cameras in the world of the file. `format`, and the turn to the program's world, are done by the caller.
  /// - Lengths are in metres if the format states or fixes its unit; then `unit` is "m", "cm" or "mm". Otherwise
  /// lengths
  ///   are the numbers of the file, and `unit` is empty.
  /// - `up` is "+y" and the like if the format fixes the axis that points up, otherwise empty.
  /// - The first pixel's centre is (0.5, 0.5): files with centres at integers get +0.5.
  /// @throws FileError with file and, where known, line
  virtual Calibration read(const CalibrationSource& source) const = 0;
  /// Whether one file may hold the cameras of several subjects, so that `CalibrationSource::subject` means something.
  virtual bool has_subjects() const { return false; }
  virtual bool can_write() const { return false; }
  /// Whether files of this extension (".yml") are written in this format when no format is named.
  virtual bool is_default_for(const std::string& /*extension*/) const { return false; }
  /// Writes cameras of the program's world (metres, y up). `path` is a temporary file or, if `writes_folder`, an
  /// existing empty folder. @throws Error when the format cannot hold a camera (its lens model, a missing size)
  virtual void write(const std::filesystem::path& path, const std::vector<Camera>& cameras) const;
  /// The same without poses: intrinsics alone. Formats that must state a pose state one and the same for all cameras.
  virtual void write_intrinsics(const std::filesystem::path& path, const std::vector<Camera>& cameras) const {
    write(path, cameras);
  }
  virtual bool writes_folder() const { return false; }
  /// Whether cameras with lens distortion can be written.
  virtual bool holds_distortion() const { return true; }
};

/// All formats, in the order in which `recognises` is asked.
const std::vector<std::unique_ptr<CalibrationFormat>>& calibration_formats();

std::unique_ptr<CalibrationFormat> make_skeletool_calibration();           // skeletool.cpp
std::unique_ptr<CalibrationFormat> make_colmap_calibration();              // colmap.cpp
std::unique_ptr<CalibrationFormat> make_easymocap_calibration();           // easymocap.cpp
std::unique_ptr<CalibrationFormat> make_opencv_calibration();              // opencv.cpp: our own file
std::unique_ptr<CalibrationFormat> make_opencv_stereo_calibration();       // opencv_stereo.cpp
std::unique_ptr<CalibrationFormat> make_ros_calibration();                 // ros.cpp: camera_info
std::unique_ptr<CalibrationFormat> make_kalibr_calibration();              // kalibr.cpp: camchain
std::unique_ptr<CalibrationFormat> make_toml_calibration();                // toml.cpp: Pose2Sim, aniposelib, FreeMoCap
std::unique_ptr<CalibrationFormat> make_caliscope_calibration();           // caliscope.cpp
std::unique_ptr<CalibrationFormat> make_transforms_calibration();          // transforms.cpp: nerfstudio, instant-ngp
std::unique_ptr<CalibrationFormat> make_gaussian_splatting_calibration();  // gaussian_splatting.cpp: cameras.json
std::unique_ptr<CalibrationFormat> make_panoptic_calibration();            // panoptic.cpp: CMU Panoptic
std::unique_ptr<CalibrationFormat> make_shelf_calibration();               // shelf.cpp: Shelf, Campus
std::unique_ptr<CalibrationFormat> make_aist_calibration();                // aist.cpp: AIST++
std::unique_ptr<CalibrationFormat> make_human36m_calibration();            // human36m.cpp
std::unique_ptr<CalibrationFormat> make_actorshq_calibration();            // actorshq.cpp
std::unique_ptr<CalibrationFormat> make_qualisys_calibration();            // qualisys.cpp
std::unique_ptr<CalibrationFormat> make_vicon_calibration();               // vicon.cpp
std::unique_ptr<CalibrationFormat> make_optitrack_calibration();           // optitrack.cpp
std::unique_ptr<CalibrationFormat> make_metashape_calibration();           // metashape.cpp
std::unique_ptr<CalibrationFormat> make_realitycapture_calibration();      // realitycapture.cpp
std::unique_ptr<CalibrationFormat> make_captury_calibration();             // captury.cpp: Captury, UMA
std::unique_ptr<CalibrationFormat> make_zju_calibration();                 // zju.cpp: annots.npy of ZJU-MoCap
std::unique_ptr<CalibrationFormat> make_opencap_calibration();             // opencap.cpp

}  // namespace doppel
