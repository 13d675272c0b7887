#include "doppel/data/doctor/doctor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "data/doctor/planted_faults.h"
#include "doppel/core/atomic_file.h"
#include "doppel/synth/synth.h"
#include "support/temporary_folder.h"

namespace doppel::doctor_test {
namespace {

using namespace planted;
using support::TemporaryFolder;
using ::testing::HasSubstr;

bool names(const Examination& examination, const std::string& camera, const std::string& fault) {
  return std::any_of(examination.findings.begin(), examination.findings.end(), [&](const Finding& finding) {
    return finding.camera == camera && finding.fault == fault && finding.severity != Severity::note;
  });
}

/// Faults, or warnings, of cameras that nobody touched.
bool accuses_others(const Examination& examination, const std::vector<std::string>& touched) {
  return std::any_of(examination.findings.begin(), examination.findings.end(), [&](const Finding& finding) {
    return finding.severity == Severity::fault && !finding.camera.empty() &&
           std::find(touched.begin(), touched.end(), finding.camera) == touched.end();
  });
}

/// A generated capture, made once.
const std::filesystem::path& healthy_capture() {
  static const TemporaryFolder folder;
  static const std::filesystem::path capture = [] {
    synth::SynthOptions options = synth::SynthOptions::preset("tiny");
    options.cameras = 6;
    options.frames = 48;
    options.test_frames = 12;
    synth::write_synthetic_capture(folder / "healthy", options);
    return folder / "healthy";
  }();
  return capture;
}

struct Planted {
  const char* name;
  const char* fault;
  std::string camera;  ///< empty: all
  bool footage;        ///< whether images and masks must be read to see it
  std::function<void(Patient&)> plant;
};

double width_of(const Patient& patient) { return patient.cameras()[0].width; }

/// The pixels of a camera that is turned on the spot.
std::function<Eigen::Vector2d(const Eigen::Vector2d&)> turned_pixels(const Patient& patient, int camera,
                                                                     const Eigen::Matrix3d& turn) {
  const Eigen::Matrix3d K = patient.cameras()[camera].K, H = K * turn * K.inverse();
  return [H](const Eigen::Vector2d& pixel) { return Eigen::Vector2d((H * pixel.homogeneous()).hnormalized()); };
}

std::vector<Planted> planted_faults() {
  std::vector<Planted> all;
  const auto plant = [&](const char* name, const char* fault, const std::string& camera, bool footage,
                         std::function<void(Patient&)> how) {
    all.push_back({name, fault, camera, footage, std::move(how)});
  };
  const bool kFiles = false, kFootage = true;
  plant("mirrored video and its detections", "mirrored", "3", kFiles, [](Patient& p) {
    const double width = width_of(p);
    change_people(p, 3, [&](long, std::vector<Numbers>& people) {
      for (Numbers& numbers : people) {
        exchange_sides(numbers);
        for (std::size_t i = 0; i < numbers.size(); i += 3)
          if (numbers[i + 2] > 0.0) numbers[i] = width - numbers[i];
      }
    });
  });
  plant("mirrored points", "mirrored", "1", kFiles, [](Patient& p) {
    const double width = width_of(p);
    move_points(p, 1, [=](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(width - at.x(), at.y()); });
  });
  plant("upside down", "upside_down", "0", kFiles, [](Patient& p) {
    const double width = width_of(p);
    move_points(p, 0, [=](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(width - at.x(), width - at.y()); });
  });
  plant("a quarter turn", "turned_90", "2", kFiles, [](Patient& p) {
    const double width = width_of(p);
    move_points(p, 2, [=](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(width - at.y(), at.x()); });
  });
  const auto invert = [](Camera& camera) {
    camera.t = camera.centre();
    camera.R.transposeInPlace();
  };
  plant("inverted extrinsics", "inverted_extrinsics", "2", kFiles, [=](Patient& p) { change_camera(p, 2, invert); });
  plant("all extrinsics inverted", "inverted_extrinsics", "", kFiles, [=](Patient& p) {
    change_cameras(p, [&](std::vector<Camera>& cameras) {
      for (Camera& camera : cameras) invert(camera);
    });
  });
  plant("one camera in another unit", "wrong_unit", "4", kFiles,
        [](Patient& p) { change_camera(p, 4, [](Camera& camera) { camera.t *= 10.0; }); });
  plant("a person of 17 m", "wrong_unit", "", kFiles, [](Patient& p) {
    change_cameras(p, [](std::vector<Camera>& cameras) {
      for (Camera& camera : cameras) camera.t *= 10.0;
    });
  });
  plant("calibrations exchanged", "swapped_cameras", "5", kFiles, [](Patient& p) {
    change_cameras(p, [](std::vector<Camera>& cameras) {
      std::swap(cameras[1].name, cameras[5].name);
      std::swap(cameras[1], cameras[5]);
    });
  });
  plant("videos exchanged", "swapped_cameras", "3", kFootage, [](Patient& p) {
    for (SequenceEntry& sequence : p.capture.sequences) {
      std::map<std::string, std::string> paths;
      for (const char* camera : {"0", "1", "2", "3", "4", "5"})
        paths[camera] = expand_camera(sequence.videos.sample(), std::stoi(camera), camera);
      std::swap(paths["2"], paths["3"]);
      sequence.videos = CameraPaths(paths);
    }
    p.save();
  });
  plant("four frames late", "out_of_sync", "2", kFiles, [](Patient& p) {
    for (SequenceEntry& sequence : p.capture.sequences) sequence.frame_offset["2"] = 4.0;
    p.save();
  });
  plant("a slow clock", "rolling_offset", "1", kFiles, [](Patient& p) {
    move_frames(p, 1, [](long frame, long) { return std::lround(0.85 * static_cast<double>(frame)); });
  });
  plant("zoomed", "focal_length", "0", kFiles,
        [](Patient& p) { change_camera(p, 0, [](Camera& camera) { camera.K.topLeftCorner<2, 2>() *= 1.12; }); });
  plant("principal point", "principal_point", "5", kFiles,
        [](Patient& p) { change_camera(p, 5, [](Camera& camera) { camera.K(0, 2) += 14.0; }); });
  plant("a lens that is not there", "distortion", "3", kFiles, [](Patient& p) {
    change_camera(p, 3, [](Camera& camera) {
      camera.distortion[0] = -0.9;
      camera.distortion[1] = 0.6;
    });
  });
  plant("pushed in the middle", "moved_camera", "4", kFiles, [](Patient& p) {
    const auto pixels = turned_pixels(p, 4, turned(3.0, 5.0, 4.0));
    move_points(p, 4, [&](long frame, const Eigen::Vector2d& at) { return frame >= 20 ? pixels(at) : at; });
  });
  plant("pushed before", "moved_camera", "1", kFiles, [](Patient& p) {
    change_camera(p, 1, [](Camera& camera) {
      const Eigen::Matrix3d turn = turned(4.0, -6.0, 9.0);
      camera.t = turn * camera.t + Eigen::Vector3d(0.2, 0.0, 0.1);
      camera.R = turn * camera.R;
    });
  });
  plant("detected at half the size", "wrong_resolution", "2", kFiles, [](Patient& p) {
    move_points(p, 2, [](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(0.5 * at); });
  });
  plant("frames lost", "frame_drops", "3", kFiles, [](Patient& p) {
    move_frames(p, 3, [](long frame, long frames) { return frames > 20 && frame >= 14 ? frame + 5 : frame; });
  });
  plant("frames doubled", "frame_drops", "1", kFootage, [](Patient& p) {
    change_video(p, 1, [](std::vector<cv::Mat>& images) {
      for (std::size_t i = 4; i < images.size(); i += 6) images[i] = images[i - 1].clone();
    });
  });
  plant("dark", "exposure", "4", kFootage,
        [](Patient& p) { change_images(p, 4, [](cv::Mat& image) { image.convertTo(image, -1, 0.5); }); });
  plant("yellow", "white_balance", "2", kFootage, [](Patient& p) {
    change_images(p, 2, [](cv::Mat& image) { cv::multiply(image, cv::Scalar(0.6, 1.0, 1.0), image); });
  });
  plant("out of focus", "blur", "0", kFootage,
        [](Patient& p) { change_images(p, 0, [](cv::Mat& image) { cv::GaussianBlur(image, image, {}, 2.5); }); });
  plant("masks of another camera", "wrong_masks", "3", kFootage, [](Patient& p) {
    for (SequenceEntry& sequence : p.capture.sequences) {
      std::map<std::string, std::string> paths;
      for (const char* camera : {"0", "1", "2", "3", "4", "5"})
        paths[camera] = expand_camera(sequence.masks.sample(), std::stoi(camera), camera);
      paths["3"] = paths["1"];
      sequence.masks = CameraPaths(paths);
    }
    p.save();
  });
  plant("masks inverted", "wrong_masks", "1", kFootage,
        [](Patient& p) { change_masks(p, 1, [](long, cv::Mat& mask) { mask = 255 - mask; }); });
  plant("masks of the values 0 and 1", "wrong_masks", "2", kFootage,
        [](Patient& p) { change_masks(p, 2, [](long, cv::Mat& mask) { mask = mask / 255; }); });
  plant("masks too wide", "wrong_masks", "5", kFootage, [](Patient& p) {
    change_masks(p, 5, [](long, cv::Mat& mask) {
      cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {35, 35}));
    });
  });
  plant("masks that flicker", "mask_flicker", "0", kFootage, [](Patient& p) {
    change_masks(p, 0, [](long frame, cv::Mat& mask) {
      if (frame % 4 == 1) cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {9, 9}));
    });
  });
  plant("another person", "wrong_person", "4", kFiles, [](Patient& p) {
    move_frames(p, 4, [](long frame, long frames) { return frames - 1 - frame; });
    move_points(
        p, 4, [](long, const Eigen::Vector2d& at) { return Eigen::Vector2d(0.6 * at + Eigen::Vector2d(70.0, 30.0)); });
  });
  plant("z up", "wrong_up", "", kFiles, [](Patient& p) {
    change_cameras(p, [](std::vector<Camera>& cameras) {
      for (Camera& camera : cameras) camera.R = camera.R * turned(90.0, 0.0, 0.0);
    });
    p.capture.calibration_options.up = "+y";
    p.save();
  });
  plant("aimed beside the person", "out_of_view", "5", kFiles, [](Patient& p) {
    const double shift = 0.48 * width_of(p), width = width_of(p);
    change_camera(p, 5, [=](Camera& camera) { camera.K(0, 2) += shift; });
    change_people(p, 5, [=](long, std::vector<Numbers>& people) {
      for (Numbers& numbers : people)
        for (std::size_t i = 0; i < numbers.size(); i += 3) {
          numbers[i] += shift;
          if (numbers[i] > width) numbers[i] = numbers[i + 1] = numbers[i + 2] = 0.0;
        }
    });
  });
  plant("left is right", "keypoints_left_right", "2", kFiles, [](Patient& p) {
    change_people(p, 2, [](long, std::vector<Numbers>& people) {
      for (Numbers& numbers : people) exchange_sides(numbers);
    });
  });
  plant("left is right in a third of the frames", "keypoints_left_right", "3", kFiles, [](Patient& p) {
    change_people(p, 3, [](long frame, std::vector<Numbers>& people) {
      for (Numbers& numbers : people)
        if (frame % 3 == 1) exchange_sides(numbers);
    });
  });
  return all;
}

