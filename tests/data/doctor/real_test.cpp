// Healthy captures of a real person and of a real studio, and faults planted into copies of their small files.

#include <gtest/gtest.h>

#include <algorithm>

#include "data/doctor/planted_faults.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/doctor/doctor.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::real_doctor_test {
namespace {

using namespace planted;
using support::TemporaryFolder;

class RealDoctor : public support::SharedFolderTest {
 protected:
  /// Links to all files of a capture, with a capture.yaml of its own.
  Patient patient_of(const std::string& name) {
    const fs::path original = shared_ / "captures" / name;
    fs::create_directories(folder_ / name);
    for (const auto& entry : fs::recursive_directory_iterator(original)) {
      const fs::path copy = folder_ / name / entry.path().lexically_relative(original);
      if (entry.is_directory())
        fs::create_directories(copy);
      else
        fs::create_symlink(entry.path(), copy);
    }
    Capture capture = name == "p2s" ? guess_folder(folder_ / name).capture : find_capture(folder_ / name);
    write_capture(folder_ / name / "capture.yaml", capture);
    return Patient(folder_ / name);
  }

  void expect_named(const Patient& patient, const std::string& camera, const std::string& fault) {
    const Examination examination = examine_capture(read_capture(patient.folder), {.footage = false});
    const bool named =
        std::any_of(examination.findings.begin(), examination.findings.end(), [&](const Finding& finding) {
          return finding.camera == camera && finding.fault == fault && finding.severity == Severity::fault;
        });
    EXPECT_TRUE(named) << camera << " " << fault << ": " << told(examination);
    for (const Finding& finding : examination.findings)
      EXPECT_TRUE(finding.severity != Severity::fault || finding.camera == camera || fault == "swapped_cameras")
          << told(examination);
  }

  TemporaryFolder folder_;
};

TEST_F(RealDoctor, TheStudioIsHealthy) {
  const Patient patient = patient_of("s22");
  const Examination examination = examine_capture(read_capture(patient.folder));
  EXPECT_EQ(told(examination), "healthy");
}

TEST_F(RealDoctor, RealFootageIsHealthy) {
  const Patient patient = patient_of("p2s");
  const Examination examination = examine_capture(read_capture(patient.folder));
  EXPECT_EQ(examination.verdict(), Verdict::healthy) << told(examination);
}

struct RealPlanted {
  const char* name;
  const char* fault;
  int camera;
  std::function<void(Patient&, int camera)> plant;
};

std::vector<RealPlanted> real_faults() {
  const auto image = [](const Patient& p, int c) {
    const Camera camera = p.cameras()[c];
    return Eigen::Vector2d(camera.width, camera.height);
  };
  return {
      {"mirrored", "mirrored", 1,
       [=](Patient& p, int c) {
         const double width = image(p, c).x();
         move_points(p, c, [=](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(width - at.x(), at.y()); });
       }},
      {"upside down", "upside_down", 0,
       [=](Patient& p, int c) {
         const Eigen::Vector2d size = image(p, c);
         move_points(p, c, [=](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(size - at); });
       }},
      {"inverted", "inverted_extrinsics", 2,
       [](Patient& p, int c) {
         change_camera(p, c, [](Camera& camera) {
           camera.t = camera.centre();
           camera.R.transposeInPlace();
         });
       }},
      {"unit", "wrong_unit", 3,
       [](Patient& p, int c) { change_camera(p, c, [](Camera& camera) { camera.t *= 1000.0; }); }},
      {"late", "out_of_sync", 1,
       [](Patient& p, int c) {
         for (SequenceEntry& sequence : p.capture.sequences) sequence.frame_offset[p.cameras()[c].name] = 8.0;
         p.save();
       }},
      {"zoomed", "focal_length", 0,
       [](Patient& p, int c) { change_camera(p, c, [](Camera& camera) { camera.K.topLeftCorner<2, 2>() *= 1.2; }); }},
      {"principal point", "principal_point", 2,
       [=](Patient& p, int c) {
         const double shift = 0.08 * image(p, c).x();
         change_camera(p, c, [=](Camera& camera) { camera.K(0, 2) += shift; });
       }},
      {"half size", "wrong_resolution", 3,
       [](Patient& p, int c) {
         move_points(p, c, [](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(0.5 * at); });
       }},
      {"pushed", "moved_camera", 0,
       [](Patient& p, int c) {
         const Eigen::Matrix3d K = p.cameras()[c].K, H = K * turned(4.0, 6.0, 5.0) * K.inverse();
         move_points(p, c, [=](long frame, const Eigen::Vector2d& at) {
           return frame >= 40 ? Eigen::Vector2d((H * at.homogeneous()).hnormalized()) : at;
         });
       }},
  };
}

TEST_F(RealDoctor, FaultsInTheStudioAreNamed) {
  for (const RealPlanted& planted : real_faults()) {
    SCOPED_TRACE(planted.name);
    Patient patient = patient_of("s22");
    planted.plant(patient, planted.camera);
    expect_named(patient, patient.cameras()[planted.camera].name, planted.fault);
    fs::remove_all(patient.folder);
  }
}

TEST_F(RealDoctor, FaultsInRealFootageAreNamed) {
  for (const RealPlanted& planted : real_faults()) {
    SCOPED_TRACE(planted.name);
    Patient patient = patient_of("p2s");
    planted.plant(patient, planted.camera);
    expect_named(patient, patient.cameras()[planted.camera].name, planted.fault);
    fs::remove_all(patient.folder);
  }
}

}  // namespace
}  // namespace doppel::real_doctor_test
