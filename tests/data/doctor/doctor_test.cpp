#include "doppel/data/doctor/doctor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "data/doctor/planted_faults.h"
#include "doppel/core/atomic_file.h"
#include "doppel/data/doctor/explanation.h"
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

/// The first finding of a fault; null: none.
const Finding* found_of(const Examination& examination, const std::string& camera, const std::string& fault) {
  const auto found =
      std::find_if(examination.findings.begin(), examination.findings.end(),
                   [&](const Finding& finding) { return finding.camera == camera && finding.fault == fault; });
  return found == examination.findings.end() ? nullptr : &*found;
}

/// A copy of the healthy capture, changed.
class DoctorChanged : public ::testing::Test {
 protected:
  DoctorChanged() { std::filesystem::copy(healthy_capture(), folder_ / "patient", kAll); }
  Examination examined(bool footage = true) const {
    return examine_capture(read_capture(folder_ / "patient"), {.footage = footage});
  }
  /// Two cameras exchange the paths that a key names.
  static void exchange(Patient& patient, CameraPaths SequenceEntry::*key, const std::string& a, const std::string& b) {
    for (SequenceEntry& sequence : patient.capture.sequences) {
      std::map<std::string, std::string> paths;
      for (const char* camera : {"0", "1", "2", "3", "4", "5"})
        paths[camera] = expand_camera((sequence.*key).sample(), std::stoi(camera), camera);
      std::swap(paths[a], paths[b]);
      sequence.*key = CameraPaths(paths);
    }
    patient.save();
  }

  static constexpr auto kAll = std::filesystem::copy_options::recursive;
  TemporaryFolder folder_;
};

/// Findings of videos that have some numbers of frames and begin at some rows.
std::string told_of_lengths(const std::vector<std::pair<long, double>>& rows_and_starts) {
  Sightings seen;
  SequenceFootage footage;
  for (const auto& [rows, start] : rows_and_starts) {
    seen.cameras.emplace_back();
    seen.cameras.back().name = std::to_string(footage.size());
    footage.emplace_back();
    footage.back().frames = footage.back().rows = rows;
    footage.back().start = start;
  }
  std::vector<Finding> findings;
  examine_images(seen, nullptr, {footage}, findings);
  std::string text;
  for (const Finding& finding : findings) text += finding.camera + " " + finding.fault + ": " + finding.figure + ". ";
  return text;
}

TEST(DoctorFrames, AreMissingOfEachCameraThatHasFewer) {
  EXPECT_EQ(told_of_lengths({{60, 0}, {60, 0}, {60, 0}, {40, 0}}),
            "3 frame_drops: 20 frames fewer than the other cameras. ");
  EXPECT_EQ(told_of_lengths({{60, 0}, {60, 0}, {40, 0}, {50, 0}}),
            "2 frame_drops: 20 frames fewer than the other cameras. "
            "3 frame_drops: 10 frames fewer than the other cameras. ");
  EXPECT_EQ(told_of_lengths({{60, 0}, {-1, 0}, {60, 0}, {58, -4}}),
            "3 frame_drops: 2 frames fewer than the other cameras. ");
}

TEST(DoctorFrames, AreNotMissingWhereCamerasWereStartedOrStoppedApart) {
  EXPECT_EQ(told_of_lengths({{60, 0}, {60, 0}, {60, 0}, {60, -5}}), "");
  EXPECT_EQ(told_of_lengths({{60, 0}, {60, 0}, {60, 0}, {65, -5}}), "");
  EXPECT_EQ(told_of_lengths({{65, -5}, {65, -5}, {60, 0}, {60, 0}}), "");
  EXPECT_EQ(told_of_lengths({{60, 0}, {60, 0}, {60, 0}, {55, 4.6}}), "");
  EXPECT_EQ(told_of_lengths({{60, 0}, {62, 0}, {65, 0}, {67, 0}}), "") << "stopped by hand";
  EXPECT_EQ(told_of_lengths({{60, 0}, {40, 0}}), "") << "of two cameras, either may be right";
}

TEST_F(DoctorChanged, ACameraThatStartedEarlierOrLaterHasAllFrames) {
  Patient patient(folder_ / "patient");
  change_video(patient, 3, [](std::vector<cv::Mat>& images) {
    const std::size_t count = images.size();
    const cv::Mat first = images.front();
    images.insert(images.begin(), 5, first);
    images.resize(count);
  });
  change_video(patient, 1, [](std::vector<cv::Mat>& images) { images.erase(images.begin(), images.begin() + 2); });
  for (SequenceEntry& sequence : patient.capture.sequences) {
    sequence.frame_offset = {{"1", -2.0}, {"3", 5.0}};
    sequence.keypoint_offset = {{"1", 2}, {"3", -5}};
    sequence.mask_offset = {{"1", 2}, {"3", -5}};
  }
  patient.save();
  EXPECT_EQ(told(examined()), "healthy");
}

