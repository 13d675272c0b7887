#include "doppel/calibration/formats/format.h"
#include "doppel/core/error.h"

namespace doppel {
namespace {

std::vector<std::unique_ptr<CalibrationFormat>> make_all() {
  std::vector<std::unique_ptr<CalibrationFormat>> formats;
  formats.push_back(make_skeletool_calibration());
  formats.push_back(make_captury_calibration());
  formats.push_back(make_colmap_calibration());
  formats.push_back(make_easymocap_calibration());
  formats.push_back(make_opencv_stereo_calibration());
  formats.push_back(make_ros_calibration());
  formats.push_back(make_kalibr_calibration());
  formats.push_back(make_caliscope_calibration());
  formats.push_back(make_toml_calibration());
  formats.push_back(make_transforms_calibration());
  formats.push_back(make_gaussian_splatting_calibration());
  formats.push_back(make_panoptic_calibration());
  formats.push_back(make_shelf_calibration());
  formats.push_back(make_aist_calibration());
  formats.push_back(make_human36m_calibration());
  formats.push_back(make_actorshq_calibration());
  formats.push_back(make_qualisys_calibration());
  formats.push_back(make_vicon_calibration());
  formats.push_back(make_optitrack_calibration());
  formats.push_back(make_metashape_calibration());
  formats.push_back(make_realitycapture_calibration());
  formats.push_back(make_zju_calibration());
  formats.push_back(make_opencap_calibration());
  formats.push_back(make_opencv_calibration());  // last: any other file of OpenCV's FileStorage has been recognised
  return formats;
}

}  // namespace

const std::vector<std::unique_ptr<CalibrationFormat>>& calibration_formats() {
  static const std::vector<std::unique_ptr<CalibrationFormat>> formats = make_all();
  return formats;
}

void CalibrationFormat::write(const std::filesystem::path& path, const std::vector<Camera>& /*cameras*/) const {
  fail("writing {}: the format {} can only be read", path.string(), name());
}

}  // namespace doppel
