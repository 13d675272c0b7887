// What moves in the videos, against the keypoints: where nothing is known, nothing is found.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <opencv2/imgcodecs.hpp>

#include "data/doctor/planted_faults.h"
#include "doppel/data/doctor/doctor.h"
#include "doppel/synth/synth.h"
#include "support/temporary_folder.h"

namespace doppel::activity_test {
namespace {

using namespace planted;
using support::TemporaryFolder;
using ::testing::HasSubstr;

std::string told(const Examination& examination) {
  std::string text = to_string(examination.verdict());
  for (const Finding& finding : examination.findings)
    if (finding.severity != Severity::note)
      text += "\n  " + finding.camera + " " + finding.fault + ": " + finding.figure + " " + finding.advice;
  return text;
}

/// A generated capture of four cameras, whose person dances; made once.
const fs::path& dancing_capture() {
  static const TemporaryFolder folder;
  static const fs::path capture = [] {
    synth::SynthOptions options = synth::SynthOptions::preset("tiny");
    options.cameras = 4;
    options.frames = 32;
    options.test_frames = 8;
    synth::write_synthetic_capture(folder / "dancing", options);
    return folder / "dancing";
  }();
  return capture;
}

class DoctorActivity : public ::testing::Test {
 protected:
  /// The sequence of training alone.
  Patient patient() {
    fs::remove_all(folder_ / "patient");
    fs::copy(dancing_capture(), folder_ / "patient", fs::copy_options::recursive);
    Patient patient(folder_ / "patient");
    while (patient.capture.sequences.front().name != "training")
      patient.capture.sequences.erase(patient.capture.sequences.begin());
    patient.capture.sequences.resize(1);
    patient.save();
    return patient;
  }
  Examination examined() const { return examine_capture(read_capture(folder_ / "patient")); }

  /// Only one image of each video, with some noise, and a small thing that moves in it.
  void stand_still(Patient& patient, int seed, double keypoint_noise, double sensor_noise) {
    patient.capture.sequences[0].masks = CameraPaths();
    patient.save();
    cv::RNG random(static_cast<std::uint64_t>(seed));
    for (int c = 0; c < 4; ++c) {
      change_video(patient, c, [&](std::vector<cv::Mat>& images) {
        const cv::Mat still = images.front().clone();
        const int x = random.uniform(5, still.cols - 20), y = random.uniform(5, still.rows - 20);
        for (std::size_t i = 0; i < images.size(); ++i) {
          images[i] = still.clone();
          cv::rectangle(images[i], cv::Rect(x + static_cast<int>(i % 5), y, still.cols / 38, still.cols / 38),
                        cv::Scalar::all(random.uniform(0, 255)), -1);
          if (sensor_noise > 0.0) {
            cv::Mat noise(still.size(), CV_16SC3), noisy;
            random.fill(noise, cv::RNG::NORMAL, 0.0, sensor_noise);
            images[i].convertTo(noisy, CV_16SC3);
            cv::Mat(noisy + noise).convertTo(images[i], CV_8UC3);
          }
        }
      });
      move_frames(patient, c, [](long, long) { return 0L; });
      move_points(patient, c, [&](long, const Eigen::Vector2d& at) {
        return Eigen::Vector2d(at.x() + random.gaussian(keypoint_noise), at.y() + random.gaussian(keypoint_noise));
      });
    }
  }