TEST_F(DoctorChanged, AWrongKeypointMapIsNamedAndNotUsed) {
  Patient patient(folder_ / "patient");
  patient.capture.keypoint_map = "body25b";
  patient.save();
  const Examination examination = examined();
  const Finding* found = found_of(examination, "", "wrong_keypoints");
  ASSERT_TRUE(found) << told(examination);
  EXPECT_EQ(examination.findings.size(), 1u) << told(examination);
  EXPECT_EQ(found->severity, Severity::fault);
  EXPECT_EQ(found->figure, "keypoint_map is body25b, but the files are body25; correct the key");
  ASSERT_TRUE(examination.body);
  EXPECT_NEAR(examination.body->stature, 1.7, 0.25);
}

TEST_F(DoctorChanged, ADelayIsToldAsTheFrameOffsetThatMendsIt) {
  Patient patient(folder_ / "patient");
  patient.capture.sequences.resize(1);
  SequenceEntry& sequence = patient.capture.sequences[0];
  sequence.last_frame = 38;
  for (const double stated : {4.0, -4.0}) {
    sequence.frame_offset["2"] = stated;
    patient.save();
    const Examination examination = examined(false);
    const Finding* found = found_of(examination, "2", "out_of_sync");
    ASSERT_TRUE(found) << told(examination);
    EXPECT_THAT(found->figure, HasSubstr(stated > 0.0 ? "rows later" : "rows earlier"));
    double mended = NAN;
    ASSERT_EQ(std::sscanf(found->advice.c_str(), "Set `frame_offset` of 2 to %lf (it is ", &mended), 1)
        << found->advice;
    EXPECT_NEAR(mended, 0.0, 0.5) << found->advice;
    EXPECT_THAT(found->advice, HasSubstr(fmt::format("(it is {}).", stated)));
  }
}

TEST_F(DoctorChanged, ADelayOfACameraOfTwiceTheRateIsToldInItsFrames) {
  Patient patient(folder_ / "patient");
  patient.capture.sequences.resize(1);
  SequenceEntry& sequence = patient.capture.sequences[0];
  const std::string pattern = keypoint_pattern(patient, sequence, 2);
  std::vector<nlohmann::json> files;
  for (long frame = 0; fs::exists(expand_pattern(pattern, 0, "", frame)); ++frame)
    files.push_back(read_json(expand_pattern(pattern, 0, "", frame)));
  for (std::size_t frame = 0; frame < 2 * files.size(); ++frame)
    std::ofstream(expand_pattern(pattern, 0, "", static_cast<long>(frame))) << files[frame / 2].dump();
  patient.capture.camera_fps["2"] = 2.0 * patient.capture.fps;
  sequence.last_frame = 38;
  sequence.frame_offset["2"] = 8.0;
  patient.save();
  const Examination examination = examined(false);
  const Finding* found = found_of(examination, "2", "out_of_sync");
  ASSERT_TRUE(found) << told(examination);
  double mended = NAN;
  ASSERT_EQ(std::sscanf(found->advice.c_str(), "Set `frame_offset` of 2 to %lf (it is 8)", &mended), 1)
      << found->advice;
  EXPECT_NEAR(mended, 0.0, 1.0) << found->advice;
}

TEST_F(DoctorChanged, KeypointsOfOtherFramesThanTheMasksAreOneFaultOfAllCameras) {
  for (const bool masks : {false, true}) {
    Patient patient(folder_ / "patient");
    patient.capture.sequences.resize(1);
    SequenceEntry& sequence = patient.capture.sequences[0];
    sequence.last_frame = 40;
    sequence.keypoint_offset.clear();
    for (const char* camera : {"0", "1", "2", "3", "4", "5"})
      (masks ? sequence.mask_offset : sequence.keypoint_offset)[camera] = 6;
    patient.save();
    const Examination examination = examined();
    const Finding* found = found_of(examination, "", masks ? "wrong_masks" : "wrong_keypoints");
    ASSERT_TRUE(found) << told(examination);
    EXPECT_EQ(examination.findings.size(), 1u) << told(examination);
    EXPECT_EQ(found->figure, masks ? "the masks of all cameras are 6 rows later than the keypoints and videos"
                                   : "the keypoints of all cameras are 6 rows later than the masks and videos");
    EXPECT_THAT(found->advice,
                HasSubstr(fmt::format("Set `{}: {{\"0\": 0, \"1\": 0, \"2\": 0, \"3\": 0, \"4\": 0, \"5\": 0}}` for",
                                      masks ? "mask_offset" : "keypoint_offset")));
  }
}