TEST(DoctorReference, AHealthyCaptureHasNoFinding) {
  const Examination examination = examine_capture(read_capture(healthy_capture()));
  EXPECT_EQ(told(examination), "healthy");
  ASSERT_TRUE(examination.body);
  EXPECT_NEAR(examination.body->stature, 1.7, 0.25);
  const std::string page = doctor_page(examination);
  EXPECT_THAT(page, HasSubstr("This capture is healthy"));
  EXPECT_THAT(page, HasSubstr("data:image/jpeg"));
  const nlohmann::ordered_json json = to_json(examination);
  EXPECT_EQ(json["verdict"], "healthy");
  EXPECT_EQ(json["cameras"].size(), 6u);
}

TEST(DoctorReference, SaysWhichThresholdMasksOfLabelsNeed) {
  const TemporaryFolder folder;
  std::filesystem::copy(healthy_capture(), folder / "patient", std::filesystem::copy_options::recursive);
  Patient patient(folder / "patient");
  change_masks(patient, 2, [](long, cv::Mat& mask) { mask = mask / 255 * 38; });
  const Examination examination = examine_capture(read_capture(folder / "patient"));
  const auto found = std::find_if(examination.findings.begin(), examination.findings.end(),
                                  [](const Finding& finding) { return finding.fault == "wrong_masks"; });
  ASSERT_NE(found, examination.findings.end()) << told(examination);
  EXPECT_THAT(found->figure, HasSubstr("have the values 0, 38, and mask_threshold is 128"));
  EXPECT_THAT(found->advice, HasSubstr("Set `mask_threshold: 1`"));
  for (SequenceEntry& sequence : patient.capture.sequences) sequence.mask_threshold = 1;
  patient.save();
  EXPECT_EQ(told(examine_capture(read_capture(folder / "patient"))), "healthy");
}