  /// The person of the keypoints stands elsewhere in the room, in all cameras.
  static void move_person(Patient& patient, const Eigen::Vector3d& shift) {
    const std::vector<Camera> cameras = patient.cameras();
    std::map<std::pair<long, std::size_t>, std::vector<Eigen::Matrix<double, 1, 4>>> rays;
    const auto projection = [&](int c) {
      Eigen::Matrix<double, 3, 4> P;
      P << cameras[c].R, cameras[c].t;
      return Eigen::Matrix<double, 3, 4>(cameras[c].K * P);
    };
    for (int c = 0; c < 4; ++c)
      change_people(patient, c, [&](long frame, std::vector<Numbers>& people) {
        const auto P = projection(c);
        for (std::size_t i = 0; !people.empty() && i + 2 < people[0].size(); i += 3) {
          if (people[0][i + 2] <= 0.0) continue;
          rays[{frame, i}].push_back(people[0][i] * P.row(2) - P.row(0));
          rays[{frame, i}].push_back(people[0][i + 1] * P.row(2) - P.row(1));
        }
      });
    for (int c = 0; c < 4; ++c)
      change_people(patient, c, [&](long frame, std::vector<Numbers>& people) {
        const double width = cameras[c].width, height = cameras[c].height;
        for (std::size_t i = 0; !people.empty() && i + 2 < people[0].size(); i += 3) {
          const auto& rows = rays[{frame, i}];
          Eigen::MatrixXd A(rows.size(), 4);
          for (std::size_t r = 0; r < rows.size(); ++r) A.row(static_cast<Eigen::Index>(r)) = rows[r];
          Numbers& numbers = people[0];
          const bool seen = numbers[i + 2] > 0.0 && rows.size() >= 4;
          Eigen::Vector2d pixel(-1.0, -1.0);
          if (seen) {
            const Eigen::Vector4d point = A.jacobiSvd(Eigen::ComputeFullV).matrixV().col(3);
            pixel = cameras[c].project(point.hnormalized() + shift);
          }
          const bool inside = pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < width && pixel.y() < height;
          numbers[i] = inside ? pixel.x() : 0.0;
          numbers[i + 1] = inside ? pixel.y() : 0.0;
          if (!inside) numbers[i + 2] = 0.0;
        }
      });
  }

  /// The videos as one image for each frame.
  static void write_images(Patient& patient) {
    for (int c = 0; c < 4; ++c) {
      const std::string name = patient.cameras()[c].name;
      fs::create_directories(patient.folder / "images" / name);
      const auto reader =
          open_frames(patient.capture.source(patient.capture.sequences[0].videos, c, name), PixelFormat::colour);
      for (long frame = 0; frame < reader->num_frames(0); ++frame)
        cv::imwrite((patient.folder / "images" / name / fmt::format("{:06}.png", frame)).string(), reader->read(frame));
    }
    patient.capture.sequences[0].videos = CameraPaths("images/{name}/{frame:06}.png");
    patient.save();
  }