TEST_F(DoctorChanged, ExchangedKeypointFilesAreToldFromExchangedFootage) {
  for (const bool masks : {true, false}) {
    Patient patient(folder_ / "patient");
    exchange(patient, &SequenceEntry::keypoints, "1", "2");
    if (!masks)
      for (SequenceEntry& sequence : patient.capture.sequences) sequence.masks = CameraPaths();
    patient.save();
    const Examination keypoints_alone = examined();
    for (const char* camera : {"1", "2"}) {
      const Finding* found = found_of(keypoints_alone, camera, "swapped_cameras");
      ASSERT_TRUE(found) << told(keypoints_alone);
      EXPECT_THAT(found->advice, HasSubstr("Only the keypoint files of"));
    }
    EXPECT_EQ(keypoints_alone.findings.size(), 2u) << told(keypoints_alone);
    exchange(patient, &SequenceEntry::videos, "1", "2");
    if (masks) exchange(patient, &SequenceEntry::masks, "1", "2");
    const Examination all = examined();
    const Finding* found = found_of(all, "1", "swapped_cameras");
    ASSERT_TRUE(found) << told(all);
    EXPECT_THAT(found->advice, HasSubstr("The footage of cameras 1 and 2 is exchanged"));
    fs::copy(healthy_capture() / "capture.yaml", folder_ / "patient/capture.yaml",
             fs::copy_options::overwrite_existing);
  }
}

/// A camera that shows a body in the rows that `shown` tells, in a sequence with a cut and in a short one. The others
/// see the body as it is.
class DoctorClock : public ::testing::Test {
 protected:
  static constexpr int kPoints = 6;

  static Eigen::Vector3d position(double row, int point) {
    const double turn = 0.21 * row + point;
    return {0.7 * std::sin(0.13 * row) + 0.3 * std::cos(turn), 0.3 * point - 0.8, 0.3 * std::sin(1.3 * turn)};
  }
  /// The fault of the best explanation, and whether jumps are among the explanations.
  static std::pair<std::string, bool> explained(const std::function<double(long row)>& shown) {
    Sightings seen;
    Camera camera;
    camera.width = camera.height = 400;
    camera.K << 300.0, 0.0, 200.0, 0.0, 300.0, 200.0, 0.0, 0.0, 1.0;
    camera.t = {0.0, 0.0, 4.0};
    seen.cameras = seen.calibrated = {camera};
    for (int k = 0; k < kPoints; ++k) {
      seen.points.push_back(std::to_string(k));
      seen.mirrored.push_back(k);
    }
    for (long row = 0; row < 100; ++row) seen.instants.push_back({0, row < 50 ? 0 : 1, row});
    for (long row = 0; row < 13; ++row) seen.instants.push_back({1, 2, row});
    cv::RNG random(3);
    BodyTrack body(seen.num_instants(), kPoints);
    seen.people.emplace_back();
    for (int i = 0; i < seen.num_instants(); ++i) {
      SeenPerson person(kPoints);
      for (int k = 0; k < kPoints; ++k) {
        body.at(i, k) = position(static_cast<double>(seen.instants[i].row), k);
        const Eigen::Vector2d noise(random.gaussian(0.8), random.gaussian(0.8));
        person[k] = {camera.project(position(shown(seen.instants[i].row), k)) + noise, true};
      }
      seen.people[0].push_back({person});
    }
    complete_sightings(seen);
    const auto all = explain_by_time(seen, 0, body, all_instants(seen));
    const bool jumps = std::any_of(all.begin(), all.end(), [](const auto& one) { return one.fault == "frame_drops"; });
    return {best_explanation(all)->fault, jumps};
  }
};

TEST_F(DoctorClock, OfAnotherRateIsNoJump) {
  for (const double rate : {0.96, 0.985, 1.04})
    EXPECT_EQ(explained([=](long row) { return rate * static_cast<double>(row); }),
              std::pair(std::string("rolling_offset"), false))
        << rate;
}

TEST_F(DoctorClock, ThatJumpsIsNoOtherRate) {
  for (const double lost : {3.0, 6.0})
    EXPECT_EQ(explained([=](long row) { return static_cast<double>(row) + (row >= 60 ? lost : 0.0); }),
              std::pair(std::string("frame_drops"), true))
        << lost;
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
