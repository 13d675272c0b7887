#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/landmarks.h"
#include "doppel/character/motion.h"
#include "doppel/character/observable_dofs.h"
#include "support/temporary_folder.h"
#include "track/energy/body_fixture.h"

namespace doppel {

inline constexpr int kJoints = 4, kFrames = 10, kCut = 6;

/// A capture on disk without any motion: masks as images, keypoints and joints in space as tables, landmarks as a
/// placement file.
class TrackCapture : public ::testing::Test {
 protected:
  TrackCapture()
      : character_(make_test_character(kJoints, 8, 14)),
        landmarks_(tube_landmarks(kJoints)),
        dofs_(observable_dofs(character_.skeleton, landmarks_)),
        cameras_(ring_of_cameras(4, 192, middle_of(character_))),
        model_(character_, landmarks_, dofs_) {
    write_calibration(root() / "cameras.yml", {cameras_.begin(), cameras_.end()});
    character_file_ = write_character(root() / "character", character_);
    write_landmarks(root() / "landmarks.csv", character_, landmarks_);
    write_evidence();
    std::ofstream(root() / "capture.yaml")
        << "doppel_capture: 1\nname: tube\ncharacter: " << std::filesystem::relative(character_file_, root()).string()
        << "\ncalibration: cameras.yml\nlandmarks: landmarks.csv\nsequences:\n"
        << "  - {name: walk, split: test, videos: 'none_{name}.mp4', masks: 'mask_{name}_{frame}.png', "
        << "keypoints: points.csv, joints3d: 'joints_{name}.csv', cuts: [" << kCut << "]}\n";
  }

  std::filesystem::path root() const { return folder_.path(); }

  std::vector<double> ground_truth(int frame) const {
    std::vector<double> dofs = character_.rest_dofs;
    for (const int dof : dofs_)
      if (!model_.moves_root(dof)) dofs[dof] += 0.15 * std::sin(0.2 * frame + 1.3 * static_cast<double>(dof));
    dofs[0] += 0.02 * frame + (frame >= kCut ? 0.3 : 0.0);
    dofs[3] += frame >= kCut ? 0.9 : 0.0;
    return dofs;
  }

  void write_evidence() const {
    std::ofstream table(root() / "points.csv");
    table << "frame,camera,name,x,y,confidence\n";
    std::vector<std::ofstream> joints;
    for (const PinholeCamera& camera : cameras_)
      joints.emplace_back(root() / ("joints_" + camera.name + ".csv")) << "frame,index,name,x_mm,y_mm,z_mm\n";
    for (int frame = 0; frame < kFrames; ++frame) {
      const FrameEvidence seen = keypoints_of(model_, cameras_, ground_truth(frame));
      for (std::size_t c = 0; c < cameras_.size(); ++c) {
        const std::string name = "mask_" + cameras_[c].name + "_" + std::to_string(frame) + ".png";
        cv::imwrite((root() / name).string(), mask_of(model_, cameras_[c], ground_truth(frame)));
        if (frame == 3) continue;  // nobody was detected
        write_joints(joints[c], frame, cameras_[c]);
        for (std::size_t m = 0; m < landmarks_.size(); ++m)
          table << frame << ',' << cameras_[c].name << ',' << landmarks_[m].name << ',' << seen[c].keypoints[m].x << ','
                << seen[c].keypoints[m].y << ",0.9\n";
      }
    }
  }

  /// In the camera's axes, from the first landmark.
  void write_joints(std::ofstream& table, int frame, const PinholeCamera& camera) const {
    const PosedBody body = model_.pose(ground_truth(frame), false);
    for (int m = 0; m < model_.num_landmarks(); ++m) {
      const Eigen::Vector3d way = 1e3 * camera.R * (model_.landmark(body, m) - model_.landmark(body, 0));
      table << frame << ',' << m << ',' << landmarks_[m].name << ',' << way.x() << ',' << way.y() << ',' << way.z()
            << '\n';
    }
  }

  double error(const Motion& motion, int frame) const {
    const PosedBody a = model_.pose(motion.frames[frame], false);
    const PosedBody b = model_.pose(ground_truth(frame), false);
    double worst = 0.0;
    for (int m = 0; m < model_.num_landmarks(); ++m)
      worst = std::max(worst, (model_.landmark(a, m) - model_.landmark(b, m)).norm());
    return worst;
  }

  support::TemporaryFolder folder_;
  std::filesystem::path character_file_;
  Character character_;
  std::vector<Marker> landmarks_;
  std::vector<int> dofs_;
  std::vector<PinholeCamera> cameras_;
  PoseModel model_;
};

}  // namespace doppel