  TemporaryFolder folder_;
};

TEST_F(DoctorActivity, OfAPersonWhoStandsStillSaysNothing) {
  for (const int seed : {1, 2, 3, 4, 5, 6})
    for (const double noise : {0.0, 0.5}) {
      Patient still = patient();
      stand_still(still, seed, noise, 4.0 * noise);
      EXPECT_EQ(told(examined()), "healthy") << seed << " " << noise;
    }
}

TEST_F(DoctorActivity, OfAnotherTakeIsOneFindingForAllCameras) {
  for (const Eigen::Vector3d& shift :
       {Eigen::Vector3d(0.7, 0.0, 0.0), Eigen::Vector3d(0.0, 0.0, 0.7), Eigen::Vector3d(-0.7, 0.0, 0.4),
        Eigen::Vector3d(0.0, 0.0, -0.7), Eigen::Vector3d(-0.7, 0.0, 0.0)})
    for (const bool masks : {true, false}) {
      Patient moved = patient();
      if (!masks) moved.capture.sequences[0].masks = CameraPaths();
      moved.save();
      move_person(moved, shift);
      const Examination examination = examined();
      ASSERT_FALSE(examination.findings.empty()) << shift.transpose();
      EXPECT_EQ(examination.findings[0].camera, "") << told(examination);
      EXPECT_EQ(examination.findings[0].fault, "wrong_keypoints") << told(examination);
      EXPECT_THAT(examination.findings[0].figure, HasSubstr("the keypoints are not of this footage"));
      for (std::size_t i = 1; i < examination.findings.size(); ++i)
        EXPECT_EQ(examination.findings[i].severity, Severity::note) << told(examination);
    }
  Patient same = patient();
  move_person(same, Eigen::Vector3d::Zero());
  EXPECT_EQ(told(examined()), "healthy");
}

TEST_F(DoctorActivity, OfVideosThatAreFlippedIsStillNamed) {
  for (const auto& [code, fault] : {std::pair(1, "mirrored"), std::pair(0, "mirrored"), std::pair(-1, "upside_down")}) {
    Patient flipped = patient();
    flipped.capture.sequences[0].masks = CameraPaths();
    flipped.save();
    // The person stands in the right half of the image.
    for (int c = 0; c < 4; ++c) {
      const auto shift = [&](cv::Mat& image) {
        cv::Mat moved;
        const cv::Matx23d map(0.6, 0.0, 0.38 * image.cols, 0.0, 0.6, 0.0);
        cv::warpAffine(image, moved, map, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
        image = moved;
      };
      change_images(flipped, c, shift);
      const double width = flipped.cameras()[c].width;
      move_points(flipped, c, [=](long, const Eigen::Vector2d& at) {
        return Eigen::Vector2d(0.6 * at.x() + 0.38 * width, 0.6 * at.y());
      });
    }
    change_cameras(flipped, [](std::vector<Camera>& cameras) {
      for (Camera& camera : cameras) {
        const double width = camera.width;
        camera.K.topRows<2>() *= 0.6;
        camera.K(0, 2) += 0.38 * width;
      }
    });
    change_images(flipped, 1, [code = code](cv::Mat& image) {
      cv::Mat turned;
      cv::flip(image, turned, code);
      image = turned;
    });
    const Examination examination = examined();
    const bool named =
        std::any_of(examination.findings.begin(), examination.findings.end(), [&](const Finding& finding) {
          return finding.camera == "1" && finding.fault == fault && finding.severity == Severity::fault;
        });
    EXPECT_TRUE(named) << fault << " " << told(examination);
  }
}

TEST_F(DoctorActivity, CamerasWithoutSomeImagesHaveNoLight) {
  Patient missing = patient();
  write_images(missing);
  EXPECT_EQ(told(examined()), "healthy");
  for (const char* image : {"000007.png", "000008.png"}) fs::remove(missing.folder / "images/2" / image);
  const Examination examination = examined();
  ASSERT_FALSE(examination.findings.empty());
  EXPECT_EQ(examination.findings[0].fault, "unreadable");
  EXPECT_EQ(examination.findings[0].camera, "2");
  EXPECT_THAT(examination.findings[0].figure, HasSubstr("2 of its images"));
  EXPECT_THAT(examination.findings[0].advice, AllOf(HasSubstr("frame 7"), HasSubstr("Copy the images again")));
  for (std::size_t i = 1; i < examination.findings.size(); ++i)
    EXPECT_EQ(examination.findings[i].severity, Severity::note) << told(examination);
}

TEST_F(DoctorActivity, CamerasWithoutVideoHaveNoLight) {
  const Patient missing = patient();
  fs::remove(missing.capture.source(missing.capture.sequences[0].videos, 2, "2"));
  const Examination examination = examined();
  ASSERT_FALSE(examination.findings.empty());
  EXPECT_EQ(examination.findings[0].fault, "unreadable");
  for (std::size_t i = 1; i < examination.findings.size(); ++i)
    EXPECT_EQ(examination.findings[i].severity, Severity::note) << told(examination);
}

TEST_F(DoctorActivity, KeypointsOfOtherFramesAreNamed) {
  Patient other = patient();
  for (int c = 0; c < 4; ++c) {
    const std::string pattern = keypoint_pattern(other, other.capture.sequences[0], c);
    fs::create_directories(other.folder / "later" / std::to_string(c));
    for (long frame = 0; fs::exists(expand_pattern(pattern, 0, "", frame)); ++frame)
      fs::copy_file(expand_pattern(pattern, 0, "", frame),
                    other.folder / "later" / std::to_string(c) / fmt::format("{}.json", frame + 5000));
  }
  other.capture.sequences[0].keypoints = CameraPaths("later/{name}");
  other.save();
  const Examination wrong = examined();
  ASSERT_FALSE(wrong.findings.empty());
  EXPECT_EQ(wrong.findings[0].fault, "no_keypoints");
  EXPECT_THAT(wrong.findings[0].figure, HasSubstr("its keypoints are of frames 5000 to 5031"));
  EXPECT_THAT(wrong.findings[0].advice, HasSubstr("keypoint_offset"));
  for (const char* camera : {"0", "1", "2", "3"}) other.capture.sequences[0].keypoint_offset[camera] = 5000;
  other.save();
  EXPECT_EQ(told(examined()), "healthy");
}

}  // namespace
}  // namespace doppel::activity_test