class DoctorPlanted : public ::testing::TestWithParam<Planted> {};

TEST_P(DoctorPlanted, IsNamedWithItsCamera) {
  const TemporaryFolder folder;
  std::filesystem::copy(healthy_capture(), folder / "patient", std::filesystem::copy_options::recursive);
  Patient patient(folder / "patient");
  GetParam().plant(patient);
  const Examination examination = examine_capture(read_capture(folder / "patient"), {.footage = GetParam().footage});
  EXPECT_TRUE(names(examination, GetParam().camera, GetParam().fault)) << GetParam().name << ": " << told(examination);
  EXPECT_NE(examination.verdict(), Verdict::healthy);
  std::vector<std::string> touched{GetParam().camera};
  if (std::string(GetParam().fault) == "swapped_cameras") touched = {"1", "5", "2", "3"};
  EXPECT_FALSE(accuses_others(examination, touched)) << GetParam().name << ": " << told(examination);
}

INSTANTIATE_TEST_SUITE_P(Faults, DoctorPlanted, ::testing::ValuesIn(planted_faults()), [](const auto& planted) {
  std::string name = planted.param.name;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
});

TEST(DoctorRejects, CapturesWithoutAnythingToExamine) {
  const TemporaryFolder folder;
  std::filesystem::copy(healthy_capture() / "calibration", folder / "calibration",
                        std::filesystem::copy_options::recursive);
  write_atomically(folder / "capture.yaml",
                   "doppel_capture: 1\nname: bare\ncalibration: calibration/cameras.yml\nsequences:\n"
                   "  - {name: a, split: train, videos: \"videos/{camera}.mp4\", last_frame: 9}\n");
  const Examination examination = examine_capture(read_capture(folder.path()));
  EXPECT_EQ(examination.verdict(), Verdict::faulty);
  EXPECT_TRUE(names(examination, "0", "unreadable")) << told(examination);
  EXPECT_TRUE(names(examination, "", "no_keypoints")) << told(examination);
  EXPECT_THAT(doctor_page(examination), HasSubstr("unreadable"));
}

TEST(DoctorRejects, FilesThatAreDamaged) {
  const TemporaryFolder folder;
  std::filesystem::copy(healthy_capture(), folder / "patient", std::filesystem::copy_options::recursive);
  Patient patient(folder / "patient");
  write_atomically(folder / "patient/training/videos/stream002.mp4", "no video");
  const std::string pattern = keypoint_pattern(patient, patient.capture.sequences[0], 1);
  write_atomically(expand_pattern(pattern, 0, "", 5), "{\"people\": [{");
  const Examination examination = examine_capture(read_capture(folder / "patient"));
  EXPECT_TRUE(names(examination, "2", "unreadable")) << told(examination);
  EXPECT_TRUE(names(examination, "1", "unreadable")) << told(examination);
}

TEST(DoctorRejects, OneCameraCannotBeCompared) {
  Capture capture = read_capture(healthy_capture());
  capture.cameras = {"2"};
  const Examination examination = examine_capture(capture);
  EXPECT_EQ(examination.verdict(), Verdict::healthy) << told(examination);
  ASSERT_EQ(examination.findings.size(), 1u) << told(examination);
  EXPECT_EQ(examination.findings[0].fault, "few_cameras");
}

}  // namespace
}  // namespace doppel::doctor_test
